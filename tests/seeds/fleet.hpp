#pragma once
#include "stage.hpp"

#include <ise/component/node.hpp>
#include <ise/name_server/name_server.hpp>

#include <memory>
#include <vector>

namespace seeds {

class contender;

/// The processes of a run: what runs in them, and how they come and go.
class fleet {
public:
    explicit fleet(stage& of);

    /// The name server and everything of the plan.
    void start();

    struct hull { // what one process holds, from its start to its end
        std::uint64_t life = 0;
        std::unique_ptr<ise::node> node;
        std::vector<std::unique_ptr<contender>> contenders;
    };
    enum class state : std::uint8_t { down, up, stopping };
    struct ship {
        process_plan what;
        std::vector<component_plan> components;
        std::vector<std::string> contends; // paths
        state now = state::down;
        ise::sim::process* process = nullptr;
        hull* held = nullptr;
        bool frozen = false;
        std::uint64_t starts = 0;
    };

    std::size_t ships() const noexcept { return ships_.size(); }
    ship& at(std::size_t number) { return *ships_[number]; }
    /// Which ship has that component by the plan.
    std::size_t ship_of(std::size_t component) const { return stage_.plan.components[component].process; }
    /// A process that the plan did not have.
    std::size_t add(process_plan what, std::vector<component_plan> components);

    void launch(ship& which);
    void crash(ship& which);
    void freeze(ship& which);
    void thaw(ship& which);
    /// Stops it in order, and sees that nothing of it is left; then `next`.
    void stop(ship& which, std::function<void()> next);
    void crash_host(const std::string& host);
    void boot_host(const std::string& host);
    void stop_component(ship& which, const component_plan& one, std::function<void()> next);
    void start_component(ship& which, const component_plan& one);

    void crash_server();
    void launch_server();
    void freeze_server();
    void thaw_server();
    ise::sim::process* server() noexcept { return server_; }
    const ise::registry* names() const;

    /// Everything that is down comes up.
    void all_up();
    bool all_launched() const;

private:
    std::shared_ptr<hull> build(ship& which, ise::sim::process& env);
    ise::node_options node_options(const std::string& name) const;
    ise::component_options options_of(const ship& which, const component_plan& one, std::uint64_t life) const;
    void check_stopped(ship& which, ise::time_point limit, std::function<void()> next);
    void check_nothing_left(std::uint64_t life, const std::string& who);

    stage& stage_;
    std::vector<std::unique_ptr<ship>> ships_;
    ise::sim::process* server_ = nullptr;
    ise::name_server* names_ = nullptr;
    bool server_frozen_ = false;
    bool fresh_ = true;
    std::uint64_t lives_ = 0;
};

} // namespace seeds
