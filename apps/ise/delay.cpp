// ise delay: how old a subscription's packets are when they come.
#include "json.hpp"
#include "metering.hpp"
#include "spread.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace ise::cli {
namespace {

// Shown in place of a field when the age counts from the publication. No field can have this name.
constexpr const char* publication_time = "(published)";

struct delay_options {
    metering_options from;
    std::string field;  ///< a time in the packets; empty: the one that is called so
    bool stamp = false; ///< the time of their publication
};

struct delay_line {
    std::string field;
    std::optional<duration> youngest_s, median_s, oldest_s;
    std::uint64_t packets = 0, without_time = 0, from_the_future = 0;
    bool connected = false;
    std::uint64_t lost_at_provider = 0, lost_here = 0, restarts = 0;
};

class ages final : public gauge {
public:
    ages(component& self, std::string field) : self_(self), field_(std::move(field)) {}

    void see(const received<dynamic_packet>& packet, time_point) override {
        ++now_.packets;
        const double at = time_of(packet); // seconds since 1970
        double age = std::chrono::duration<double>(self_.wall().time_since_epoch()).count() - at;
        constexpr double most = 9e9; // centuries: what does not fit a duration is no age
        if (!std::isfinite(at) || at <= 0 || std::abs(age) > most) {
            ++now_.without_time;
            return;
        }
        if (age < 0) ++now_.from_the_future;
        seen_.add(std::chrono::duration_cast<duration>(std::chrono::duration<double>(age)));
    }

    std::string heading() const override {
        return fmt::format("{:>9}  {:>9}  {:>9}  {:>8}  {:>9}  {:>8}   age by {}\n", "YOUNGEST", "MEDIAN", "OLDEST",
                           "PACKETS", "NO TIME", "LOST", field_);
    }

    std::string row(duration, const dynamic_stream& stream) override {
        auto of = take(stream);
        auto age = [](const std::optional<duration>& length) { return length ? show_duration(*length) : "-"; };
        return fmt::format("{:>9}  {:>9}  {:>9}  {:>8}  {:>9}  {:>8}{}\n", age(of.youngest_s), age(of.median_s),
                           age(of.oldest_s), of.packets, of.without_time, show_losses(stream),
                           of.from_the_future > 0 ? "  from the future: the clock that set it is ahead of ours" : "");
    }

    std::string json(duration, const dynamic_stream& stream) override { return json_line(take(stream)); }

private:
    // Not a number: the provider does not tell it.
    double time_of(const received<dynamic_packet>& packet) const {
        if (field_ != publication_time) return packet->field(field_).as_double();
        const auto at = packet.published_at();
        return at ? std::chrono::duration<double>(at->time_since_epoch()).count() : std::nan("");
    }

    delay_line take(const dynamic_stream& stream) {
        auto made = std::exchange(now_, delay_line());
        auto seen = std::exchange(seen_, spread());
        made.field = field_;
        if (seen.count() > 0) {
            made.youngest_s = seen.shortest();
            made.median_s = seen.median();
            made.oldest_s = seen.longest();
        }
        made.connected = stream.connected();
        made.lost_at_provider = stream.counts().lost_at_provider;
        made.lost_here = stream.counts().lost_here;
        made.restarts = stream.counts().restarts;
        return made;
    }

    component& self_;
    std::string field_;
    spread seen_;
    delay_line now_;
};

// Times at any depth of structs: "fix.measured_at".
void find_times(const type_description& of, const std::string& before, std::vector<std::string>& found) {
    constexpr std::size_t most = 64;
    if (of.kind != type_kind::structure) return;
    for (const auto& member : of.members) {
        if (found.size() >= most) return;
        auto path = before.empty() ? member.name : before + "." + member.name;
        if (member.type.kind == type_kind::instant) found.push_back(path);
        find_times(member.type, path, found);
    }
}

std::string field_of(const schema& packet, const std::string& wanted, const std::string& service) {
    std::vector<std::string> times;
    find_times(packet.type(), {}, times);
    std::vector<std::string> quoted;
    for (const auto& one : times) quoted.push_back(fmt::format("'{}'", one));
    auto there = times.empty() ? std::string("its packets have no time") : "its packets have " + enumerate(quoted);
    if (!wanted.empty()) {
        if (std::ranges::find(times, wanted) != times.end()) return wanted;
        throw problem(exit_code::usage, "usage", fmt::format("the packets of '{}' have no time '{}'", service, wanted),
                      there);
    }
    for (const char* usual : {"measured_at", "received_at"})
        if (std::ranges::find(times, usual) != times.end()) return usual;
    if (times.size() == 1) return times.front();
    if (times.empty()) return publication_time;
    throw problem(exit_code::usage, "usage",
                  fmt::format("the packets of '{}' do not say which time is theirs", service),
                  there + ": choose one with --field, or --stamp for the time of their publication");
}

// Ages mean little where clocks differ: it is said, as far as it can be known.
task<> tell_skew(context& in, remote who, std::string name) {
    auto asked = co_await ask_health(in, who, in.left());
    if (!asked) co_return;
    auto ahead = asked->clock_ahead;
    auto off = ahead < duration{} ? -ahead : ahead;
    if (off <= asked->round_trip / 2 + std::chrono::milliseconds(1)) co_return;
    note(in.set, fmt::format("the clock of {} is {} {} ours (within {}): ages are wrong by that if it set the time",
                             name, show_duration(off), ahead < duration{} ? "behind" : "ahead of",
                             show_duration(asked->round_trip / 2)));
}

task<> delay(context& in, delay_options options) {
    auto who = co_await reach(in, options.from.what.name);
    auto service = co_await find_service(in, who, options.from.what.service, service_kind::subscription);
    auto field = options.stamp ? std::string(publication_time)
                               : field_of(service.packet(role::published), options.field, options.from.what.service);
    co_await tell_skew(in, who, options.from.what.name);
    auto by = std::make_shared<ages>(in.self, field);
    co_await measure(in, std::move(options.from), by);
}

void declare_delay(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<delay_options>();
    add_metering(app, given->from);
    app.add_option("--field", given->field,
                   "a time in the packets (default: measured_at, else received_at, else the only one, else --stamp)")
        ->type_name("FIELD");
    app.add_flag("--stamp", given->stamp, "the time of their publication");
    app.callback([&made, given] {
        if (given->stamp && !given->field.empty())
            throw problem(exit_code::usage, "usage", "--field and --stamp exclude each other");
        complete_metering(given->from, made);
        made.work = [given](context& in) { return delay(in, *given); };
    });
}

} // namespace

extern const command delay_command{"delay", measure_group, "how old a subscription's packets are when they come",
                                   "  ise delay atirma/boat position --field measured_at\n", declare_delay};

} // namespace ise::cli
