// environment-boundary: what a program's own main would do: its streams, its real environment
#include <ise/component/process_services.hpp>
#include <ise/component/program_words.hpp>

#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>

#include <fmt/format.h>

#include <cstdio>
#include <map>

namespace ise::detail {
namespace {

/// The component through which the others are started and stopped. It is anonymous: only who knows its endpoint reaches
/// it.
class host_component final : public component {
public:
    host_component(const type_maker& types, node& around, environment& world)
        : types_(types), node_(around), world_(world) {}

private:
    task<> run() override {
        provide_exclusive(process_host::start,
                          [this](process_host::start_request request) { return begin(std::move(request)); });
        provide(process_host::stop, [this](process_host::stop_request request) {
            if (lives_.contains(request.path)) node_.stop(request.path);
            return process_host::stop_response{};
        });
        provide(process_host::components, [this](process_host::components_request) { return tell(); });
        co_await ready();
        co_await sleep_till(time_point::max());
    }

    task<process_host::start_response> begin(process_host::start_request request) {
        co_await this_task::ignore_cancellation; // what was launched is known, also where nobody waits for it any more
        std::string path;
        std::string why;
        try {
            auto work = [this, words = std::move(request.words)] { return launch(words); };
            path = co_await offload(std::move(work));
        } catch (const wrong_words& thrown) {
            why = thrown.what();
        } catch (const error& thrown) {
            why = thrown.what();
        }
        if (!why.empty()) throw error(errc::refused, why);
        process_host::start_response made;
        made.number = ++last_;
        lives_[path] = made.number;
        co_return made;
    }

    // On another thread: launching waits for the loop of what is launched. One at a time.
    std::string launch(std::vector<std::string> words) const {
        if (words.empty()) throw wrong_words("no type is named");
        auto types = types_(); // of its own: parameters are variables
        auto& type = type_among(types, words.front());
        words.erase(words.begin());
        auto where = read_words(words, &type);
        if (where.path.empty()) where.path = type.about.path;
        if (where.path.empty())
            throw wrong_words(fmt::format("type '{}' has no path of its own: give one", type.about.name));
        take_parameters(type, where.component, world_);
        node_.launch(where.path, type.make(), std::move(where.component));
        fmt::print("started: {}\n", where.path);
        std::fflush(stdout);
        return where.path;
    }

    process_host::components_response tell() const {
        std::map<std::string, process_host::hosted> all;
        for (const auto& one : node_.components()) { // a later life stands behind an earlier one
            auto life = lives_.find(one.path);
            if (life == lives_.end()) continue;
            process_host::hosted made;
            made.path = one.path;
            made.number = life->second;
            made.over = one.state >= component_state::stopped;
            all[one.path] = std::move(made);
        }
        for (const auto& report : node_.reports()) {
            auto found = all.find(report.path);
            if (found == all.end() || !found->second.over) continue;
            found->second.failure = report.failure;
            found->second.stuck = !report.still_running.empty();
        }
        process_host::components_response made;
        for (auto& [path, one] : all) made.components.push_back(std::move(one));
        return made;
    }

    const type_maker& types_;
    node& node_;
    environment& world_;
    std::map<std::string, std::uint64_t> lives_; // by path
    std::uint64_t last_ = 0;
};

} // namespace

int run_process_host(const type_maker& types, program_words where, const std::string& program) {
    if (where.control.empty()) throw wrong_words("`host` requires an endpoint for its control: --control=ENDPOINT");
    real_environment world;
    where.node.name = program;
    node running(world, std::move(where.node));
    component_options mine;
    mine.listen = where.control;
    mine.registers = false;
    mine.policy = on_failure::stop_node;
    running.start<host_component>("", std::move(mine), types, running, world);
    int code = run_until_signal(running);
    for (const auto& report : running.reports()) {
        if (!report.failure.empty()) complain(program, fmt::format("{}: {}", report.path, report.failure));
        for (const auto& name : report.still_running)
            complain(program, fmt::format("{} did not end in time: {}", report.path, name));
    }
    return code;
}

} // namespace ise::detail
