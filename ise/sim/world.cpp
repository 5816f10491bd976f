#include <ise/sim/world.hpp>

#include <fmt/format.h>

namespace ise::sim {

world::world(std::uint64_t seed) : world_core(seed) {}

world::~world() {
    for (auto& [_, each] : hosts_) each->end_processes(true);
    engine().drop_all(); // while everything that it refers to still stands
}

sim::host& world::host(const std::string& name) {
    auto& found = hosts_[name];
    if (!found) {
        const auto number = hosts_.size(); // 10.0.0.1, ... 10.0.0.250, 10.0.1.1, ...
        found = std::make_unique<sim::host>(*this, network_, name,
                                            fmt::format("10.0.{}.{}", (number - 1) / 250, (number - 1) % 250 + 1));
        network_.join(*found);
    }
    return *found;
}

sim::serial_line& world::serial_line(const std::string& name, sim::host& into) {
    return sim::serial_line::into(*this, into, name);
}

void world::at(duration since_start, std::function<void()> action) {
    engine().at(start + since_start, nullptr, [action = std::move(action)] { action(); });
}

void world::after(duration from_now, std::function<void()> action) {
    engine().at(now() + from_now, nullptr, [action = std::move(action)] { action(); });
}

bool world::run_until(const std::function<bool()>& done, duration within) {
    const auto limit = saturating_add(now(), within);
    engine().begin_run();
    while (!done()) {
        if (engine().step(limit)) continue;
        engine().advance_to(limit);
        return done();
    }
    return true;
}

void world::run_for(duration time) {
    const auto limit = saturating_add(now(), time);
    engine().begin_run();
    while (engine().step(limit)) {}
    engine().advance_to(limit);
}

bool world::run_until_idle(duration within) {
    const auto limit = saturating_add(now(), within);
    engine().begin_run();
    while (engine().step(limit)) {}
    return engine().idle();
}

} // namespace ise::sim
