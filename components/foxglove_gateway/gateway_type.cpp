#include <components/foxglove_gateway/foxglove_gateway.hpp>

#include <ise/core/error.hpp>

#include <fmt/format.h>

#include <chrono>
#include <utility>

namespace ise::foxglove {

component_type gateway_type(std::string name, std::string path, gateway_options defaults,
                            std::function<void(const std::string&)> announce) {
    component_type type(std::move(name), "shows the system to Foxglove and Lichtblick, live", std::move(path));
    auto options = std::make_shared<gateway_options>(std::move(defaults));
    auto deadline_s = std::make_shared<double>(std::chrono::duration<double>(options->call_deadline).count());
    options->on_listening = [announce](const std::string& url) { announce("ready: " + url); };
    auto& set = type.parameters;
    set.add("address", options->address, "numeric address to listen on").kind(parameter_kind::address);
    set.add("port", options->port, "port to listen on; 0: any free one").port_at("address");
    set.add("origin", options->origins,
            "origin of pages that may connect, with its scheme; *: any page. Foxglove's own and pages "
            "of this host may in any case");
    set.add("max-viewers", options->max_viewers, "viewers at once").range(1, 10000);
    options->add_to(set);
    set.add("depth", options->viewer.depth, "messages of each channel that wait for a slow viewer; the newest are kept")
        .range(1, 10000);
    set.add("allow-calls", options->allow_calls, "viewers may call services");
    set.add("allow-parameters", options->allow_parameters, "viewers may set parameters");
    set.add("allow-publish", options->allow_publish, "viewers may publish messages");
    set.add("call-seconds", *deadline_s, "deadline of calls").range(0.1, 3600).unit("s");
    set.add("assets", options->assets, "folder of files that viewers may fetch as assets; empty: none")
        .kind(parameter_kind::path);
    type.provides(status_service).provides(published_service);
    type.make = [options, deadline_s] {
        auto made = *options;
        made.call_deadline = std::chrono::duration_cast<duration>(std::chrono::duration<double>(*deadline_s));
        return std::make_unique<foxglove_gateway>(std::move(made));
    };
    return type;
}

} // namespace ise::foxglove
