#include <components/gui_client/gui_client.hpp>

#include <components/boat/find_component.hpp>
#include <components/gui_client/choose_link.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <fmt/format.h>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration longest_call = 30s, try_again = 2s;
constexpr std::size_t most_in_hand = 64; // own telecommands that are not decided
constexpr float upload_valid_s = 300;
constexpr int read_backs = 3;

/// Asking again changes nothing.
bool is_refusal(ise::errc code) {
    using enum ise::errc;
    return code == refused || code == no_such_service || code == type_mismatch || code == invalid_argument ||
           code == malformed || code == unauthorized;
}
} // namespace

void gui_client::carry_out() {
    for (auto& what : options_.port->take()) std::visit([this](auto& one) { act(std::move(one)); }, what);
    news();
}

void gui_client::act(give_command what) { spawn("telecommand", give(std::move(what))); }

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
    told.text = "stops after the telecommand that is under way";
    state_->on_upload(std::move(told));
}

void gui_client::act(set_xbee_parameter what) { spawn("modem parameter", set_modem(std::move(what))); }
void gui_client::act(const acknowledge_alarm& what) { state_->acknowledge(what.key); }
void gui_client::act(forget_track) { state_->clear_track(); }

ise::task<> gui_client::give(give_command what) { co_await execute(what.command, what.via, what.valid_s); }

/// Gives one telecommand, and goes on asking under its id until it is decided or its time is over: the boat executes
/// an id once, so asking again is safe, also after a proxy was lost.
ise::task<command_phase> gui_client::execute(boat_command command, std::string via, float valid_s) {
    if (via.empty()) via = choose_link(state_->links(), state_->boat().settings, clock());
    telecommand_request request;
    request.id = static_cast<std::uint32_t>(env().random()) | 1u; // never 0
    request.command = command;
    state_->asked(request.id, via, command, clock());
    news();
    auto settle = [&](command_phase phase, std::optional<float> value, std::string text) {
        state_->on_outcome(request.id, phase, value, std::move(text), clock());
        news();
        return phase;
    };
    if (via.empty()) co_return settle(command_phase::failed, std::nullopt, "no link to the boat was found yet");
    if (commands_in_hand_ >= most_in_hand)
        co_return settle(command_phase::failed, std::nullopt,
                         fmt::format("{} telecommands wait already", commands_in_hand_));
    struct counted {
        std::size_t& count;
        explicit counted(std::size_t& in) : count(in) { ++count; }
        ~counted() { --count; }
    } in_hand(commands_in_hand_);
    auto proxy = find_component(*this, via);
    auto expires =
        ise::saturating_add(now(), std::chrono::duration_cast<ise::duration>(std::chrono::duration<float>(valid_s)));
    bool may_be_executed = false;
    for (;;) {
        auto left = expires - now();
        if (left <= ise::duration()) break;
        request.valid_s = std::max(1.0f, std::chrono::duration<float>(left).count());
        auto answer =
            co_await proxy.try_call(services::telecommand, request, std::min<ise::duration>(left + 1s, longest_call));
        if (answer) {
            if (is_final(answer->state))
                co_return settle(command_log::phase_of(answer->state, answer->result), answer->value, answer->text);
            may_be_executed = true;
        } else {
            if (answer.error().executed() == ise::execution::unknown) may_be_executed = true;
            if (is_refusal(answer.error().code()))
                co_return settle(command_phase::refused, std::nullopt, answer.error().message());
            settle(command_phase::asking, std::nullopt, answer.error().message());
        }
        co_await sleep(try_again);
    }
    if (may_be_executed)
        co_return settle(command_phase::expired, std::nullopt,
                         "its time is over without an answer: it may have been executed");
    co_return settle(command_phase::failed, std::nullopt,
                     "its time is over, and the proxy was not reached: it was not executed");
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
    if (what.via.empty()) what.via = choose_link(state_->links(), state_->boat().settings, clock());
    auto trouble = co_await upload_points(points, what.via);
    auto done = state_->upload().done;
    bool cancelled = cancel_upload_;
    if (!trouble.empty()) {
        show_upload(cancelled ? upload_phase::cancelled : upload_phase::failed, done, points.size(), trouble);
        if (!cancelled) co_return;
    } else {
        show_upload(upload_phase::reading_back, points.size(), points.size(), "reads the list back");
    }
    for (int attempt = 0; attempt < read_backs; ++attempt) {
        bool told = co_await read_back(what.via);
        if (cancelled) co_return; // it is only to be seen what is there now
        if (!told) continue;
        const auto& there = state_->mission().view().points;
        if (!same(there, points)) continue;
        show_upload(upload_phase::verified, points.size(), points.size(),
                    fmt::format("the boat has all {} waypoints", points.size()));
        co_return;
    }
    const auto& there = state_->mission().view();
    show_upload(upload_phase::differs, points.size(), points.size(),
                there.complete ? "read back: " + describe_differences(there.points, points)
                               : std::string("the boat did not tell its list: read it back later"));
}

/// Empty where all went well, else what did not.
ise::task<std::string> gui_client::upload_points(std::vector<waypoint> points, std::string via) {
    show_upload(upload_phase::sending, 0, points.size(), "clears the list");
    boat_command command;
    command.kind = command_kind::waypoint_clear;
    auto phase = co_await execute(command, via, upload_valid_s);
    if (phase != command_phase::done) co_return fmt::format("the list was not cleared: {}", name_of(phase));
    command.kind = command_kind::waypoint_add;
    for (std::size_t i = 0; i < points.size(); ++i) {
        if (cancel_upload_) co_return fmt::format("cancelled: the boat has {} of {} waypoints", i, points.size());
        show_upload(upload_phase::sending, i, points.size(),
                    fmt::format("sends waypoint {} of {}", i + 1, points.size()));
        command.point = points[i];
        phase = co_await execute(command, via, upload_valid_s);
        if (phase != command_phase::done)
            co_return fmt::format("waypoint {} of {}: {}", i + 1, points.size(), name_of(phase));
    }
    co_return std::string();
}

/// True once the boat has told its whole list again.
ise::task<bool> gui_client::read_back(std::string via) {
    auto asked_at = clock();
    boat_command command;
    command.kind = command_kind::waypoint_read_back;
    auto phase = co_await execute(command, via, upload_valid_s);
    if (phase != command_phase::done) co_return false;
    auto link = link_of_path(via).value_or(link_id::xbee);
    auto patience = std::max(20.0, 3 * expected_period_s(value_kind::position, link, state_->boat().settings));
    auto until = now() + std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(patience));
    while (!state_->mission().complete_since(asked_at) && now() < until) co_await sleep(options_.tick);
    co_return state_->mission().complete_since(asked_at);
}

ise::task<> gui_client::set_modem(set_xbee_parameter what) {
    xbee_param_request request;
    request.name = what.name;
    request.value = what.value;
    state_->on_xbee_answer(what.path, fmt::format("sets {} to {}…", what.name, what.value));
    news();
    auto proxy = find_component(*this, what.path);
    auto answer = co_await proxy.try_call(services::xb_local_param, request, 15s);
    state_->on_xbee_answer(what.path, answer ? fmt::format("{} is {} now", answer->meaning, answer->value)
                                             : answer.error().message());
    news();
}

} // namespace atirma::console
