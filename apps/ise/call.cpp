#include "commands.hpp"

#include "target.hpp"

namespace ise::cli {

task<> call(context& in, call_options options) {
    auto who = co_await reach(in, options.name);
    auto service = co_await find_service(in, who, options.service, service_kind::request_response);
    auto request = packet_from(service.packet(role::request), options.json, "request");
    auto response = co_await call_dynamic(who, service, std::move(request), in.left());
    if (!response) throw problem(response.error()).of_call(response.error().executed());
    bool pretty = in.set.pretty || (!in.set.json && in.out.is_terminal());
    auto text = response->to_json(pretty ? json_style::pretty : json_style::compact) + "\n";
    co_await in.out.write(in.self, std::move(text));
}

} // namespace ise::cli
