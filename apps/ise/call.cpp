// ise call: calls a service and prints the response as JSON.
#include "options.hpp"
#include "target.hpp"

#include <memory>

namespace ise::cli {
namespace {

struct call_options {
    std::string name, service;
    std::string json; ///< the request; empty: none was given
};

task<> call(context& in, call_options options) {
    auto who = co_await reach(in, options.name);
    auto service = co_await find_service(in, who, options.service, service_kind::request_response);
    auto request = co_await request_from(in, service, options.name, options.json);
    auto response = co_await call_dynamic(who, service, std::move(request), in.left());
    if (!response) throw problem(response.error()).of_call(response.error().executed());
    bool pretty = in.set.pretty || (!in.set.json && in.out.is_terminal());
    auto style = pretty ? json_style::pretty : json_style::compact;
    // On another thread: a long response must not silence the heartbeats.
    auto show = [packet = std::move(*response), style] { return packet.to_json(style) + "\n"; };
    auto text = co_await in.self.offload(std::move(show));
    co_await in.out.write(in.self, std::move(text));
}

void declare_call(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<call_options>();
    add_component(app, given->name);
    app.add_option("SERVICE", given->service, "name of a request-response service")->required();
    app.add_option("JSON", given->json,
                   "request; - reads standard input; {} uses the defaults (required if it has fields)");
    app.callback([&made, given] {
        if (!given->json.empty()) given->json = json_given(given->json);
        made.work = [given](context& in) { return call(in, *given); };
    });
}

} // namespace

extern const command call_command{"call", talk_group, "calls a service and prints the response as JSON",
                                  "  ise call atirma/boat helm '{\"mode\":\"hold\"}'\n"
                                  "  ise call atirma/boat helm {}             every field has its default\n"
                                  "  ise call atirma/boat plan - < route.json\n",
                                  declare_call};

} // namespace ise::cli
