#include <components/boat/telecommand_audience.hpp>

#include <algorithm>

namespace atirma {
namespace {

// Before the caller's deadline, so that "pending" still reaches it.
ise::duration reply_margin(ise::duration left) {
    return std::clamp<ise::duration>(left / 5, std::chrono::milliseconds(20), std::chrono::milliseconds(800));
}

telecommand_reply reply_of(const telecommand_status& status) {
    telecommand_reply made;
    made.id = status.id;
    made.state = is_final(status.state) ? status.state : telecommand_stage::pending;
    made.result = status.result;
    made.value = status.value;
    made.text = status.text;
    made.boat_obeys = status.boat_obeys;
    made.executed_at = status.executed_at;
    return made;
}

} // namespace

struct telecommand_audience::waiting_call {
    waiting_call(std::list<waiting_call*>& in, telecommand_status now)
        : last(std::move(now)), calls(in), at(calls.insert(calls.end(), this)) {}
    waiting_call(const waiting_call&) = delete;
    ~waiting_call() { calls.erase(at); }

    telecommand_status last;
    std::list<waiting_call*>& calls;
    std::list<waiting_call*>::iterator at;
};

void telecommand_audience::provide(std::function<std::vector<telecommand_status>(std::uint32_t id)> now) {
    ise::publication_callbacks<std::decay_t<decltype(services::telecommand_state)>> follow;
    follow.on_subscribe =
        [this, now = std::move(now)](const follow_telecommand& which,
                                     const ise::subscriber_info& who) -> ise::result<followed_telecommands> {
        followers_[who.number] = which.id;
        followed_telecommands answer;
        answer.now = now(which.id);
        return answer;
    };
    follow.on_unsubscribe = [this](const auto&, const ise::subscriber_info& who) {
        followers_.erase(who.number);
        return ise::nothing{};
    };
    states_ = of_.publish(services::telecommand_state, std::move(follow));
}

void telecommand_audience::tell(const telecommand_status& change) {
    states_.publish_if(change, [this, &change](const ise::subscriber_info& subscriber) {
        auto who = followers_.find(subscriber.number);
        return who == followers_.end() || who->second == 0 || who->second == change.id;
    });
    for (auto* call : calls_)
        if (call->last.id == change.id) call->last = change;
    if (is_final(change.state)) decided_.notify();
}

ise::task<telecommand_reply> telecommand_audience::reply(telecommand_status last, ise::time_point deadline) {
    waiting_call here(calls_, std::move(last));
    auto now = of_.now();
    auto until = deadline == ise::time_point::max() ? ise::saturating_add(now, std::chrono::seconds(30))
                                                    : deadline - reply_margin(deadline - now);
    while (!is_final(here.last.state) && of_.now() < until) co_await decided_.wait(until);
    co_return reply_of(here.last);
}

} // namespace atirma
