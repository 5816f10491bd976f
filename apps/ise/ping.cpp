#include "look.hpp"

#include "spread.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

double seconds(duration length) { return std::chrono::duration<double>(length).count(); }

// One question: the figures of the component, or from a version without them its description.
struct echoed {
    duration round_trip{};
    std::optional<duration> clock_ahead;
};
task<result<echoed>> ask_once(context& in, remote who, bool& by_health, duration limit) {
    echoed made;
    if (by_health) {
        auto told = co_await ask_health(in, who, limit);
        if (told) {
            made.round_trip = told->round_trip;
            made.clock_ahead = told->clock_ahead;
            co_return made;
        }
        if (told.error().code() != errc::no_such_service) co_return told.error();
        by_health = false;
    }
    describe_request question;
    auto asked = in.self.env().now();
    auto told = co_await who.try_call(describe_service, question, limit);
    if (!told) co_return told.error();
    made.round_trip = in.self.env().now() - asked;
    co_return made;
}

std::string line(context& in, std::uint64_t number, const std::string& name, const result<echoed>& got) {
    if (in.set.json) {
        ordered_json told;
        told["number"] = number;
        told["round_trip_s"] = got ? ordered_json(seconds(got->round_trip)) : ordered_json();
        told["clock_ahead_s"] = got && got->clock_ahead ? ordered_json(seconds(*got->clock_ahead)) : ordered_json();
        if (!got) told["error"] = got.error().message();
        return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    }
    if (!got) return fmt::format("{}: {}\n", number, printable(got.error().message()));
    return fmt::format("{}: {} answered after {}\n", number, printable(name), show_duration(got->round_trip));
}

std::string summary(context& in, std::uint64_t sent, const spread& of, const std::optional<duration>& ahead,
                    bool by_health) {
    bool any = of.count() > 0;
    if (in.set.json) {
        ordered_json told;
        told["sent"] = sent;
        told["answered"] = of.count();
        told["min_s"] = any ? ordered_json(seconds(of.shortest())) : ordered_json();
        told["median_s"] = any ? ordered_json(seconds(of.median())) : ordered_json();
        told["max_s"] = any ? ordered_json(seconds(of.longest())) : ordered_json();
        told["service"] = by_health ? health_service.name() : describe_service.name();
        return told.dump() + "\n";
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

} // namespace

task<> ping(context& in, ping_options options) {
    auto who = co_await reach(in, options.name);
    spread seen;
    std::optional<duration> ahead; // of the quickest answer: the one that tells best
    std::optional<failure> why;
    bool by_health = true;
    for (std::uint64_t number = 1; number <= options.count; ++number) {
        if (number > 1) co_await in.self.sleep(options.every);
        auto got = co_await ask_once(in, who, by_health, in.set.timeout);
        if (got) {
            if (got->clock_ahead && (seen.count() == 0 || got->round_trip < seen.shortest())) ahead = got->clock_ahead;
            seen.add(got->round_trip);
        } else {
            why = got.error();
        }
        auto text = line(in, number, options.name, got);
        co_await in.out.write(in.self, std::move(text));
    }
    auto text = summary(in, options.count, seen, ahead, by_health);
    co_await in.out.write(in.self, std::move(text));
    if (seen.count() == 0 && why) throw problem(*why, "is it busy or stopped? ise doctor looks at all");
}

} // namespace ise::cli
