#include "storms.hpp"

#include "actor.hpp"

namespace seeds {

using namespace std::chrono_literals;

void storms::schedule() {
    until_ = stage_.plan.length;
    for (const auto& one : stage_.plan.faults) stage_.world.at(one.at, [this, &one] { begin(one); });
}

ise::duration storms::left() const { return std::max(until_ - stage_.world.elapsed(), ise::duration{}); }

void storms::later(ise::duration length, std::function<void()> back) {
    stage_.world.after(std::min(length, left()), std::move(back));
}

void storms::part(const std::string& a, const std::string& b) {
    if (parted_[{a, b}]++ == 0) stage_.world.net().partition(a, b);
    stage_.sky.begin(a, b);
}

void storms::heal(const std::string& a, const std::string& b) {
    if (--parted_[{a, b}] == 0) stage_.world.net().heal(a, b);
    stage_.sky.end(a, b, stage_.world.now());
}

// A storm of a host, which is over when `back` has run and what it starts has settled.
void storms::disturb(const std::string& host, ise::duration length, std::function<void()> back) {
    stage_.sky.begin(host);
    later(length, [this, host, back = std::move(back)] {
        back();
        stage_.sky.end(host, stage_.world.now());
    });
}

void storms::begin(const fault_plan& what) {
    auto& world = stage_.world;
    stage_.events.note("fault: {}", name_of(what.kind));
    stage_.events.tally(fmt::format("faults: {}", name_of(what.kind)));
    auto ordered = what.host <= what.other ? std::pair(what.host, what.other) : std::pair(what.other, what.host);
    auto& ship = fleet_.at(what.kind == fault_kind::rival || what.kind == fault_kind::component_stop
                               ? fleet_.ship_of(what.process)
                               : what.process);
    const auto& host = ship.what.host;
    switch (what.kind) {
        case fault_kind::partition:
            part(ordered.first, ordered.second);
            later(what.length, [this, ordered] { heal(ordered.first, ordered.second); });
            return;
        case fault_kind::isolation: {
            std::vector<std::string> others;
            for (const auto& [name, held] : world.hosts())
                if (name != what.host) others.push_back(name);
            auto both = [at = what.host](const std::string& other) {
                return at <= other ? std::pair(at, other) : std::pair(other, at);
            };
            for (const auto& other : others) part(both(other).first, both(other).second);
            later(what.length, [this, others, both] {
                for (const auto& other : others) heal(both(other).first, both(other).second);
            });
            return;
        }
        case fault_kind::weak_link:
        case fault_kind::narrow_link: {
            auto& link = world.net().between(what.host, what.other);
            auto before = stage_.plan.latency;
            if (what.kind == fault_kind::weak_link) {
                link.loss = static_cast<double>(what.amount % 20) / 100;
                link.latency = std::chrono::milliseconds(what.amount % 800);
                link.jitter = std::chrono::milliseconds(what.amount % 300);
            } else {
                link.bandwidth_bytes_per_second = 4000 + 4 * what.amount;
                link.send_buffer_bytes = 4096; // what waits in it when it is wide again takes its time still
            }
            stage_.sky.begin(what.host, what.other);
            later(what.length, [this, &link, what, before] {
                link.loss = 0;
                link.latency = before;
                link.jitter = {};
                link.bandwidth_bytes_per_second = 0;
                link.send_buffer_bytes = 64 * 1024;
                stage_.sky.end(what.host, what.other, stage_.world.now());
            });
            return;
        }
        case fault_kind::unruly_link: {
            auto& link = world.net().between(what.host, what.other);
            link.duplicate = static_cast<double>(what.amount % 40) / 100;
            link.reorder = static_cast<double>(what.amount % 50) / 100;
            later(what.length, [&link] { link.duplicate = link.reorder = 0; });
            return;
        }
        case fault_kind::clock_step:
            if (ship.process && ship.now != fleet::state::down)
                ship.process->set_wall_offset(std::chrono::hours(what.amount % 48) - 24h);
            return;
        case fault_kind::cut:
            for (std::uint64_t n = 0; n <= what.amount % 3; ++n) {
                world.net().cut(what.host, what.other,
                                what.amount % 2 ? ise::sim::direction::to_server : ise::sim::direction::to_client,
                                what.amount / (n + 1));
                stage_.sky.begin(what.host, what.other);
                cuts_.emplace_back(what.host, what.other);
            }
            return;
        case fault_kind::crash:
            disturb(host, what.length, [this, &ship] { fleet_.launch(ship); });
            fleet_.crash(ship);
            return;
        case fault_kind::quick_restart:
            disturb(host, 0s, [] {});
            fleet_.crash(ship);
            fleet_.launch(ship);
            return;
        case fault_kind::stop:
            stage_.sky.begin(host);
            fleet_.stop(ship, [this, &ship, host, length = what.length] {
                later(length, [this, &ship, host] {
                    fleet_.launch(ship);
                    stage_.sky.end(host, stage_.world.now());
                });
            });
            return;
        case fault_kind::freeze:
            disturb(host, what.length, [this, &ship] { fleet_.thaw(ship); });
            fleet_.freeze(ship);
            return;
        case fault_kind::host_crash:
            disturb(what.host, what.length, [this, name = what.host] { fleet_.boot_host(name); });
            fleet_.crash_host(what.host);
            return;
        case fault_kind::server_crash:
            disturb("ns", what.length, [this] { fleet_.launch_server(); });
            fleet_.crash_server();
            return;
        case fault_kind::server_freeze:
            disturb("ns", what.length, [this] { fleet_.thaw_server(); });
            fleet_.freeze_server();
            return;
        case fault_kind::broken_io:
            if (std::exchange(io_breaks_, true)) return;
            stage_.sky.begin_everywhere();
            world.fail_at(what.amount % 2000);
            return;
        case fault_kind::rival: rival(what); return;
        case fault_kind::component_stop: {
            const auto& one = stage_.plan.components[what.process];
            stage_.sky.begin(host);
            fleet_.stop_component(ship, one, [this, &ship, &one, host] {
                fleet_.start_component(ship, one);
                stage_.sky.end(host, stage_.world.now());
            });
            return;
        }
    }
}

// The component's host is cut off from the name server for longer than a lease, and somebody else takes its name; or
// it is not, and the rival is refused.
void storms::rival(const fault_plan& what) {
    auto one = stage_.plan.components[what.process];
    auto home = stage_.plan.processes[one.process].host;
    stage_.calls.rivalled[one.path].insert(what.host);
    bool cut_off = what.amount % 4 != 0;
    if (cut_off) {
        auto ordered = home <= "ns" ? std::pair(home, std::string("ns")) : std::pair(std::string("ns"), home);
        part(ordered.first, ordered.second);
        later(what.length, [this, ordered] { heal(ordered.first, ordered.second); });
    }
    // Callers reach one or the other, and the one that loses takes its sessions along.
    stage_.sky.begin(home);
    stage_.sky.begin(what.host);
    later(until_, [this, home, at = what.host] {
        stage_.sky.end(home, stage_.world.now());
        stage_.sky.end(at, stage_.world.now());
    });
    one.port = static_cast<std::uint16_t>(20'000 + fleet_.ships());
    one.with_the_first = false;
    one.fails = false;
    one.subscribes.clear();
    auto number = fleet_.add({what.host, fmt::format("rival{}", fleet_.ships())}, {one});
    fleet_.launch(fleet_.at(number));
}

void storms::look() {
    auto& world = stage_.world;
    if (io_breaks_ && world.faults().failed()) {
        io_breaks_ = false;
        world.faults().fail_never();
        stage_.sky.end_everywhere(world.now());
    }
    if (!cuts_.empty() && world.net().cuts() >= cut_count_ + cuts_.size()) {
        cut_count_ += cuts_.size();
        for (const auto& [a, b] : std::exchange(cuts_, {})) stage_.sky.end(a, b, world.now());
    }
}

void storms::end() {
    if (std::exchange(io_breaks_, false)) {
        stage_.world.faults().fail_never();
        stage_.sky.end_everywhere(stage_.world.now());
    }
    fleet_.all_up();
}

} // namespace seeds
