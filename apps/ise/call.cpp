#include "commands.hpp"

#include "description.hpp"
#include "target.hpp"

#include <fmt/format.h>

namespace ise::cli {

task<> call(context& in, call_options options) {
    auto who = co_await reach(in, options.name);
    auto service = co_await find_service(in, who, options.service, service_kind::request_response);
    const auto& asked = service.packet(role::request);
    // Defaults by surprise could start a motor.
    if (options.json.empty() && !asked.type().members.empty()) {
        auto advice = fmt::format("it is {}\ngive what matters, or {{}} for the defaults:\n{}", asked.pretty(),
                                  example(options.name, service));
        while (advice.ends_with('\n')) advice.pop_back();
        throw problem(exit_code::usage, "usage",
                      fmt::format("the request of '{}' has fields, and none was given", options.service),
                      std::move(advice));
    }
    if (options.json.empty()) options.json = "{}";
    auto request = co_await packet_from(in, service.packet(role::request), options.json, "request");
    auto response = co_await call_dynamic(who, service, std::move(request), in.left());
    if (!response) throw problem(response.error()).of_call(response.error().executed());
    bool pretty = in.set.pretty || (!in.set.json && in.out.is_terminal());
    auto style = pretty ? json_style::pretty : json_style::compact;
    // On another thread: a long response must not silence the heartbeats.
    auto show = [packet = std::move(*response), style] { return packet.to_json(style) + "\n"; };
    auto text = co_await in.self.offload(std::move(show));
    co_await in.out.write(in.self, std::move(text));
}

} // namespace ise::cli
