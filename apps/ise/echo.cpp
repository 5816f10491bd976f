#include "subscribing.hpp"

#include "text.hpp"

#include <fmt/format.h>

#include <utility>

namespace ise::cli {
namespace {

constexpr duration look_period = std::chrono::milliseconds(250);

void append_line(std::string& text, const received<dynamic_packet>& packet, json_style style, bool envelope) {
    auto json = packet->to_json(style);
    if (!envelope) {
        text += json;
    } else {
        auto lost = packet.lost_before();
        text += fmt::format("{{\"lost_before\":{},\"packet\":{}}}", lost ? std::to_string(*lost) : "null", json);
    }
    text += '\n';
}

// What the provider answered to the subscription: beside the packets, so that each line of the answer stays one.
void show_response(const settings& set, const std::string& service, const dynamic_packet& response) {
    if (response.encoded().empty()) return; // it has nothing to say
    auto json = response.to_json();
    complain(set.json ? fmt::format("{{\"response\":{}}}\n", json)
                      : fmt::format("ise: '{}' answers {}\n", printable(service), printable(json)));
}

} // namespace

task<> echo(context& in, echo_options options) {
    subscribe_options terms;
    terms.min_interval = options.every;
    terms.last_value = !options.no_last_value;
    auto stream = co_await open_stream(in, options.what, terms);
    show_response(in.set, options.what.service, stream.response());
    bool over = false;
    timer end(in.self.on(), [&] {
        over = true;
        stream.leave();
    });
    if (options.length) end.arm(saturating_add(in.self.now(), *options.length));
    bool reached = true;
    timer look(in.self.on(), [&] { // silence alone does not tell whether there is nobody or nothing new
        if (stream.ended()) return;
        if (bool now = stream.connected(); now != std::exchange(reached, now))
            note(in.set, fmt::format("'{}' {}", options.what.name,
                                     now ? "is reached again" : "is not reached any more: waiting until it is"));
        look.arm(saturating_add(in.self.now(), look_period));
    });
    look.arm(saturating_add(in.self.now(), look_period));
    auto style = in.set.pretty ? json_style::pretty : json_style::compact;
    std::uint64_t shown = 0;
    auto wanted = [&] { return !options.count || shown < *options.count; };
    constexpr std::size_t batch_bytes = 64 << 10;
    while (wanted()) {
        auto packet = co_await stream.next();
        if (!packet) break;
        std::string text;
        // What has come meanwhile is written at once with it.
        for (; packet; packet = stream.try_next()) {
            if (packet.lost_before() != 0 && !options.losses) note(in.set, show_loss(packet.lost_before()));
            append_line(text, packet, style, options.losses);
            ++shown;
            if (!wanted() || text.size() >= batch_bytes) break;
        }
        co_await in.out.write(in.self, std::move(text));
    }
    if (stream.ended() && !over && wanted()) throw problem(stream.cause());
    if (over && options.count && wanted())
        throw problem(
            exit_code::not_reached, "timed_out",
            fmt::format("{} of {} packets came within {}", shown, *options.count, show_duration(*options.length)));
}

} // namespace ise::cli
