#include <components/gui_client/gui_client.hpp>

#include <components/boat/find_component.hpp>
#include <components/gui_client/choose_link.hpp>
#include <components/gui_client/freshness.hpp>
#include <components/gui_client/words.hpp>

#include <fmt/format.h>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration max_call = 30s, try_again = 2s;
constexpr ise::duration max_call_of_upload = 2s, try_again_of_upload = 100ms; // so soon it can be cancelled
constexpr ise::duration authority_call = 15s;
constexpr auto remembers_alarms = 10min;
constexpr std::size_t max_in_hand = 64; // own telecommands that are not decided

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
void gui_client::act(sail_to what) { spawn("sail to a place", sail(std::move(what))); }
void gui_client::act(change_authority what) { spawn("authority", change(std::move(what))); }
void gui_client::act(const remember_alarms& what) { state_->remember(what.before, clock() + remembers_alarms); }
void gui_client::act(const set_limits& what) { state_->set_limits(what.limits); }

void gui_client::act(set_xbee_parameter what) { spawn("modem parameter", set_modem(std::move(what))); }
void gui_client::act(const acknowledge_alarm& what) { state_->acknowledge(what.key); }
void gui_client::act(forget_track) { state_->clear_track(); }

ise::task<> gui_client::give(give_command what) { co_await execute(std::move(what)); }

/// Gives one telecommand, and goes on asking under its id until it is decided or its time is over: the boat executes
/// an id once, so asking again is safe, also after a proxy was lost. `stop`: it is left alone once that is true, and
/// may still be executed.
ise::task<command_phase> gui_client::execute(give_command what, const bool* stop) {
    telecommand_request request;
    request.id = static_cast<std::uint32_t>(env().random()) | 1u; // never 0
    request.command = what.command;
    request.confirmed = what.confirmed;
    const auto& links = state_->links();
    auto via = what.via;
    if (role_followed_) {              // the nodes record it, and know the links
        auto chosen = links.find(via); // the role itself is all of them: its link is that of the newest packet only
        if (chosen != links.end() && !chosen->second.all_links) request.via = chosen->second.link;
        via = options_.communication;
    } else if (via.empty()) {
        via = choose_link(links, state_->boat().settings, clock());
    }
    state_->asked(request.id, via, what.command, clock());
    news();
    auto settle = [&](command_phase phase, std::optional<float> value, std::string text) {
        state_->on_outcome(request.id, phase, value, std::move(text), clock());
        news();
        return phase;
    };
    if (via.empty()) co_return settle(command_phase::failed, std::nullopt, "no link to the boat was found yet");
    if (commands_in_hand_ >= max_in_hand)
        co_return settle(command_phase::failed, std::nullopt,
                         fmt::format("{} telecommands wait already", commands_in_hand_));
    struct counted {
        std::size_t& count;
        explicit counted(std::size_t& in) : count(in) { ++count; }
        ~counted() { --count; }
    } in_hand(commands_in_hand_);
    auto refusal = co_await get_authority(traits_of(what.command.kind()).needs_authority ? what.authority : taking::no);
    if (!refusal.empty()) co_return settle(command_phase::refused, std::nullopt, refusal);
    auto proxy = find_component(*this, via);
    auto valid = std::chrono::duration_cast<ise::duration>(std::chrono::duration<float>(what.valid_s));
    auto expires = ise::saturating_add(now(), valid);
    auto longest = stop ? max_call_of_upload : max_call;
    bool may_be_executed = false;
    for (;;) {
        auto left = expires - now();
        if (left <= ise::duration()) break;
        if (stop && *stop) co_return command_phase::sent;
        request.valid_s = std::max(1.0f, std::chrono::duration<float>(left).count());
        auto answer =
            co_await proxy.try_call(services::telecommand, request, std::min<ise::duration>(left + 1s, longest));
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
        if (stop && *stop) co_return command_phase::sent;
        co_await sleep(stop ? try_again_of_upload : try_again);
    }
    if (may_be_executed)
        co_return settle(command_phase::expired, std::nullopt,
                         "its time is over without an answer: it may have been executed");
    co_return settle(command_phase::failed, std::nullopt,
                     "its time is over, and the proxy was not reached: it was not executed");
}

/// Empty where this console has the authority then, or needs none; else why not.
ise::task<std::string> gui_client::get_authority(taking how) {
    if (how == taking::no || !role_followed_ || state_->authority().mine()) co_return std::string();
    authority_request request;
    request.action = authority_action::take;
    request.confirmed = how == taking::from_holder;
    change_authority what;
    what.request = std::move(request);
    auto changed = change(std::move(what));
    co_await std::move(changed);
    co_return state_->authority().problem;
}

ise::task<> gui_client::change(change_authority what) {
    auto settle = [this](bool under_way, std::string problem) {
        state_->asks_authority(under_way, std::move(problem));
        news();
    };
    if (!role_followed_) co_return settle(false, "no communication node was found: nobody can have the authority");
    if (path().empty()) co_return settle(false, "this console has no name, and cannot hold the authority");
    settle(true, std::string());
    auto nodes = at(options_.communication);
    auto answer = co_await nodes.try_call(services::authority, what.request, authority_call);
    if (answer) state_->on_authority(*answer, clock());
    settle(false, answer ? std::string() : answer.error().message());
}

ise::task<> gui_client::sail(sail_to what) {
    const auto& there = state_->mission().view();
    give_command one;
    one.via = what.via;
    one.authority = what.authority;
    bool empty = there.complete && there.points.empty();
    std::uint8_t place = empty ? std::uint8_t{0} : there.active;
    if (empty) one.command = commands::waypoint_add{what.point};
    else one.command = commands::waypoint_insert{place, what.point};
    auto select = one;
    auto phase = co_await execute(std::move(one));
    if (phase != command_phase::done) co_return;
    select.command = commands::waypoint_select{place};
    auto mode = select;
    phase = co_await execute(std::move(select));
    const auto& sailing = state_->boat().sailing;
    if (phase != command_phase::done || (sailing && sailing->value.mode == sailing_mode::automatic)) co_return;
    mode.command = commands::set_mode{sailing_mode::automatic};
    co_await execute(std::move(mode));
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
