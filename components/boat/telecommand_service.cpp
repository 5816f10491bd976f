#include <components/boat/telecommand_service.hpp>

#include <components/boat/recall.hpp>

#include <asio/error.hpp>

#include <algorithm>

namespace atirma {
namespace {
// Before the caller's deadline, so that "pending" still reaches it.
ise::duration reply_margin(ise::duration left) {
    return std::clamp<ise::duration>(left / 5, std::chrono::milliseconds(20), std::chrono::milliseconds(800));
}
} // namespace

struct telecommand_service::waiting_call {
    waiting_call(ise::loop& on, std::uint32_t of)
        : id(of), wake(on, [this] { wake.resume(asio::error::operation_aborted); }),
          late(on, [this] { wake.resume({}); }) {}
    std::uint32_t id;
    ise::waiter<std::error_code> wake;
    ise::timer late;
};

telecommand_service::telecommand_service(ise::component& of, book_options options)
    : of_(of), book_(options), due_(of.on(), [this] { work(); }) {}

utc_time telecommand_service::clock() const { return std::chrono::floor<std::chrono::milliseconds>(of_.wall()); }

void telecommand_service::provide() {
    ise::publication_callbacks<std::decay_t<decltype(services::telecommand_state)>> follow;
    follow.on_subscribe = [this](const follow_telecommand& which,
                                 const ise::subscriber_info& who) -> ise::result<followed_telecommands> {
        followers_[who.number] = which.id;
        followed_telecommands answer;
        if (which.id == 0) answer.now = book_.open();
        else if (const auto* known = book_.find(which.id)) answer.now.push_back(*known);
        return answer;
    };
    follow.on_unsubscribe = [this](const auto&, const ise::subscriber_info& who) {
        followers_.erase(who.number);
        return ise::nothing{};
    };
    states_ = of_.publish(services::telecommand_state, std::move(follow));
    of_.provide(services::telecommand, [this](telecommand_request request, const ise::call_context& context) {
        return command(std::move(request), context.deadline);
    });
    of_.provide(services::telecommand_recall, [this](const recall_request& request) {
        recall_reply reply;
        reply.recalled = book_.recall(clock(), request.id, request.why);
        work();
        const auto* status = book_.find(request.id);
        reply.text = status ? status->text : "it is not known here";
        return reply;
    });
}

void telecommand_service::work() {
    if (working_) return; // giving to the link may bring events, which end here again
    working_ = true;
    bool up = give && give();
    if (!up) book_.on_time(of_.now(), clock());
    working_ = false;
    for (const auto& change : book_.take_changes()) {
        states_.to_some(change, [this, &change](const ise::subscriber_info& subscriber) {
            auto who = followers_.find(subscriber.number);
            return who == followers_.end() || who->second == 0 || who->second == change.id;
        });
        if (!is_final(change.state)) continue;
        for (auto* call : calls_)
            if (call->id == change.id) call->wake.resume({});
    }
    auto next = up ? book_.next_event() : book_.next_expiry();
    if (next == ise::time_point::max()) due_.disarm();
    else due_.arm(next);
}

ise::task<telecommand_reply> telecommand_service::command(telecommand_request request, ise::time_point deadline) {
    auto chosen = static_cast<std::uint32_t>(of_.env().random()) | 1u; // never 0
    auto taken = book_.submit(of_.now(), clock(), request, chosen);
    if (!taken) throw ise::error(ise::errc::refused, taken.error().message()); // it had no effect
    auto id = *taken;
    work();
    waiting_call here(of_.on(), id);
    struct listed {
        std::list<waiting_call*>& in;
        std::list<waiting_call*>::iterator at;
        ~listed() { in.erase(at); }
    } guard{calls_, calls_.insert(calls_.end(), &here)};
    auto now = of_.now();
    auto until = deadline == ise::time_point::max() ? ise::saturating_add(now, std::chrono::seconds(30))
                                                    : deadline - reply_margin(deadline - now);
    here.late.arm(until);
    for (;;) {
        const auto* status = book_.find(id);
        bool decided = !status || is_final(status->state);
        if (decided || of_.now() >= until) break;
        co_await here.wake.wait(); // throws what it was resumed with
    }
    telecommand_reply reply;
    reply.id = id;
    if (const auto* status = book_.find(id)) {
        reply.state = is_final(status->state) ? status->state : telecommand_stage::pending;
        reply.result = status->result;
        reply.value = status->value;
        reply.text = status->text;
        reply.boat_obeys = status->boat_obeys;
    }
    co_return reply;
}

} // namespace atirma
