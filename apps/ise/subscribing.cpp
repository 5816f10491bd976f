#include "subscribing.hpp"

#include <fmt/format.h>

namespace ise::cli {

task<dynamic_stream> open_stream(context& in, subscribe_choice choice, subscribe_options terms) {
    auto who = co_await reach(in, choice.name);
    auto service = co_await find_service(in, who, choice.service, service_kind::subscription);
    auto request = co_await packet_from(in, service.packet(role::subscribe_request), choice.json, "subscribe request");
    terms.policy = choice.latest ? overflow::keep_latest : choice.lossless ? overflow::lossless : overflow::keep_last;
    terms.depth = choice.depth;
    terms.deadline = in.left();
    auto stream = co_await subscribe_dynamic(who, service, std::move(request), terms);
    if (!stream) throw problem(stream.error());
    co_return std::move(*stream);
}

std::string show_loss(std::optional<std::uint64_t> lost) {
    if (!lost) return "the provider restarted: it is unknown how many packets were lost";
    return fmt::format("{} packet{} lost", *lost, *lost == 1 ? " was" : "s were");
}

} // namespace ise::cli
