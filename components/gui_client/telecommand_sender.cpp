#include <components/gui_client/telecommand_sender.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat/recall.hpp>
#include <components/gui_client/choose_link.hpp>
#include <components/gui_client/leg_check.hpp>
#include <components/gui_client/words.hpp>

#include <fmt/format.h>

namespace atirma::console {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration max_call = 30s, try_again = 2s;
constexpr ise::duration max_call_with_stop = 2s, try_again_with_stop = 100ms; // so soon it can be given up
constexpr std::size_t max_open = 64;

/// Another attempt would be answered alike.
bool is_refusal(ise::errc code) {
    using enum ise::errc;
    return code == refused || code == no_such_service || code == type_mismatch || code == invalid_argument ||
           code == malformed || code == unauthorized;
}
} // namespace

ise::task<command_phase> telecommand_sender::execute(give_command what, const bool* stop) {
    telecommand_request request;
    request.id = static_cast<std::uint32_t>(context_.self.env().random()) | 1u; // never 0
    request.command = what.command;
    request.confirmed = what.confirmed;
    auto to = route(what.via, request);
    auto valid_s = what.valid_s.value_or(default_valid_s(what.command.kind(), what.via));
    auto valid = std::chrono::duration_cast<ise::duration>(std::chrono::duration<float>(valid_s));
    auto expires = ise::saturating_add(context_.self.now(), valid);
    context_.state.asked(request.id, to, what.command, context_.clock(),
                         context_.clock() + std::chrono::floor<std::chrono::milliseconds>(valid));
    context_.news();
    if (auto why = limits_forbid(what); !why.empty()) co_return settle(request.id, command_phase::refused, why);
    if (to.empty()) co_return settle(request.id, command_phase::failed, "no link to the boat was found yet");
    if (open_.size() >= max_open)
        co_return settle(request.id, command_phase::failed, fmt::format("{} telecommands wait already", open_.size()));
    struct listed {
        telecommand_sender& of;
        std::uint32_t id;
        listed(telecommand_sender& in, std::uint32_t which, const boat_command& command) : of(in), id(which) {
            of.open_.emplace(id, command);
        }
        ~listed() { of.open_.erase(id); }
    } open(*this, request.id, what.command);
    bool needs_authority = traits_of(what.command.kind()).needs_authority;
    auto refusal = co_await authority_.acquire(needs_authority ? what.authority : taking::no);
    if (!refusal.empty()) co_return settle(request.id, command_phase::refused, refusal);
    auto id = request.id;
    if (context_.role.empty()) replace_older(id, what.command); // the nodes do so by themselves
    auto phase = co_await repeat(std::move(to), std::move(request), expires, stop);
    called_back_.erase(id);
    co_return phase;
}

void telecommand_sender::replace_older(std::uint32_t by, const boat_command& newer) {
    for (const auto& [id, older] : open_)
        if (id != by && newer.replaces(older))
            context_.self.spawn("call back", call_back(id, fmt::format("replaced by telecommand {}", by)));
}

float telecommand_sender::default_valid_s(command_kind kind, const std::string& via) const {
    const auto& links = context_.state.links();
    auto path = via;
    if (auto chosen = links.find(via); via.empty() || (chosen != links.end() && chosen->second.all_links))
        path = choose_link(links, context_.state.boat().rhythm, context_.clock());
    auto found = links.find(path);
    auto link = found != links.end() && found->second.link ? found->second.link : link_of_path(path);
    return std::chrono::duration<float>(default_validity(kind, link.value_or(link_id::xbee))).count();
}

void telecommand_sender::refuse(const give_command& what, std::string why) {
    auto id = static_cast<std::uint32_t>(context_.self.env().random()) | 1u;
    context_.state.asked(id, what.via, what.command, context_.clock());
    settle(id, command_phase::refused, std::move(why));
}

std::string telecommand_sender::limits_forbid(const give_command& what) const {
    const auto& state = context_.state;
    if (what.over_limits || !state.sea()) return {};
    auto trouble = leg_trouble(leg_context{*state.sea(), state.boat(), state.mission().view()}, what.command);
    return trouble.empty() ? std::string() : needs_override(trouble);
}

std::string telecommand_sender::route(const std::string& via, telecommand_request& request) const {
    const auto& links = context_.state.links();
    if (context_.role.empty())
        return via.empty() ? choose_link(links, context_.state.boat().rhythm, context_.clock()) : via;
    // The nodes record it, and know the links. The role itself stands for all of them: its link is only that of the
    // newest packet.
    auto chosen = links.find(via);
    if (chosen != links.end() && !chosen->second.all_links) request.via = chosen->second.link;
    return context_.role;
}

