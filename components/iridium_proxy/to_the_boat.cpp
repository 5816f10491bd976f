#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/proxy_state.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;

// Before the caller's deadline, so that "pending" still reaches it.
ise::duration reply_margin(ise::duration left) { return std::clamp<ise::duration>(left / 5, 20ms, 800ms); }
constexpr ise::duration disk_pause = 5s;
} // namespace

std::optional<std::uint64_t> iridium_proxy::budget_left() {
    if (options_.daily_budget == 0) return std::nullopt;
    auto spent = state_->store.spent_on(clock());
    if (!spent) {
        disk_trouble(spent.error());
        return 0; // what was spent is not known
    }
    return options_.daily_budget - std::min(options_.daily_budget, spent->mt_credits);
}

/// Keeps what changed, tells it, and looks when to come again.
void iridium_proxy::work() {
    auto& s = *state_;
    if (s.working) return;
    s.working = true;
    s.queue.on_time(queue_clock());
    for (const auto& entry : s.queue.take_changes()) {
        auto saved = s.store.save(entry);
        if (!saved) disk_trouble(saved.error());
        auto change = status_of(entry);
        s.states.to_some(change, [&s, &change](const ise::subscriber_info& subscriber) {
            auto who = s.followers.find(subscriber.number);
            return who == s.followers.end() || who->second == 0 || who->second == change.id;
        });
        if (!is_final(change.state)) continue;
        for (auto* call : s.calls)
            if (call->id == change.id) call->wake.resume({});
    }
    s.working = false;
    s.wake_sender.resume({});
    auto next = s.queue.next_event();
    if (next == utc_time::max()) s.due.disarm();
    // The wall clock may be set: it is asked again once a minute at least. Without a path nothing is ever given.
    else
        s.due.arm(
            ise::saturating_add(now(), std::clamp<ise::duration>(next - queue_clock(), s.path ? 1ms : 1000ms, 60s)));
}

/// Gives one message after the other to the gateway.
ise::task<> iridium_proxy::send_all() {
    auto& s = *state_;
    if (!s.path) {
        s.send_trouble = "telecommands wait: no way to the gateway is configured (--send-by)";
        co_return;
    }
    for (;;) {
        auto at = clock();
        auto due = s.queue.next_due(queue_clock(), budget_left());
        work();
        if (!due) {
            co_await s.wake_sender.wait(); // throws when it is cancelled
            continue;
        }
        mt_outcome outcome;
        auto bytes = due->raw.size();
        // What it will cost is on disk before it is spent.
        auto begun = s.store.begin_attempt(*s.queue.find(due->id), at, bytes, due->credits);
        if (begun) {
            mt_message message;
            message.id = due->id;
            message.imei = options_.imei;
            message.raw = std::move(due->raw);
            outcome = co_await s.path->give(std::move(message));
            bool free = outcome.what == mt_outcome::kind::refused || outcome.what == mt_outcome::kind::later;
            if (free) {
                auto refunded = s.store.refund(at, bytes, due->credits);
                if (!refunded) disk_trouble(refunded.error());
            }
        } else {
            disk_trouble(begun.error());
            outcome.text = "it could not be kept on disk";
        }
        s.queue.on_outcome(queue_clock(), due->id, outcome);
        bool well = outcome.what == mt_outcome::kind::accepted;
        std::string trouble = well ? std::string() : outcome.text;
        if (!trouble.empty() && trouble != s.send_trouble)
            log().warning("a telecommand was not taken", {{"id", std::to_string(due->id)}, {"cause", trouble}});
        if (well)
            log().info("a telecommand is at the gateway",
                       {{"id", std::to_string(due->id)}, {"reference", outcome.reference}});
        s.send_trouble = trouble;
        work();
        s.account(account());
        if (!begun) co_await sleep(disk_pause);
    }
}

ise::task<telecommand_reply> iridium_proxy::command(telecommand_request request, ise::time_point deadline) {
    auto& s = *state_;
    auto chosen = static_cast<std::uint32_t>(env().random()) | 1u; // never 0
    bool known = request.id != 0 && s.queue.find(request.id);
    auto taken = s.queue.submit(queue_clock(), request, chosen);
    if (!taken) throw ise::error(ise::errc::refused, taken.error().message()); // it had no effect
    auto id = *taken;
    if (!known) {
        auto kept = s.store.keep_clock_ahead(s.clock_ahead);
        if (kept) kept = s.store.save(*s.queue.find(id));
        if (!kept) {
            s.queue.forget(id);
            disk_trouble(kept.error());
            throw ise::error(ise::errc::refused,
                             "the telecommand could not be kept on disk: " + kept.error().message());
        }
    }
    work();
    proxy_state::waiting_call here(on(), id);
    struct listed {
        std::list<proxy_state::waiting_call*>& in;
        std::list<proxy_state::waiting_call*>::iterator at;
        ~listed() { in.erase(at); }
    } guard{s.calls, s.calls.insert(s.calls.end(), &here)};
    auto until = deadline == ise::time_point::max() ? ise::saturating_add(now(), 30s)
                                                    : deadline - reply_margin(deadline - now());
    here.late.arm(until);
    for (;;) {
        const auto* entry = s.queue.find(id);
        bool decided = !entry || is_final(entry->stage);
        if (decided || now() >= until) break;
        co_await here.wake.wait(); // throws what it was resumed with
    }
    telecommand_reply reply;
    reply.id = id;
    if (const auto* entry = s.queue.find(id)) {
        auto status = status_of(*entry);
        reply.state = is_final(status.state) ? status.state : telecommand_stage::pending;
        reply.result = status.result;
        reply.value = status.value;
        reply.boat_obeys = status.boat_obeys;
        reply.text = status.text;
    }
    co_return reply;
}

recall_reply iridium_proxy::recall(const recall_request& request) {
    auto& s = *state_;
    recall_reply reply;
    reply.recalled = s.queue.recall(queue_clock(), request.id, request.why);
    work();
    const auto* entry = s.queue.find(request.id);
    reply.text = entry ? entry->text : "it is not known here";
    return reply;
}

} // namespace atirma
