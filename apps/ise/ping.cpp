// ise ping: round trips to a component and its clock offset.
#include "json.hpp"
#include "options.hpp"
#include "spread.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace ise::cli {
namespace {

struct ping_options {
    std::string name;
    std::uint64_t count = 5;
    duration every = std::chrono::milliseconds(200);
};

struct ping_line {
    std::uint64_t number = 0;
    std::optional<duration> round_trip_s, clock_ahead_s;
    if_any<std::string> error; ///< if there was no answer
};
struct ping_summary {
    std::uint64_t sent = 0, answered = 0;
    std::optional<duration> min_s, median_s, max_s;
    std::string_view service; ///< that was asked
};

// One question: the figures of the component, or from a version without them its description.
struct echoed {
    duration round_trip{};
    std::optional<duration> clock_ahead;
};

task<result<echoed>> ask_once(context& in, remote who, bool& by_health, duration limit) {
    echoed made;
    if (by_health) {
        auto response = co_await ask_health(in, who, limit);
        if (response) {
            made.round_trip = response->round_trip;
            made.clock_ahead = response->clock_ahead;
            co_return made;
        }
        if (response.error().code() != errc::no_such_service) co_return response.error();
        by_health = false;
    }
    describe_request question;
    auto asked = in.self.env().now();
    auto response = co_await who.try_call(describe_service, question, limit);
    if (!response) co_return response.error();
    made.round_trip = in.self.env().now() - asked;
    co_return made;
}

std::string show_answer(context& in, std::uint64_t number, const std::string& name, const result<echoed>& got) {
    if (in.set.json) {
        ping_line line;
        line.number = number;
        if (got) {
            line.round_trip_s = got->round_trip;
            line.clock_ahead_s = got->clock_ahead;
        } else {
            line.error = got.error().message();
        }
        return json_line(line);
    }
    if (!got) return fmt::format("{}: {}\n", number, printable(got.error().message()));
    return fmt::format("{}: {} answered after {}\n", number, printable(name), show_duration(got->round_trip));
}

std::string show_summary(context& in, std::uint64_t sent, const spread& of, const std::optional<duration>& ahead,
                         bool by_health) {
    bool any = of.count() > 0;
    if (in.set.json) {
        ping_summary result;
        result.sent = sent;
        result.answered = of.count();
        if (any) {
            result.min_s = of.shortest();
            result.median_s = of.median();
            result.max_s = of.longest();
        }
        result.service = by_health ? health_service.name() : describe_service.name();
        return json_line(result);
    }
    auto text = fmt::format("{} of {} answered", of.count(), sent);
    if (any)
        text += fmt::format("; min {}, median {}, max {}", show_duration(of.shortest()), show_duration(of.median()),
                            show_duration(of.longest()));
    if (any && ahead)
        text +=
            fmt::format("; its clock is {} {} ours (within {})", show_duration(*ahead < duration{} ? -*ahead : *ahead),
                        *ahead < duration{} ? "behind" : "ahead of", show_duration(of.shortest() / 2));
    return text + "\n";
}

task<> ping(context& in, ping_options options) {
    auto who = co_await reach(in, options.name);
    spread seen;
    std::optional<duration> ahead; // of the quickest answer: the one that tells best
    std::optional<failure> why;
    bool by_health = true;
    auto over = std::make_shared<bool>(false); // by Ctrl-C
    std::uint64_t sent = 0;
    in.ctrl_c.care(in.self.on(), [over] { *over = true; }); // what was measured is shown
    constexpr duration look_period = std::chrono::milliseconds(50);
    for (std::uint64_t number = 1; number <= options.count && !*over; ++number) {
        for (auto next = in.self.now() + options.every; number > 1 && !*over && in.self.now() < next;)
            co_await in.self.sleep(std::min(look_period, next - in.self.now()));
        if (*over) break;
        ++sent;
        auto got = co_await ask_once(in, who, by_health, in.set.timeout);
        if (got) {
            if (got->clock_ahead && (seen.count() == 0 || got->round_trip < seen.shortest())) ahead = got->clock_ahead;
            seen.add(got->round_trip);
        } else {
            why = got.error();
        }
        auto text = show_answer(in, number, options.name, got);
        co_await in.out.write(in.self, std::move(text));
    }
    in.ctrl_c.leave();
    auto text = show_summary(in, sent, seen, ahead, by_health);
    co_await in.out.write(in.self, std::move(text));
    if (seen.count() == 0 && why) throw problem(*why, "is it busy or stopped? ise doctor looks at all");
}

void declare_ping(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<ping_options>();
    add_component(app, given->name);
    app.add_option("--count,-n", given->count, "number of requests (default: 5)")
        ->type_name("N")
        ->check(command_line::range(1u, 1'000'000u));
    add_time(app, "--every", given->every, "time between them (default: 200ms)");
    app.callback([&made, given] {
        made.looks = true;
        made.work = [given](context& in) { return ping(in, *given); };
    });
}

} // namespace

extern const command ping_command{"ping", measure_group, "measures round trips to a component and its clock offset",
                                  "  ise ping atirma/boat -n 10\n", declare_ping};

} // namespace ise::cli
