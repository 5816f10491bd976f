#include <ise/sim/world.hpp>

#include <fmt/format.h>

namespace ise::sim {

world::world(std::uint64_t seed) : seed_(seed) {}

world::~world() {
    for (auto& [_, each] : hosts_) each->end_processes(true);
    scheduler_.drop_all(); // while everything that it refers to still stands
}

sim::host& world::host(const std::string& name) {
    auto& found = hosts_[name];
    if (!found) {
        const auto number = hosts_.size(); // 10.0.0.1, ... 10.0.0.250, 10.0.1.1, ...
        found = std::make_unique<sim::host>(*this, name, fmt::format("10.0.{}.{}", (number - 1) / 250, (number - 1) % 250 + 1));
    }
    return *found;
}

sim::host* world::find_host(const std::string& wanted) {
    if (auto found = hosts_.find(wanted); found != hosts_.end()) return found->second.get();
    for (auto& [_, each] : hosts_)
        if (each->address() == wanted) return each.get();
    return nullptr;
}

sim::serial_line& world::serial_line(const std::string& name, sim::host& into) {
    auto& found = serial_lines_[into.name() + "\n" + name];
    if (!found) found = std::make_unique<sim::serial_line>(*this, into, name);
    return *found;
}

void world::at(duration since_start, std::function<void()> action) {
    scheduler_.at(start + since_start, nullptr, [action = std::move(action)] { action(); });
}

void world::after(duration from_now, std::function<void()> action) {
    scheduler_.at(now() + from_now, nullptr, [action = std::move(action)] { action(); });
}

bool world::run_until(const std::function<bool()>& done, duration within) {
    const auto limit = saturating_add(now(), within);
    scheduler_.begin_run();
    while (!done()) {
        if (scheduler_.step(limit)) continue;
        scheduler_.advance_to(limit);
        return done();
    }
    return true;
}

void world::run_for(duration time) {
    const auto limit = saturating_add(now(), time);
    scheduler_.begin_run();
    while (scheduler_.step(limit)) {}
    scheduler_.advance_to(limit);
}

bool world::run_until_idle(duration within) {
    const auto limit = saturating_add(now(), within);
    scheduler_.begin_run();
    while (scheduler_.step(limit)) {}
    return scheduler_.idle();
}

} // namespace ise::sim
