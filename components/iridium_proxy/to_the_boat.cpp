#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/proxy_state.hpp>

#include <asio/error.hpp>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;

constexpr ise::duration disk_pause = 5s;
} // namespace

/// Where what was spent is not known, nothing is left.
link_budget iridium_proxy::budget() {
    auto& s = *state_;
    auto spent = [&](std::uint64_t limit, auto of) -> std::uint64_t {
        if (limit == 0) return 0;
        auto sum = of();
        if (sum) return sum->mt_credits;
        disk_trouble(sum.error());
        return limit;
    };
    auto at = clock();
    return budget_after(options_.daily_budget, spent(options_.daily_budget, [&] { return s.store.spent_on(at); }),
                        options_.monthly_budget,
                        spent(options_.monthly_budget, [&] { return s.store.spent_in_month_of(at); }));
}

/// Gives one message after the other to the gateway.
ise::task<> iridium_proxy::send_all() {
    auto& s = *state_;
    if (!s.path) {
        s.send_trouble = "telecommands wait: no way to the gateway is configured (--send-by)";
        co_return;
    }
    auto& tracker = s.commands.tracker();
    for (;;) {
        if (s.seal && s.seal->knows_session()) tracker.repeat_unreadable(s.commands.now());
        auto at = clock();
        auto due = next_within_budget(tracker, s.commands.now(), budget(), options_.bytes_per_credit);
        s.commands.work();
        if (!due) {
            co_await s.wake_sender.wait(); // throws when it is cancelled
            continue;
        }
        link_outcome outcome;
        // Not those of a session that is over: the boat may have executed them in it, and have lost their ids with it.
        tracker.mark_unreadable(due->id, s.seal && !s.seal->knows_session());
        auto raw = sealed(due->raw);
        if (raw) due->raw = std::move(*raw);
        auto bytes = due->raw.size();
        auto credits = credits_of(bytes, options_.bytes_per_credit);
        // What it will cost is on disk before it is spent.
        auto begun = raw ? s.store.begin_attempt(*tracker.find(due->id), at, bytes, credits)
                         : ise::result<void>(ise::failure(raw.error()));
        if (begun) {
            mt_message message;
            message.id = due->id;
            message.imei = options_.imei;
            message.raw = std::move(due->raw);
            outcome = co_await s.path->give(std::move(message));
            bool free = outcome.what == link_outcome::kind::refused || outcome.what == link_outcome::kind::later;
            if (free) {
                auto refunded = s.store.refund(at, bytes, credits);
                if (!refunded) disk_trouble(refunded.error());
            }
        } else {
            disk_trouble(begun.error());
            outcome.text = "it could not be kept on disk";
        }
        tracker.on_outcome(s.commands.now(), due->id, outcome);
        bool well = outcome.what == link_outcome::kind::accepted;
        std::string trouble = well ? std::string() : outcome.text;
        if (!trouble.empty() && trouble != s.send_trouble)
            log().warning("a telecommand was not taken", {{"id", std::to_string(due->id)}, {"cause", trouble}});
        if (well)
            log().info("a telecommand is at the gateway",
                       {{"id", std::to_string(due->id)}, {"reference", outcome.reference}});
        s.send_trouble = trouble;
        s.sender_rests = !begun;
        s.commands.work();
        s.account(account());
        if (begun) continue;
        co_await sleep(disk_pause);
        s.sender_rests = false;
    }
}

} // namespace atirma
