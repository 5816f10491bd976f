#include <ise/instantiation/supervisor.hpp>

#include <fmt/format.h>

#include <memory>
#include <string_view>

namespace ise::instantiation {

instance_ptr supervisor::add(start_request request, launch_plan plan) {
    auto made = table_.add(std::move(request), std::move(plan));
    made->due = std::make_unique<timer>(here_.self.on(), [this, weak = std::weak_ptr<instance>(made)] {
        if (auto one = weak.lock()) carry_out(one, one->watch.tick(here_.self.now()));
    });
    return made;
}

void supervisor::published(const std::string& path, instance_state state, std::string reason) {
    published_[path] = {state, std::move(reason)};
}

void supervisor::forget(const std::string& path) {
    published_.erase(path);
    table_.remove(path);
    state_.save();
}

void supervisor::carry_out(const instance_ptr& one, supervision::act what) {
    switch (what) {
        case supervision::act::nothing: break;
        case supervision::act::launch:
            ++one->life;
            does_.launch(one);
            break;
        case supervision::act::terminate:
            if (one->running) one->running->terminate();
            break;
        case supervision::act::kill:
            if (one->running) one->running->kill();
            break;
    }
    changed(one);
}

void supervisor::changed(const instance_ptr& one) {
    auto next = one->watch.next();
    if (next == time_point::max()) one->due->disarm();
    else one->due->arm(next);
    for (auto* waiting : one->awaiting) waiting->resume();
    does_.changed(one);
    auto& last = published_[one->plan.path];
    if (last == std::pair(one->watch.state(), one->watch.reason())) return;
    if (last.first != one->watch.state()) one->since = here_.self.wall();
    last = {one->watch.state(), one->watch.reason()};
    announce(*one);
    auto level = one->watch.state() == instance_state::failed || one->watch.state() == instance_state::waiting
                     ? log_level::warning
                     : log_level::info;
    static constexpr std::string_view names[] = {"starting", "ready", "stopping", "waiting to be started again",
                                                 "stopped",  "failed"};
    const auto& reason = one->watch.reason();
    here_.self.log().write(level,
                           fmt::format("{} is {}{}{}", one->plan.path,
                                       names[static_cast<std::size_t>(one->watch.state())], reason.empty() ? "" : ": ",
                                       reason),
                           {});
}

void supervisor::announce(const instance& one) {
    state_.save();
    host_event event;
    event.at = here_.self.wall();
    event.instance = one.text();
    does_.publish(event);
}

void supervisor::ended(const instance_ptr& one, std::uint64_t life, process_end how) {
    if (life != one->life) return;
    if (one->running) how = how_it_ended(std::move(how), one->mark, *one->output);
    one->running.reset();
    carry_out(one, one->watch.ended(here_.self.now(), how.well(), how.text()));
}

void supervisor::stop() {
    for (const auto& [path, one] : table_.instances()) {
        one->due->disarm();
        one->running.reset();
    }
}

} // namespace ise::instantiation
