#include <ise/service/use_book.hpp>

#include <ise/core/limits.hpp>
#include <ise/core/time_text.hpp>
#include <ise/session/service_runtime.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>

namespace ise {
namespace {

constexpr duration use_watch_period = std::chrono::seconds(1);
constexpr std::size_t max_summary = 300;

std::string subject_of(const awaited_use& of) {
    return of.service.empty() ? of.target : fmt::format("'{}' of {}", of.service, of.target);
}

std::string_view text_of(wait_stage stage) {
    switch (stage) {
        case wait_stage::name: return "waits for a name";
        case wait_stage::provider: return "waits for a provider";
        case wait_stage::unreached: return "called without reaching a provider";
    }
    return "?";
}

} // namespace

std::string_view name_of(wait_stage stage) noexcept {
    switch (stage) {
        case wait_stage::name: return "name";
        case wait_stage::provider: return "provider";
        case wait_stage::unreached: return "unreached";
    }
    return "?";
}

use_target::~use_target() {
    if (in_) std::erase(in_->ways_, this);
}

use_book::use_book(service_runtime& runtime) : runtime_(runtime), due_(runtime.on(), [this] { look(); }) {}

use_book::~use_book() {
    for (auto* way : ways_) way->in_ = nullptr;
}

void use_book::add(use_target& way) {
    ways_.push_back(&way);
    way.in_ = this;
}

use_book::entry* use_book::touch(const use_target& way, std::string_view service, const packet_types* types) {
    if (stopped_ || service.starts_with("ise.")) return nullptr;
    key which(way.name(), service);
    auto found = all_.find(which);
    if (found == all_.end()) {
        if (all_.size() >= limit::used_services)
            all_.erase(std::ranges::min_element(all_, {}, [](const auto& one) { return one.second.touched; }));
        found = all_.emplace(std::move(which), entry()).first;
    }
    auto& made = found->second;
    made.touched = ++touches_;
    if (types) made.types = types;
    return &made;
}

void use_book::waits(const use_target& way, std::string_view service, const packet_types* types) {
    auto* one = touch(way, service, types);
    if (!one) return;
    one->failed = false;
    if (!std::exchange(one->missing, true)) one->since = runtime_.on().now();
    watch();
}

void use_book::reached(const use_target& way, std::string_view service, const packet_types* types) {
    auto* one = touch(way, service, types);
    if (!one) return;
    one->missing = one->failed = false;
    one->cause.clear();
    if (!std::exchange(one->reported, false)) return;
    awaited_use what;
    what.target = way.name();
    what.service = service;
    runtime_.log().info(
        "waits no longer",
        {{"for", subject_of(what)},
         {"waited_s", fmt::format("{:.1f}", std::chrono::duration<double>(runtime_.on().now() - one->since).count())}});
    if (on_change) on_change();
}

void use_book::missed(const use_target& way, std::string_view service, const packet_types* types, std::string cause) {
    auto* one = touch(way, service, types);
    if (!one) return;
    if (!std::exchange(one->missing, true)) one->since = runtime_.on().now();
    one->failed = true;
    one->failed_at = runtime_.on().now();
    one->cause = std::move(cause);
    watch();
}

std::vector<use_book::used_service> use_book::services() const {
    std::map<std::string_view, const packet_types*> each;
    for (const auto& [which, one] : all_)
        if (one.types) each.emplace(which.second, one.types);
    std::vector<used_service> made;
    for (const auto& [name, types] : each) made.push_back({std::string(name), types});
    return made;
}

use_book::ways_by_name use_book::ways() const {
    ways_by_name made;
    for (const auto* way : ways_) made.emplace(way->name(), way);
    return made;
}

bool use_book::look_at(const key& of, const entry& what, const ways_by_name& ways, awaited_use& found) const {
    if (!what.missing) return false;
    const use_target* waiting = nullptr;
    auto [at, end] = ways.equal_range(of.first);
    for (; at != end && !waiting; ++at)
        if (at->second->awaits(of.second)) waiting = at->second;
    if (!waiting && (!what.failed || runtime_.on().now() - what.failed_at >= memory)) return false;
    found.target = of.first;
    found.service = of.second;
    found.since = what.since;
    found.cause = what.cause;
    found.stage = !waiting ? wait_stage::unreached : waiting->located() ? wait_stage::provider : wait_stage::name;
    if (auto obstacle = waiting ? waiting->obstacle() : std::string(); !obstacle.empty())
        found.cause = std::move(obstacle);
    if (found.cause.empty())
        found.cause = found.stage == wait_stage::name ? fmt::format("no component is registered as '{}'", found.target)
                                                      : std::string("no session was made");
    return true;
}

std::vector<awaited_use> use_book::awaited() const {
    std::vector<awaited_use> made;
    auto all = ways();
    awaited_use found;
    for (const auto& [which, one] : all_)
        if (look_at(which, one, all, found)) made.push_back(std::move(found));
    return made;
}

std::string use_book::summary() const {
    std::string first;
    std::size_t more = 0;
    for (const auto& [which, one] : all_) {
        if (!one.reported) continue;
        awaited_use what;
        what.target = which.first;
        what.service = which.second;
        if (first.empty()) first = subject_of(what);
        else ++more;
    }
    if (first.size() > max_summary) first.resize(max_summary);
    return more == 0 ? first : fmt::format("{} and {} more", first, more);
}

// Only while something is missing.
void use_book::look() {
    auto all = ways();
    auto now = runtime_.on().now();
    bool changed = false;
    for (auto& [which, one] : all_) {
        awaited_use found;
        if (!look_at(which, one, all, found)) { // nobody wants it any more
            one.missing = one.failed = false;
            changed = std::exchange(one.reported, false) || changed;
            continue;
        }
        if (now - one.since < patience || std::exchange(one.reported, true)) continue;
        changed = true;
        auto since = runtime_.env().wall() - std::chrono::duration_cast<wall_time::duration>(now - one.since);
        runtime_.log().warning(text_of(found.stage),
                               {{"for", subject_of(found)}, {"since", iso_8601(since)}, {"cause", found.cause}});
    }
    if (std::ranges::any_of(all_, [](const auto& one) { return one.second.missing; })) watch();
    if (changed && on_change) on_change();
}

void use_book::watch() {
    if (!stopped_ && !due_.armed()) due_.arm(saturating_add(runtime_.on().now(), use_watch_period));
}

void use_book::stop() noexcept {
    stopped_ = true;
    due_.disarm();
}

} // namespace ise
