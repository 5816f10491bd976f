#include "look.hpp"

#include "metering.hpp"
#include "spread.hpp"
#include "survey.hpp"
#include "target.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

class ages final : public gauge {
public:
    ages(component& self, std::string field) : self_(self), field_(std::move(field)) {}

    void see(const dynamic_packet& packet) override {
        ++packets_;
        double at = packet.field(field_).as_double(); // seconds since 1970
        if (!std::isfinite(at) || at <= 0) {
            ++unset_;
            return;
        }
        double age = std::chrono::duration<double>(self_.wall().time_since_epoch()).count() - at;
        constexpr double most = 9e9; // centuries: what does not fit a duration is no age
        if (std::abs(age) > most) {
            ++unset_;
            return;
        }
        if (age < 0) ++ahead_;
        seen_.add(std::chrono::duration_cast<duration>(std::chrono::duration<double>(age)));
    }

    std::string heading() const override {
        return fmt::format("{:>9}  {:>9}  {:>9}  {:>8}  {:>9}  {:>8}   age by {}\n", "YOUNGEST", "MEDIAN", "OLDEST",
                           "PACKETS", "NO TIME", "LOST", field_);
    }

    std::string row(duration, const dynamic_stream& stream) override {
        auto age = [&](duration length) { return seen_.count() == 0 ? std::string("-") : show_duration(length); };
        auto text = fmt::format("{:>9}  {:>9}  {:>9}  {:>8}  {:>9}  {:>8}", age(seen_.shortest()),
                                seen_.count() == 0 ? "-" : show_duration(seen_.median()), age(seen_.longest()),
                                packets_, unset_, show_losses(stream));
        if (ahead_ > 0) text += "  from the future: the clock that set it is ahead of ours";
        clear();
        return text + "\n";
    }

    std::string json(duration, const dynamic_stream& stream) override {
        auto age = [&](auto&& length) {
            return seen_.count() == 0 ? ordered_json() : ordered_json(std::chrono::duration<double>(length()).count());
        };
        ordered_json told;
        told["field"] = field_;
        told["youngest_s"] = age([&] { return seen_.shortest(); });
        told["median_s"] = age([&] { return seen_.median(); });
        told["oldest_s"] = age([&] { return seen_.longest(); });
        told["packets"] = packets_;
        told["without_time"] = unset_;
        told["from_the_future"] = ahead_;
        told["connected"] = stream.connected();
        told["lost_at_provider"] = stream.counts().lost_at_provider;
        told["lost_here"] = stream.counts().lost_here;
        told["restarts"] = stream.counts().restarts;
        clear();
        return told.dump() + "\n";
    }

private:
    void clear() {
        seen_ = spread();
        packets_ = unset_ = ahead_ = 0;
    }

    component& self_;
    std::string field_;
    spread seen_;
    std::uint64_t packets_ = 0, unset_ = 0, ahead_ = 0;
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
    throw problem(exit_code::usage, "usage",
                  fmt::format("the packets of '{}' do not say which time is theirs", service),
                  times.empty() ? there : there + ": choose one with --field");
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

} // namespace

task<> delay(context& in, delay_options options) {
    auto who = co_await reach(in, options.from.what.name);
    auto service = co_await find_service(in, who, options.from.what.service, service_kind::subscription);
    auto field = field_of(service.packet(role::published), options.field, options.from.what.service);
    co_await tell_skew(in, who, options.from.what.name);
    auto by = std::make_shared<ages>(in.self, field);
    co_await measure(in, std::move(options.from), by);
}

} // namespace ise::cli