ise::task<command_phase> telecommand_sender::repeat(std::string to, telecommand_request request,
                                                    ise::time_point expires, const bool* stop) {
    auto& self = context_.self;
    auto provider = find_component(self, to);
    auto max_deadline = stop ? max_call_with_stop : max_call;
    bool may_be_executed = false, answered = false;
    for (;;) {
        auto left = expires - self.now();
        if (left < 2s) break;
        if (called_back_.contains(request.id) && !may_be_executed)
            co_return settle(request.id, command_phase::failed, "called back before it left this console");
        if (stop && *stop) co_return command_phase::sent;
        auto deadline = std::min(time_to_give(left), max_deadline);
        if (called_back_.contains(request.id) && !answered) {
            recall_request back;
            back.id = request.id;
            back.why = "called back by its operator";
            auto there = co_await provider.try_call(services::telecommand_recall, back, deadline);
            // A provider that was started anew may have sent it before; `telecommand` would give it a new one.
            if (there && !there->state)
                co_return settle(request.id, command_phase::expired, there->text + "; it may have been executed");
            if (there && is_final(*there->state) && *there->state != telecommand_stage::acknowledged)
                co_return settle(request.id, command_log::phase_of(*there->state, std::nullopt), there->text);
            // The boat's answer is asked for; and a node that refuses the recall has it on record.
            answered = there ? there->state == telecommand_stage::acknowledged : is_refusal(there.error().code());
            if (!answered) co_await self.sleep(stop ? try_again_with_stop : try_again);
            continue;
        }
        request.valid_s = std::chrono::duration<float>(left - deadline).count();
        // A node has a service of its own for raw ones; a proxy has one for all.
        bool raw = request.command.get_if<commands::raw>() && !context_.role.empty();
        const auto& service = raw ? services::raw_telecommand : services::telecommand;
        auto answer = co_await provider.try_call(service, request, deadline);
        if (answer) {
            if (answer->executed_at) context_.state.on_executed(request.id, *answer->executed_at);
            auto phase = command_log::phase_of(answer->state, answer->result);
            if (phase == command_phase::done && answer->executed_at && request.command.kind() == command_kind::set_mode)
                context_.state.on_mode_set(*answer->executed_at);
            if (is_final(answer->state)) co_return settle(request.id, phase, answer->text, answer->value);
            may_be_executed = true;
        } else {
            const auto& why = answer.error();
            if (why.executed() == ise::execution::unknown) may_be_executed = true;
            bool refused = is_refusal(why.code());
            if (refused && may_be_executed)
                co_return settle(request.id, command_phase::expired,
                                 why.message() + "; it was taken before: it may have been executed");
            settle(request.id, refused ? command_phase::refused : command_phase::asking, why.message());
            if (refused) co_return command_phase::refused;
        }
        if (stop && *stop) co_return command_phase::sent;
        co_await self.sleep(stop ? try_again_with_stop : try_again);
    }
    if (may_be_executed)
        co_return settle(request.id, command_phase::expired,
                         "its time is over without an answer: it may have been executed");
    co_return settle(request.id, command_phase::failed,
                     "its time is over, and the proxy was not reached: it was not executed");
}

ise::task<> telecommand_sender::call_back(std::uint32_t id, std::string why) {
    const auto* entry = context_.state.commands().find(id);
    if (!entry || is_over(entry->phase)) co_return;
    auto say = [this, id](std::string text) {
        context_.state.on_called_back(id, std::move(text));
        context_.news();
    };
    if (entry->own) called_back_.insert(id);
    say("is being called back");
    auto to = context_.role.empty() ? entry->path : context_.role;
    recall_request request;
    request.id = id;
    request.why = std::move(why);
    auto provider = find_component(context_.self, to);
    auto response = co_await provider.try_call(services::telecommand_recall, request, max_call);
    if (!response) say("could not be called back: " + response.error().message());
    else say(response->text);
    // An answer of the boat comes with its result.
    if (response && response->state && is_final(*response->state) &&
        *response->state != telecommand_stage::acknowledged)
        settle(id, command_log::phase_of(*response->state, std::nullopt), response->text);
}

command_phase telecommand_sender::settle(std::uint32_t id, command_phase phase, std::string text,
                                         std::optional<float> value) {
    context_.state.on_outcome(id, phase, value, std::move(text), context_.clock());
    context_.news();
    return phase;
}

} // namespace atirma::console
