#include "subscription.hpp"

#include <ise/service/action.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise::cli {

void add_subscription(command_line::app& app, subscribe_choice& what) {
    add_component(app, what.name);
    app.add_option("SERVICE", what.service, "name of a subscription service")->required();
    app.add_option("JSON", what.json, "subscribe request; - reads standard input (default: {})");
    auto* latest = app.add_flag("--latest", what.latest, "keep only the latest packet");
    app.add_flag("--lossless", what.lossless,
                 "every packet, with flow control; a subscription that falls too far behind ends")
        ->excludes(latest);
    app.add_option("--depth", what.depth, "packets queued at either end, 1 to 65536 (default: 1024)")
        ->check(command_line::range(1u, 65536u))
        ->type_name("N");
}

task<dynamic_stream> open_stream(context& in, subscribe_choice choice, subscribe_options terms,
                                 std::function<void(const dynamic_contract&)> check) {
    auto who = co_await reach(in, choice.name);
    auto service = co_await find_service(in, who, choice.service, service_kind::subscription);
    if (is_action(*service.types()))
        throw problem(
            exit_code::usage, "usage",
            fmt::format("'{}' at {} is an action: subscribing to it would begin a run", choice.service, choice.name),
            "run it:\n" + example(choice.name, service));
    if (check) check(service);
    auto request = co_await packet_from(in, service.packet(role::subscribe_request), choice.json, "subscribe request");
    terms.policy = choice.latest ? overflow::keep_latest : choice.lossless ? overflow::lossless : overflow::keep_last;
    terms.depth = choice.depth;
    terms.deadline = in.left();
    auto stream = co_await subscribe_dynamic(who, service, std::move(request), terms);
    if (!stream) throw problem(stream.error());
    co_return std::move(*stream);
}

task<dynamic_stream> open_stream(context& in, subscribe_choice choice, subscribe_options terms) {
    return open_stream(in, std::move(choice), terms, nullptr);
}

} // namespace ise::cli
