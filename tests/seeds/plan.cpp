#include "plan.hpp"

#include <ise/sim/random.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>

namespace seeds {
namespace {

using namespace std::chrono_literals;
using ise::duration;

class dice {
public:
    dice(std::uint64_t seed, std::string_view name) : draw_(seed, name) {}
    bool chance(double of) noexcept { return draw_.chance(of); }
    std::uint64_t between(std::uint64_t least, std::uint64_t most) noexcept {
        return least + draw_.below(most - least + 1);
    }
    duration time(duration least, duration most) noexcept {
        return least + duration(static_cast<duration::rep>(
                           draw_.below(static_cast<std::uint64_t>((most - least).count()) + 1)));
    }
    template <class T>
    const T& one_of(const std::vector<T>& all) noexcept {
        return all[draw_.below(all.size())];
    }

private:
    ise::sim::generator draw_;
};

ise::subscribe_options draw_terms(dice& draw) {
    ise::subscribe_options made;
    switch (draw.between(0, 5)) {
        case 0: made = ise::subscribe_options::keep_latest(); break;
        case 1: made = ise::subscribe_options::lossless(static_cast<std::uint32_t>(draw.between(1, 24))); break;
        case 2: made = ise::subscribe_options::disconnect(static_cast<std::uint32_t>(draw.between(4, 64))); break;
        default: made = ise::subscribe_options::keep_last(static_cast<std::uint32_t>(draw.between(1, 40))); break;
    }
    made.last_value = draw.chance(0.6);
    if (draw.chance(0.2)) made.min_interval = draw.time(5ms, 400ms);
    made.deadline = draw.time(1s, 8s);
    return made;
}

component_plan draw_component(dice& draw, std::size_t number, std::size_t of, std::size_t process) {
    component_plan made;
    made.path = fmt::format("sea/c{}", number);
    made.process = process;
    made.port = static_cast<std::uint16_t>(7000 + number);
    made.with_the_first = draw.chance(0.25);
    made.fails = draw.chance(0.1);
    made.later_version = draw.chance(0.3);
    made.callers = static_cast<std::uint32_t>(draw.between(0, 3));
    made.pause = draw.time(60ms, 1500ms);
    made.short_deadlines = draw.chance(0.3);
    constexpr std::array<std::uint32_t, 6> sizes{0, 50, 2'000, 40'000, 140'000, 400'000};
    made.request_bytes = sizes[draw.between(0, draw.chance(0.3) ? 5 : 2)];
    made.publishes.period = draw.time(60ms, 1500ms);
    made.publishes.burst = draw.chance(0.3) ? static_cast<std::uint32_t>(draw.between(2, 30)) : 1;
    made.publishes.bytes = sizes[draw.between(0, draw.chance(0.2) ? 5 : 2)];
    made.publishes.blocking = draw.chance(0.4);
    made.publishes.withdraws = draw.chance(0.15);
    for (auto left = draw.between(0, 3); left > 0; --left) {
        subscriber_plan one;
        one.provider = draw.between(0, of - 1);
        one.by_name = draw.chance(0.75);
        one.later_version = draw.chance(0.25);
        one.terms = draw_terms(draw);
        if (draw.chance(0.3)) one.slowness = draw.time(1ms, 300ms);
        one.leaves = draw.chance(0.3);
        made.subscribes.push_back(one);
    }
    return made;
}

fault_plan draw_fault(dice& draw, const plan& of) {
    fault_plan made;
    // Some kinds more often than others.
    const std::vector<fault_kind> kinds{
        fault_kind::partition,    fault_kind::partition,    fault_kind::isolation,     fault_kind::weak_link,
        fault_kind::weak_link,    fault_kind::narrow_link,  fault_kind::cut,           fault_kind::cut,
        fault_kind::cut,          fault_kind::crash,        fault_kind::quick_restart, fault_kind::quick_restart,
        fault_kind::stop,         fault_kind::stop,         fault_kind::freeze,        fault_kind::host_crash,
        fault_kind::server_crash, fault_kind::server_crash, fault_kind::server_freeze, fault_kind::broken_io,
        fault_kind::broken_io,    fault_kind::rival,        fault_kind::component_stop};
    made.kind = draw.one_of(kinds);
    made.at = draw.time(100ms, of.length);
    made.length = draw.chance(0.5) ? draw.time(1ms, 3s) : draw.time(1s, 12s);
    made.host = draw.one_of(of.hosts);
    auto others = of.hosts;
    others.push_back("ns");
    std::erase(others, made.host);
    made.other = draw.one_of(others);
    made.process = draw.between(0, made.kind == fault_kind::rival || made.kind == fault_kind::component_stop
                                       ? of.components.size() - 1
                                       : of.processes.size() - 1);
    made.amount = draw.between(0, draw.chance(0.5) ? 600 : 60'000);
    return made;
}

// Drawn apart, so that the rest of a seed stays what it was before there were datagrams and roles.
void draw_datagrams(plan& of) {
    dice draw(of.seed, "datagrams");
    for (auto& one : of.components) one.over_datagrams = draw.chance(0.25);
    for (auto& one : of.components)
        for (auto& to : one.subscribes) // lossless is refused over datagrams
            if (of.components[to.provider].over_datagrams && to.terms.policy == ise::overflow::lossless)
                to.terms.policy = ise::overflow::keep_last;
}

void draw_roles(plan& of) {
    dice draw(of.seed, "roles");
    if (!draw.chance(0.4)) return;
    for (auto& one : of.components) {
        if (!draw.chance(0.5)) continue;
        one.role = "role/r0";
        one.priority = static_cast<std::int32_t>(draw.between(0, 2));
    }
}

void draw_harmless_faults(plan& of) {
    dice draw(of.seed, "harmless faults");
    for (auto left = draw.between(0, 3); left > 0; --left) {
        auto one = draw_fault(draw, of);
        one.kind = draw.chance(0.6) ? fault_kind::unruly_link : fault_kind::clock_step;
        one.process %= of.processes.size();
        of.faults.push_back(one);
    }
}

} // namespace

std::string_view name_of(fault_kind kind) noexcept {
    constexpr std::array<std::string_view, 17> names{
        "partition",     "isolation", "weak link",      "narrow link", "cut",          "crash",
        "quick restart", "stop",      "freeze",         "host crash",  "server crash", "server freeze",
        "broken i/o",    "rival",     "component stop", "unruly link", "clock step"};
    return names[static_cast<std::size_t>(kind)];
}

plan::plan(std::uint64_t from) : seed(from) {
    dice draw(seed, "plan");
    for (auto count = draw.between(2, 4), n = std::uint64_t{0}; n < count; ++n) hosts.push_back(fmt::format("h{}", n));
    for (const auto& host : hosts)
        for (auto count = draw.between(1, 2), n = std::uint64_t{0}; n < count; ++n)
            processes.push_back({host, fmt::format("p{}", n)});
    auto count = draw.between(2, 7);
    for (std::size_t n = 0; n < count; ++n)
        components.push_back(draw_component(draw, n, count, draw.between(0, processes.size() - 1)));
    for (auto contended = draw.between(0, 2), name = std::uint64_t{0}; name < contended; ++name)
        for (auto who = draw.between(2, 3); who > 0; --who) {
            contenders.push_back({processes.size(), fmt::format("port/n{}", name)});
            processes.push_back({draw.one_of(hosts), fmt::format("r{}", contenders.size())});
        }
    length = draw.time(5s, 30s);
    linger = draw.chance(0.5) ? 30s : draw.time(1s, 6s);
    lease = draw.chance(0.7) ? duration(2s) : draw.time(400ms, 4s);
    heartbeat_ns = draw.chance(0.6) ? 1'000'000'000u : static_cast<std::uint64_t>(draw.time(100ms, 3s).count());
    session_bytes = draw.chance(0.7) ? 64u << 20 : 300'000;
    latency = draw.time(20us, 30ms);
    for (auto left = draw.between(0, 9); left > 0; --left) faults.push_back(draw_fault(draw, *this));
    draw_datagrams(*this);
    draw_roles(*this);
    draw_harmless_faults(*this);
    std::ranges::stable_sort(faults, {}, &fault_plan::at);
}

std::vector<std::string> plan::hosts_of_role(const std::string& role) const {
    std::vector<std::string> found;
    for (const auto& one : components)
        if (one.role == role) found.push_back(processes[one.process].host);
    return found;
}

std::string plan::text() const {
    auto seconds = [](duration time) { return std::chrono::duration<double>(time).count(); };
    auto text = fmt::format("seed {}: {:.1f} s, latency {:.4f} s, linger {:.1f} s, lease {:.1f} s, heartbeat {:.1f} s, "
                            "at most {} bytes unsent\n",
                            seed, seconds(length), seconds(latency), seconds(linger), seconds(lease),
                            static_cast<double>(heartbeat_ns) * 1e-9, session_bytes);
    for (const auto& one : components) {
        text += fmt::format("  {} in {}/{}:{}{}{}{}{}{} {} callers, {} bytes, every {:.3f} s{}; publishes {} x {} "
                            "bytes every {:.3f} s{}{}\n",
                            one.path, processes[one.process].host, processes[one.process].name, one.port,
                            one.with_the_first ? " shared loop" : "", one.fails ? " fails" : "",
                            one.later_version ? " later" : "", one.over_datagrams ? " udp" : "",
                            one.role.empty() ? "" : fmt::format(" {} of priority {},", one.role, one.priority),
                            one.callers, one.request_bytes, seconds(one.pause), one.short_deadlines ? " short" : "",
                            one.publishes.burst, one.publishes.bytes, seconds(one.publishes.period),
                            one.publishes.blocking ? " blocking" : "", one.publishes.withdraws ? " withdraws" : "");
        for (const auto& to : one.subscribes)
            text += fmt::format("    subscribes to c{} by {}, policy {} depth {}, rate {:.3f} s, slow {:.3f} s{}{}{}\n",
                                to.provider, to.by_name ? "name" : "endpoint", static_cast<int>(to.terms.policy),
                                to.terms.depth, seconds(to.terms.min_interval), seconds(to.slowness),
                                to.leaves ? " leaves" : "", to.later_version ? " later" : "",
                                to.terms.last_value ? " last value" : "");
    }
    for (const auto& one : contenders)
        text += fmt::format("  {}/{} contends for {}\n", processes[one.process].host, processes[one.process].name,
                            one.path);
    for (const auto& one : faults)
        text += fmt::format("  at {:.3f} s for {:.3f} s: {} of {} with {}, number {}, amount {}\n", seconds(one.at),
                            seconds(one.length), name_of(one.kind), one.host, one.other, one.process, one.amount);
    return text;
}

} // namespace seeds
