#pragma once
#include <ise/component/component.hpp>
#include <ise/name_server/registry.hpp>

#include <map>
#include <memory>
#include <set>
#include <string>

namespace ise {

struct name_server_options {
    /// The longest lease that is granted. For as long after its start it also leaves names to those who held them
    /// before: see `registry_options::recovery`.
    duration lease = std::chrono::seconds(2);
    /// There was no name server before: names are granted at once.
    bool fresh = false;
    registry_limits limits;
};

/// The name server: an ordinary component that keeps a `registry` and answers for it (ise/naming/services.hpp). It is
/// started with `registers = false` in a node with `use_names = false`, on an endpoint that everybody knows:
///
///     component_options options;
///     options.listen = {default_name_server()};
///     options.registers = false;
///     node.start<name_server>(std::string(naming::server_path), options);
class name_server final : public component {
public:
    explicit name_server(name_server_options options = name_server_options());
    ~name_server() override;

    /// On its loop; null before it runs.
    const registry* names() const noexcept { return registry_.get(); }

private:
    task<> run() override;
    task<naming::await_response> wait_for(std::string path, time_point until);
    /// What every change ends with: watchers hear of it, and those who wait for a name.
    void changed();
    void welcome(std::uint64_t watcher);
    void tick();

    struct watcher {
        std::string prefix;
        bool has_snapshot = false;
    };

    name_server_options options_;
    std::unique_ptr<registry> registry_;
    publication<subscription<naming::name_events, naming::watch_request>> events_;
    std::map<std::uint64_t, watcher> watchers_;          // by the subscriber's number
    std::multimap<std::string, waiter<>*> waiting_;      // for names
    std::unique_ptr<timer> tick_;
};

} // namespace ise
