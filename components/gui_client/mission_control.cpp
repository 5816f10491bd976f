#include <components/gui_client/mission_control.hpp>

#include <components/boat/mission_checksum.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/leg_check.hpp>
#include <components/gui_client/words.hpp>

#include <fmt/format.h>

namespace atirma::console {
namespace {
constexpr int read_backs = 3;
} // namespace

void mission_control::upload(upload_mission what) {
    // The window does not offer it; another window of the operator may.
    if (running_) return show_text("another upload is under way: wait for it, or cancel it");
    const auto& state = context_.state;
    if (!what.over_limits && state.sea()) {
        leg_context legs{*state.sea(), state.boat(), state.mission().view()};
        if (auto trouble = leg_trouble(legs, what.points); !trouble.empty())
            return show(upload_phase::failed, 0, what.points.size(), needs_override(trouble));
    }
    running_ = true;
    cancelled_ = false;
    context_.self.spawn("upload", run_upload(std::move(what)));
}

void mission_control::cancel() {
    if (!running_) return;
    cancelled_ = true;
    show_text("is being cancelled");
}

void mission_control::show(upload_phase phase, std::size_t done, std::size_t total, std::string text) {
    upload_view view;
    view.phase = phase;
    view.done = done;
    view.total = total;
    view.text = std::move(text);
    view.at = context_.clock();
    context_.state.on_upload(std::move(view));
    context_.news();
}

void mission_control::show_text(std::string text) {
    auto view = context_.state.upload();
    view.text = std::move(text);
    context_.state.on_upload(std::move(view));
}

ise::task<> mission_control::run_upload(upload_mission what) {
    struct running {
        bool& flag;
        ~running() { flag = false; }
    } guard{running_};
    const auto& points = what.points;
    auto trouble = co_await send_points(what);
    if (!trouble.empty()) {
        auto done = context_.state.upload().done;
        show(cancelled_ ? upload_phase::cancelled : upload_phase::failed, done, points.size(), trouble);
        if (done == points.size()) context_.self.spawn("read back", read_back_once(what.via));
        co_return;
    }
    show(upload_phase::reading_back, points.size(), points.size(), "reads the list back");
    const auto& on_boat = context_.state.mission().view();
    for (int attempt = 0; attempt < read_backs; ++attempt) {
        bool reported = co_await read_back(what.via, &cancelled_);
        if (cancelled_) break;
        if (!reported || !same(on_boat.points, points)) continue;
        co_return show(upload_phase::verified, points.size(), points.size(),
                       fmt::format("the boat has all {} waypoints", points.size()));
    }
    if (cancelled_)
        co_return show(upload_phase::cancelled, points.size(), points.size(),
                       "all waypoints were sent; the list was not read back");
    show(upload_phase::differs, points.size(), points.size(),
         on_boat.complete ? "read back: " + describe_differences(on_boat.points, points)
                          : std::string("the boat did not report its list: read it back later"));
}

/// Returns what went wrong; empty where nothing did. `what` outlives it.
ise::task<std::string> mission_control::send_points(const upload_mission& what) {
    const auto& points = what.points;
    constexpr const char* keeps = "the boat keeps its list";
    give_command one;
    one.via = what.via;
    one.confirmed = true;
    one.over_limits = true; // the whole list was checked
    one.authority = what.authority;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (cancelled_) co_return fmt::format("cancelled after {} of {} waypoints: {}", i, points.size(), keeps);
        show(upload_phase::sending, i, points.size(), fmt::format("sends waypoint {} of {}", i + 1, points.size()));
        one.command = commands::mission_stage{static_cast<std::uint8_t>(i), points[i]};
        auto phase = co_await sender_.execute(one, &cancelled_);
        if (cancelled_ && !is_over(phase))
            co_return fmt::format("cancelled after {} of {} waypoints: {}", i, points.size(), keeps);
        if (phase != command_phase::done)
            co_return fmt::format("waypoint {} of {}: {}; {}", i + 1, points.size(), name_of(phase), keeps);
    }
    if (cancelled_)
        co_return fmt::format("cancelled after {} of {} waypoints: {}", points.size(), points.size(), keeps);
    show(upload_phase::sending, points.size(), points.size(), "tells the boat to use the new list");
    one.command = commands::mission_switch{static_cast<std::uint8_t>(points.size()), mission_checksum(points)};
    auto phase = co_await sender_.execute(one, &cancelled_);
    if (phase == command_phase::done) co_return std::string();
    bool known = is_over(phase) && phase != command_phase::expired;
    co_return fmt::format("the switch to the new list: {}; {}", name_of(phase),
                          known ? keeps
                                : "whether the boat has the old list or the new one shows when it is read back");
}

/// True once the boat has reported its whole list again.
ise::task<bool> mission_control::read_back(std::string via, const bool* stop) {
    auto& self = context_.self;
    const auto& state = context_.state;
    auto asked_at = context_.clock();
    give_command one;
    one.via = via;
    one.command = commands::waypoint_read_back();
    auto phase = co_await sender_.execute(std::move(one), stop);
    if (phase != command_phase::done) co_return false;
    auto link = link_of_path(via).value_or(link_id::xbee);
    auto patience = std::max(20.0, 3 * state.boat().rhythm.position_s(link));
    auto until = self.now() + std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(patience));
    while (!state.mission().complete_since(asked_at) && self.now() < until && !(stop && *stop))
        co_await self.sleep(poll_);
    co_return state.mission().complete_since(asked_at);
}

/// After an upload that did not come to its end.
ise::task<> mission_control::read_back_once(std::string via) { co_await read_back(std::move(via), nullptr); }

ise::task<> mission_control::sail(sail_to what) {
    const auto& list = context_.state.mission().view();
    give_command one;
    one.via = what.via;
    one.authority = what.authority;
    one.over_limits = true; // checked here as a whole
    bool empty = list.complete && list.points.empty();
    std::uint8_t place = empty ? std::uint8_t{0} : list.active;
    if (empty) one.command = commands::waypoint_add{what.point};
    else one.command = commands::waypoint_insert{place, what.point};
    if (const auto* sea = context_.state.sea(); sea && !what.over_limits)
        if (auto trouble = leg_trouble(leg_context{*sea, context_.state.boat(), list}, what.point); !trouble.empty())
            co_return sender_.refuse(one, needs_override(trouble));
    auto phase = co_await sender_.execute(one);
    if (phase != command_phase::done) co_return;
    one.command = commands::waypoint_select{place};
    phase = co_await sender_.execute(one);
    const auto& sailing = context_.state.boat().sailing;
    if (phase != command_phase::done || (sailing && sailing->value.mode == sailing_mode::automatic)) co_return;
    one.command = commands::set_mode{sailing_mode::automatic};
    co_await sender_.execute(one);
}

} // namespace atirma::console
