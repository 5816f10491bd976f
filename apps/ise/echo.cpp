// ise echo: subscribes and prints each packet as a line of JSON.
#include "packet_lines.hpp"
#include "pattern.hpp"
#include "subscription.hpp"
#include "text.hpp"

#include <ise/component/discover.hpp>
#include <ise/core/waiter.hpp>
#include <ise/service/action.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <set>
#include <string>
#include <utility>
#include <vector>

namespace ise::cli {
namespace {

struct echo_options {
    subscribe_choice what;
    std::optional<std::uint64_t> count; ///< packets until it ends
    std::optional<duration> length;     ///< time until it ends
    duration every{};                   ///< rate limit
    bool no_last_value = false;
    packet_format how;

    bool many() const { return is_pattern(what.name) || is_pattern(what.service); }
};

subscribe_options terms_of(const echo_options& options) {
    subscribe_options terms;
    terms.min_interval = options.every;
    terms.last_value = !options.no_last_value;
    return terms;
}

// "3 packets were lost", or that the provider restarted.
std::string show_loss(std::optional<std::uint64_t> lost) {
    if (!lost) return "the provider restarted: it is unknown how many packets were lost";
    return fmt::format("{} packet{} lost", *lost, *lost == 1 ? " was" : "s were");
}

// What the provider answered to the subscription: beside the packets, so that each line of the answer stays one.
void show_response(const settings& set, const std::string& service, const dynamic_packet& response) {
    if (response.encoded().empty()) return; // it has nothing to say
    auto json = response.to_json();
    complain(set.json ? fmt::format("{{\"response\":{}}}\n", json)
                      : fmt::format("ise: '{}' answers {}\n", printable(service), printable(json)));
}

task<> echo(context& in, echo_options options) {
    auto terms = terms_of(options);
    std::string heading;
    auto check = [&](const dynamic_contract& service) {
        const auto& type = service.packet(role::published);
        for (const auto& path : options.how.fields) check_field(type, path);
        if (options.how.csv) heading = csv_heading(options.how, type, false);
    };
    auto stream = co_await open_stream(in, options.what, terms, check);
    if (!heading.empty()) co_await in.out.write(in.self, heading);
    const packet_source from;
    show_response(in.set, options.what.service, stream.response());
    constexpr duration look_period = std::chrono::milliseconds(250);
    bool over = false;
    timer end(in.self.on(), [&] {
        over = true;
        stream.unsubscribe();
    });
    if (options.length) end.arm(saturating_add(in.self.now(), *options.length));
    bool reached = true;
    timer look(in.self.on(), [&] { // silence alone does not tell whether there is nobody or nothing new
        if (stream.ended()) return;
        if (bool now = stream.connected(); now != std::exchange(reached, now))
            note(in.set, fmt::format("'{}' {}", options.what.name,
                                     now ? "is reached again" : "is no longer reachable; waiting for it"));
        look.arm(saturating_add(in.self.now(), look_period));
    });
    look.arm(saturating_add(in.self.now(), look_period));
    std::uint64_t shown = 0;
    auto wanted = [&] { return !options.count || shown < *options.count; };
    constexpr std::size_t batch_bytes = 64 << 10;
    while (wanted()) {
        auto packet = co_await stream.next();
        if (!packet) break;
        std::string text;
        // What has come meanwhile is written at once with it.
        for (; packet; packet = stream.try_next()) {
            if (packet.lost_before() != 0 && !options.how.losses) note(in.set, show_loss(packet.lost_before()));
            text += packet_line(options.how, packet, from);
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

// Several components or services at once: what they publish, line by line, and who listens to whom.
struct medley {
    explicit medley(loop& on) : news(on) {}

    waiter<> news;
    std::string text;             // to be written
    std::uint64_t shown = 0;      // packets, with those in `text`
    std::set<std::string> joined; // components
    std::set<std::string> silent; // of them noted as such
};
using shared_medley = std::shared_ptr<medley>;

constexpr std::size_t most_text = std::size_t{1} << 20;

task<> follow(context& in, echo_options options, shared_medley into, packet_source from, dynamic_stream stream) {
    for (;;) {
        auto packet = co_await stream.next();
        if (!packet) break;
        while (into->text.size() > most_text) // its packets wait, or are dropped and counted
            co_await in.self.sleep(std::chrono::milliseconds(10));
        if (packet.lost_before() != 0 && !options.how.losses)
            note(in.set, fmt::format("'{}' of {}: {}", from.service, from.component, show_loss(packet.lost_before())));
        if (options.count && into->shown >= *options.count) break;
        into->text += packet_line(options.how, packet, from);
        ++into->shown;
        into->news.resume();
    }
    if (stream.ended() && stream.cause().code() != errc::cancelled)
        note(in.set, fmt::format("'{}' of {}: {}", from.service, from.component, stream.cause().message()));
}

bool is_meant(const echo_options& options, const service_info& one, const dynamic_contract& contract) {
    if (!one.provided || is_own_service(one.name) || !matches(options.what.service, one.name)) return false;
    // To subscribe by surprise could start something.
    if (is_action(*contract.types())) return false;
    return contract.packet(role::subscribe_request).type().members.empty() || !is_pattern(options.what.service);
}

task<> join(context& in, echo_options options, shared_medley into, std::string path) {
    std::optional<failure> why;
    auto who = in.self.at(path);
    describe_request question;
    auto about = co_await who.try_call(describe_service, question, in.set.timeout);
    if (!about) why = about.error();
    for (std::size_t at = 0; about && at < about->services.size(); ++at) {
        const auto& one = about->services[at];
        if (one.kind != static_cast<std::uint8_t>(service_kind::subscription)) continue;
        auto contract = contract_of(one);
        if (!contract || !is_meant(options, one, *contract)) continue;
        const auto& type = contract->packet(role::published);
        try {
            for (const auto& field : options.how.fields) check_field(type, field);
        } catch (const problem&) {
            continue; // it is not among those that have it
        }
        std::optional<dynamic_packet> request;
        try {
            request.emplace(dynamic_packet::from_json(contract->packet(role::subscribe_request), options.what.json));
        } catch (const error& unfit) {
            why = failure(unfit.code(), fmt::format("the subscribe request is invalid: {}", unfit.what()));
            continue;
        }
        auto terms = terms_of(options);
        terms.depth = options.what.depth;
        terms.policy = options.what.latest     ? overflow::keep_latest
                       : options.what.lossless ? overflow::lossless
                                               : overflow::keep_last;
        terms.deadline = in.set.timeout;
        auto stream = co_await subscribe_dynamic(who, *contract, std::move(*request), terms);
        if (!stream) {
            why = stream.error();
            continue;
        }
        packet_source from{path, one.name};
        in.self.spawn("echo", follow(in, options, into, std::move(from), std::move(*stream)));
    }
    if (!why || why->code() == errc::cancelled) co_return; // the command ends
    if (into->silent.insert(path).second) note(in.set, fmt::format("{}: {}", path, why->message()));
    if (!about) into->joined.erase(path); // it is asked again
}

task<> look_for_more(context& in, const echo_options& options, shared_medley into) {
    in.until = in.self.now() + in.set.timeout;
    auto names = co_await listed_names(in, prefix_of(options.what.name));
    for (const auto& one : names) {
        if (!matches(options.what.name, one.path) || one.path.starts_with(looker_prefix)) continue;
        if (!into->joined.insert(one.path).second) continue;
        in.self.spawn("join", join(in, options, into, one.path));
    }
}

task<> echo_many(context& in, echo_options options) {
    constexpr duration look_period = std::chrono::seconds(2);
    auto into = std::make_shared<medley>(in.self.on());
    if (options.how.csv) {
        auto heading = csv_heading(options.how, schema(), true);
        co_await in.out.write(in.self, std::move(heading));
    }
    const auto end = options.length ? saturating_add(in.self.now(), *options.length) : time_point::max();
    timer alarm(in.self.on(), [&into] { into->news.resume(); });
    bool first = true;
    auto next_look = in.self.now();
    while (in.self.now() < end) {
        if (in.self.now() >= next_look) {
            std::optional<problem> why;
            try {
                co_await look_for_more(in, options, into);
            } catch (const problem& thrown) {
                why = thrown;
            }
            if (why && first) throw *why;
            if (why) note(in.set, why->what());
            if (std::exchange(first, false) && into->joined.empty())
                note(in.set, fmt::format("no component matches '{}' now: waiting for one", options.what.name));
            next_look = saturating_add(in.self.now(), look_period);
        }
        if (into->text.empty()) {
            alarm.arm(std::min(next_look, end));
            co_await into->news.wait();
            continue;
        }
        auto text = std::exchange(into->text, {});
        co_await in.out.write(in.self, std::move(text));
        if (options.count && into->shown >= *options.count && into->text.empty()) co_return;
    }
    if (options.count)
        throw problem(exit_code::not_reached, "timed_out",
                      fmt::format("{} of {} packets came within {}", into->shown, *options.count,
                                  show_duration(*options.length)));
}

void complete_echo(echo_options& of) {
    if (of.what.service.empty()) {
        if (!is_pattern(of.what.name))
            throw problem(exit_code::usage, "usage", "SERVICE is required",
                          fmt::format("ise echo {} SERVICE; ise echo '{}/**' shows all that publish there",
                                      of.what.name, of.what.name));
        of.what.service = "*";
    }
    if (!of.many()) return;
    if (of.what.name.find("://") != std::string::npos)
        throw problem(exit_code::usage, "usage", "services of an endpoint are named one by one",
                      "wildcards need the name server: give a path, or a pattern of paths");
    if (of.how.csv && of.how.fields.empty())
        throw problem(exit_code::usage, "usage", "--csv with wildcards needs --field",
                      "packets of different services have different columns");
}

void declare_echo(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<echo_options>();
    add_subscription(app, given->what);
    app.get_option("SERVICE")->required(false)->description(
        "name of a subscription service; with wildcards (*, ?; ** for any number of parts) in NAME or here, all that "
        "match (default: all)");
    add_count(app, given->count, "end after N packets");
    add_time(app, "--for", given->length, "end after this time; with --count: exit code 3 if fewer packets arrived");
    add_time(app, "--every", given->every, "at most one packet in this time; others are skipped");
    app.add_flag("--no-last", given->no_last_value, "without the packet that was published last before");
    app.add_flag("--losses", given->how.losses, R"(each line is {"lost_before":N,"packet":{...}}; null: unknown)");
    app.add_flag("--stamp", given->how.stamp, R"(each line is {"published_at":"...","packet":{...}})");
    add_each(app, "--field", given->how.fields,
             "only this field of each packet, such as fix.latitude_deg; may be repeated", "FIELD");
    app.add_flag("--csv", given->how.csv, "lines of CSV, the first with the names of the fields");
    app.callback([&made, given] {
        complete_echo(*given);
        given->what.json = json_given(given->what.json);
        made.endless = !given->count;
        made.work = [given](context& in) {
            if (in.set.pretty) given->how.style = json_style::pretty;
            given->how.terminal = in.out.is_terminal();
            return given->many() ? echo_many(in, *given) : echo(in, *given);
        };
    });
}

} // namespace

extern const command echo_command{"echo", talk_group, "subscribes and prints each packet as a line of JSON",
                                  "  ise echo atirma/boat position\n"
                                  "  ise echo atirma/boat position -n 1       the last value, then end\n"
                                  "  ise echo atirma/boat position --every 1s --json\n"
                                  "  ise echo 'atirma/**'                     all that is published there\n"
                                  "  ise echo atirma/boat position --csv --stamp --field latitude_deg\n",
                                  declare_echo};

} // namespace ise::cli
