#include "ledger.hpp"

#include <algorithm>
#include <array>

namespace seeds {
namespace {

using namespace std::chrono_literals;
using ise::errc;
using ise::execution;

// What a virtual loop may be late by: nothing takes time there, so it is only rounding.
constexpr ise::duration grain = 1ms;
// Of a call on an undisturbed link, beyond what its handler takes.
constexpr ise::duration on_the_way = 2s;
// A caller knows its provider's clock to half of the shortest round trip; the provider may give up by twice that early.
// A storm makes round trips as long as it likes, that of a handshake as long as `connect_time`.
constexpr ise::duration uncertainty = 250ms, uncertainty_in_storms = 5s;

// What the library says when its own peer breaks the wire format.
constexpr std::array protocol_words{"came after packet",
                                    "answered twice",
                                    "out of turn",
                                    "a request came",
                                    "was introduced with",
                                    "number that is in use",
                                    "in the middle of a session",
                                    "without its sequence",
                                    "came twice"};

} // namespace

std::string ledger::name(std::uint64_t id, const record& of) const {
    return fmt::format("call {} of '{}' by {} ({}) at {} ({})", id, of.terms.service, of.terms.caller, of.terms.from,
                       of.terms.target, of.terms.to);
}

std::uint64_t ledger::open(call_terms terms) {
    auto id = ++last_;
    auto& made = records_[id];
    made.began = world_.now();
    open_[terms.life].insert(id);
    journal_.note("call {} {} -> {} {} until {:.6f}", id, terms.caller, terms.target, terms.service,
                  std::chrono::duration<double>(terms.deadline - ise::sim::world::start).count());
    made.terms = std::move(terms);
    journal_.tally("calls");
    return id;
}

void ledger::given_up(std::uint64_t id) {
    auto& of = records_.at(id);
    if (of.over) return;
    of.given_up = world_.now();
    journal_.note("call {} is given up", id);
}

void ledger::run_began(std::uint64_t id, const std::string& where) {
    auto found = records_.find(id);
    if (found == records_.end()) return journal_.broken("{} runs call {}, which nobody made", where, id);
    auto& of = found->second;
    ++of.runs;
    of.ran = world_.now();
    if (planted_.strikes(bug::run_twice)) ++of.runs;
    journal_.note("call {} runs on {}", id, where);
    if (of.runs > 1) journal_.broken("{} runs {} times", name(id, of), of.runs);
    if (of.denied) journal_.broken("{} runs, and its caller was told that it did not", name(id, of));
}

void ledger::run_ended(std::uint64_t id) { ++records_.at(id).runs_ended; }

bool ledger::undisturbed(const record& of) const {
    if (!of.terms.by_name && rivalled.contains(of.terms.component)) return false;
    return calm(of.terms.from, of);
}

bool ledger::calm(const std::string& one, const record& of) const {
    auto reached = [&](const std::string& host) { return weather_.calm(one, host, of.began); };
    const auto rivals = rivalled.find(of.terms.component);
    return reached(of.terms.to) && std::ranges::all_of(of.terms.any_of, reached) &&
           (rivals == rivalled.end() || std::ranges::all_of(rivals->second, reached));
}

bool ledger::handler_cancelled(const record& of) const {
    if (of.terms.parent == 0) return false;
    const auto& parent = records_.at(of.terms.parent);
    return parent.over || parent.given_up || world_.now() >= parent.terms.deadline - uncertainty ||
           !undisturbed(parent) || handler_cancelled(parent);
}

void ledger::outcome(std::uint64_t id, const ise::result<done>& got) {
    if (planted_.strikes(bug::reply_lost)) return;
    auto& of = records_.at(id);
    auto now = world_.now();
    if (of.over) return journal_.broken("{} ends for the second time", name(id, of));
    of.over = true;
    open_[of.terms.life].erase(id);
    auto limit = of.given_up ? std::min(*of.given_up, of.terms.deadline) : of.terms.deadline;
    auto thawed = thawed_.find(of.terms.life);
    if (thawed != thawed_.end()) limit = std::max(limit, thawed->second);
    if (now + (planted_.strikes(bug::late_outcome) ? 1h : 0h) > limit + grain)
        journal_.broken("{} ends {:.6f} s after its {}", name(id, of),
                        std::chrono::duration<double>(now - limit).count(), of.given_up ? "cancellation" : "deadline");
    if (!got) {
        of.denied = got.error().executed() == execution::not_executed;
        journal_.note("call {} failed: {} {} {}", id, ise::name_of(got.error().code()),
                      ise::name_of(got.error().executed()), got.error().message());
        journal_.tally(fmt::format("calls that ended as {}", ise::name_of(got.error().code())));
        if (of.runs > 0 && planted_.strikes_once(bug::denied_but_run)) of.denied = true;
        check_failure(id, of, got.error());
        return;
    }
    journal_.note("call {} answered", id);
    journal_.tally("calls that were answered");
    auto answered = got->id;
    if (planted_.strikes(bug::reply_mixed_up)) --answered;
    if (answered != id) journal_.broken("{} got the answer of call {}", name(id, of), answered);
    if (got->check != of.terms.check || sum_of(got->content) != got->check)
        journal_.broken("{} got an answer with other content", name(id, of));
    if (of.runs != 1 || of.runs_ended != 1)
        journal_.broken("{} was answered, and {} handlers began and {} ended", name(id, of), of.runs, of.runs_ended);
    if (of.terms.fails) journal_.broken("{} was answered, and its handler throws", name(id, of));
    if (planted_.strikes(bug::reply_twice)) outcome(id, got);
}

void ledger::check_failure(std::uint64_t id, record& of, const ise::failure& why) {
    auto result = [&] {
        return fmt::format("{} ended as {} ({}): {}", name(id, of), ise::name_of(why.code()),
                           ise::name_of(why.executed()), why.message());
    };
    if (of.denied && of.runs > 0) journal_.broken("{}; it ran", result());
    for (const auto* word : protocol_words)
        if (why.message().find(word) != std::string::npos)
            journal_.broken("{}; that is a breach of the protocol between two of us", result());
    bool calm = undisturbed(of);
    // Who could not ask for the name, or could not register it.
    bool no_names = of.terms.by_name && (!weather_.calm(of.terms.from, "ns", of.began) || !this->calm("ns", of));
    bool names_away = no_names && of.denied;
    switch (why.code()) {
        case errc::timed_out: {
            if (world_.now() <
                of.terms.deadline - (calm && !of.terms.over_session ? uncertainty : uncertainty_in_storms))
                return journal_.broken("{}, {:.6f} s before its deadline", result(),
                                       std::chrono::duration<double>(of.terms.deadline - world_.now()).count());
            // It may have waited for its name for long.
            auto ready = no_names ? (of.runs > 0 ? of.ran : of.terms.deadline) : of.began;
            bool enough = of.terms.deadline - ready > of.terms.work + on_the_way && of.terms.service != "alone";
            if (calm && enough && !of.terms.over_session) journal_.broken("{}, and nothing was disturbed", result());
            return;
        }
        case errc::peer_lost:
            if (calm && !of.terms.over_session) journal_.broken("{}, and nothing was disturbed", result());
            return;
        case errc::cancelled:
            if (calm && !of.given_up && !of.terms.over_session && !handler_cancelled(of))
                journal_.broken("{}, and nobody gave it up", result());
            return;
        case errc::handler_failed:
            if (!of.terms.fails) journal_.broken("{}, and its handler does not throw", result());
            return;
        case errc::overloaded:
            if (calm) journal_.tally("calls refused as overloaded with nothing disturbed");
            return;
        case errc::no_such_service:
            if (of.terms.over_session) return; // it restarts, and its links have made a session meanwhile
            [[fallthrough]];
        case errc::no_such_name:
        case errc::name_server_lost:
        case errc::unreachable:
            if (calm && !names_away) journal_.broken("{}, and nothing was disturbed", result());
            return;
        default: journal_.broken("{}, which cannot be", result());
    }
}

void ledger::dropped(std::uint64_t id) {
    auto& of = records_.at(id);
    if (of.over) return;
    of.lost = true;
}

void ledger::life_ended(std::uint64_t life, const std::string& who) {
    for (auto id : open_[life])
        journal_.broken("{} never ended, and {} has stopped in order", name(id, records_.at(id)), who);
    life_lost(life);
}

void ledger::life_lost(std::uint64_t life) {
    for (auto id : open_[life]) {
        auto& of = records_.at(id);
        of.over = of.lost = true;
    }
    open_.erase(life);
}

std::size_t ledger::open_calls(std::uint64_t life) const {
    auto found = open_.find(life);
    return found == open_.end() ? 0 : found->second.size();
}

void ledger::finish() {
    for (const auto& [life, ids] : open_)
        for (auto id : ids) journal_.broken("{} never ended", name(id, records_.at(id)));
}

} // namespace seeds
