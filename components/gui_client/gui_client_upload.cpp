#include <components/gui_client/gui_client.hpp>

#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <fmt/format.h>

// An upload: the list is cleared, added place by place, read back and compared.
namespace atirma::console {
namespace {
constexpr float upload_valid_s = 300;
constexpr int read_backs = 3;
} // namespace

void gui_client::act(upload_mission what) {
    if (uploading_) { // windows do not offer it; another of the operator's windows may
        auto told = state_->upload();
        told.text = "another upload is under way: wait for it, or cancel it";
        state_->on_upload(std::move(told));
        return;
    }
    uploading_ = true;
    cancel_upload_ = false;
    spawn("upload", upload(std::move(what)));
}

void gui_client::act(cancel_upload) {
    if (!uploading_) return;
    cancel_upload_ = true;
    auto told = state_->upload();
    told.text = "is being cancelled";
    state_->on_upload(std::move(told));
}

void gui_client::show_upload(upload_phase phase, std::size_t done, std::size_t total, std::string text) {
    upload_view told;
    told.phase = phase;
    told.done = done;
    told.total = total;
    told.text = std::move(text);
    told.at = clock();
    state_->on_upload(std::move(told));
    news();
}

ise::task<> gui_client::upload(upload_mission what) {
    struct running {
        bool& flag;
        ~running() { flag = false; }
    } guard{uploading_};
    auto points = what.points;
    auto via = what.via;
    auto trouble = co_await upload_points(std::move(what));
    auto done = state_->upload().done;
    bool cancelled = cancel_upload_;
    if (!trouble.empty()) {
        show_upload(cancelled ? upload_phase::cancelled : upload_phase::failed, done, points.size(), trouble);
        if (done > 0 || cancelled) spawn("read back", see_what_is_there(via));
        co_return;
    }
    show_upload(upload_phase::reading_back, points.size(), points.size(), "reads the list back");
    for (int attempt = 0; attempt < read_backs; ++attempt) {
        bool told = co_await read_back(via, &cancel_upload_);
        if (cancel_upload_) break;
        if (!told) continue;
        const auto& there = state_->mission().view().points;
        if (!same(there, points)) continue;
        show_upload(upload_phase::verified, points.size(), points.size(),
                    fmt::format("the boat has all {} waypoints", points.size()));
        co_return;
    }
    const auto& there = state_->mission().view();
    if (cancel_upload_)
        co_return show_upload(upload_phase::cancelled, points.size(), points.size(),
                              "all waypoints were sent; the list was not read back");
    show_upload(upload_phase::differs, points.size(), points.size(),
                there.complete ? "read back: " + describe_differences(there.points, points)
                               : std::string("the boat did not tell its list: read it back later"));
}

/// Empty where all went well, else what did not.
ise::task<std::string> gui_client::upload_points(upload_mission what) {
    const auto& points = what.points;
    show_upload(upload_phase::sending, 0, points.size(), "clears the list");
    give_command one;
    one.via = what.via;
    one.valid_s = upload_valid_s;
    one.confirmed = true;
    one.authority = what.authority;
    one.command = commands::waypoint_clear();
    auto phase = co_await execute(one, &cancel_upload_);
    if (cancel_upload_ && !is_over(phase)) co_return "cancelled: whether the boat clears its list is not known yet";
    if (phase != command_phase::done) co_return fmt::format("the list was not cleared: {}", name_of(phase));
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (cancel_upload_) co_return fmt::format("cancelled: the boat has {} of {} waypoints", i, points.size());
        show_upload(upload_phase::sending, i, points.size(),
                    fmt::format("sends waypoint {} of {}", i + 1, points.size()));
        one.command = commands::waypoint_add{points[i]};
        phase = co_await execute(one, &cancel_upload_);
        if (cancel_upload_ && !is_over(phase))
            co_return fmt::format("cancelled: the boat has {} of {} waypoints; waypoint {} is under way and may arrive",
                                  i, points.size(), i + 1);
        if (phase != command_phase::done)
            co_return fmt::format("waypoint {} of {}: {}", i + 1, points.size(), name_of(phase));
    }
    co_return std::string();
}

/// True once the boat has told its whole list again.
ise::task<bool> gui_client::read_back(std::string via, const bool* stop) {
    auto asked_at = clock();
    give_command one;
    one.via = via;
    one.valid_s = upload_valid_s;
    one.command = commands::waypoint_read_back();
    auto phase = co_await execute(std::move(one), stop);
    if (phase != command_phase::done) co_return false;
    auto link = link_of_path(via).value_or(link_id::xbee);
    auto patience = std::max(20.0, 3 * expected_period_s(value_kind::position, link, state_->boat().settings));
    auto until = now() + std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(patience));
    while (!state_->mission().complete_since(asked_at) && now() < until && !(stop && *stop))
        co_await sleep(options_.tick);
    co_return state_->mission().complete_since(asked_at);
}

/// After an upload that did not come to its end.
ise::task<> gui_client::see_what_is_there(std::string via) { co_await read_back(std::move(via), nullptr); }

} // namespace atirma::console
