// ise echo: subscribes and prints each packet as a line of JSON.
#include "subscription.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <memory>
#include <utility>

namespace ise::cli {
namespace {

struct echo_options {
    subscribe_choice what;
    std::optional<std::uint64_t> count; ///< packets until it ends
    std::optional<duration> length;     ///< time until it ends
    duration every{};                   ///< rate limit
    bool no_last_value = false;
    bool losses = false; ///< each packet in an envelope that tells what was lost before it
};

// "3 packets were lost", or that the provider restarted.
std::string show_loss(std::optional<std::uint64_t> lost) {
    if (!lost) return "the provider restarted: it is unknown how many packets were lost";
    return fmt::format("{} packet{} lost", *lost, *lost == 1 ? " was" : "s were");
}

void append_packet(std::string& text, const received<dynamic_packet>& packet, json_style style, bool envelope) {
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

task<> echo(context& in, echo_options options) {
    subscribe_options terms;
    terms.min_interval = options.every;
    terms.last_value = !options.no_last_value;
    auto stream = co_await open_stream(in, options.what, terms);
    show_response(in.set, options.what.service, stream.response());
    constexpr duration look_period = std::chrono::milliseconds(250);
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
            append_packet(text, packet, style, options.losses);
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

void declare_echo(CLI::App& app, parsed_command& made) {
    auto given = std::make_shared<echo_options>();
    add_subscription(app, given->what);
    add_count(app, given->count, "end after N packets");
    add_time(app, "--for", given->length, "end after this time; with --count: exit code 3 if fewer packets arrived");
    add_time(app, "--every", given->every, "at most one packet in this time; others are skipped");
    app.add_flag("--no-last", given->no_last_value, "without the packet that was published last before");
    app.add_flag("--losses", given->losses, R"(each line is {"lost_before":N,"packet":{...}}; null: unknown)");
    app.callback([&made, given] {
        given->what.json = json_given(given->what.json);
        made.endless = !given->count;
        made.work = [given](context& in) { return echo(in, *given); };
    });
}

} // namespace

extern const command echo_command{"echo", talk_group, "subscribes and prints each packet as a line of JSON",
                                  "  ise echo atirma/boat position\n"
                                  "  ise echo atirma/boat position -n 1       the last value, then end\n"
                                  "  ise echo atirma/boat position --every 1s --json\n",
                                  declare_echo};

} // namespace ise::cli
