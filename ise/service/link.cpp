#include <ise/service/link.hpp>

#include <ise/core/limits.hpp>
#include <ise/core/sleep.hpp>
#include <ise/net/connect.hpp>
#include <ise/service/back_off.hpp>
#include <ise/service/link_role.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>
#include <ise/service/subscriber_core.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {
namespace {

// A session that lived this long was a good one: the next try begins without delay.
constexpr duration steady_session = std::chrono::seconds(5);
// One of several members is given this long before the next is tried.
constexpr duration member_patience = std::chrono::seconds(1);

// Why a session in good order did not take a call.
failure overloaded(session& over, const std::string& who, execution began = execution::not_executed) {
    if (auto unsent = over.wire().out().pending_call_bytes(); unsent > over.host().options().max_unsent_bytes)
        return {errc::overloaded, fmt::format("{} bytes of calls and replies wait for being sent to {} (max_unsent_bytes)", unsent, who), began};
    return {errc::overloaded, fmt::format("too many calls are pending at {} (max_calls_per_session there)", who), began};
}

} // namespace

void let_go_of_link::operator()(link* held) const noexcept {
    if (--held->calls_ == 0) auto last = std::move(held->self_); // may be the last of all
}

held_link hold(const std::shared_ptr<link>& to) {
    if (to->calls_++ == 0) to->self_ = to;
    return held_link(to.get());
}

held_link hold(std::shared_ptr<link>&& to) {
    auto& of = *to;
    if (of.calls_++ == 0) of.self_ = std::move(to);
    return held_link(&of);
}

link::link(service_host& host, std::string path, std::optional<endpoint> fixed, role_options how)
    : host_(host), path_(std::move(path)), fixed_(std::move(fixed)), name_(fixed_ ? fixed_->text() : path_),
      next_call_number_(host.next_call_range()), how_(how), pause_(host.env(), host.options().first_back_off, host.options().longest_back_off),
      connect_time_(host.options().connect_time), spread_(host.options().reconnect_spread) {}

link::link(service_host& host, const std::shared_ptr<session>& peer)
    : host_(host), name_(peer->peer_name()), session_(peer), next_call_number_(host.next_call_range()),
      pause_(host.env(), host.options().first_back_off, host.options().longest_back_off), connect_time_(host.options().connect_time),
      spread_(host.options().reconnect_spread), peer_only_(true) {}

link::~link() {
    forget_role();
    // Nobody talks to the peer over it any more; a peer that made the session itself keeps it.
    if (session_ && session_->open() && !peer_only_ && !host_.on().abandoned()) session_->finish(failure(errc::cancelled, "nothing more to say"), std::chrono::seconds(1));
}

void link::hurry(duration longest_pause, duration connect_time) noexcept {
    pause_.limit(longest_pause);
    spread_ = std::min(spread_, longest_pause);
    connect_time_ = std::min(connect_time_, connect_time);
}

std::string link::obstacle() const {
    if (!obstacle_.empty() || fixed_ || peer_only_) return obstacle_;
    auto* names = host_.resolver();
    return names ? names->trouble() : std::string();
}

void link::submit(pending_call& call, outgoing_packet request) {
    if (host_.on().abandoned()) { // nothing would ever complete it: whoever waits is unwound, as everywhere then
        if (call.slot.is_connected()) call.slot.clear();
        host_.on().delist(call);
        auto dropped = std::move(call.done);
        auto owner = std::move(call.owner);
        return;
    }
    if (call.deadline <= host_.on().now()) {
        host_.calls().fail(call, failure(errc::timed_out, fmt::format("'{}' at {} was called after its deadline", call.service, name_)));
        return;
    }
    call.alarm.arm(call.deadline);
    try {
        if (session_ && session_->open()) {
            if (session_->send(call, request)) return;
            host_.calls().fail(call, overloaded(*session_, name_));
            return;
        }
        if (host_.stopping() || peer_only_) {
            auto why = peer_only_ ? failure(errc::peer_lost, fmt::format("the session with {} has ended", name_))
                                  : failure(errc::cancelled, "the component stops");
            host_.calls().fail(call, why);
            return;
        }
        if (waiting_.size() >= limit::waiting_calls) {
            host_.calls().fail(call, failure(errc::overloaded, fmt::format("{} calls wait for a session with {} (waiting_calls)", waiting_.size(), name_)));
            return;
        }
        call.waiting = request.keep();
    } catch (const error& thrown) {
        host_.calls().fail(call, thrown.why());
        return;
    }
    call.sent_on = nullptr;
    waiting_.push_back(&call);
    wake();
}

void link::requeue(pending_call& call, kept_packet request) {
    call.sent_on = nullptr;
    call.number = call.sent_to = 0;
    call.waiting = std::move(request);
    waiting_.push_back(&call);
}

void link::repeat(pending_call& call) {
    call.sent_on = nullptr;
    waiting_.push_back(&call);
}

void link::forget(pending_call& call) noexcept { waiting_.remove(&call); }

void link::attach(subscriber_core& subscriber) {
    subscribers_.push_back(&subscriber);
    if (session_ && session_->open()) {
        session_->subscribe(subscriber);
    } else if (peer_only_ || host_.stopping()) {
        subscriber.on_refused(failure(errc::peer_lost, fmt::format("the session with {} has ended", name_)));
    } else {
        wake();
    }
}

void link::detach(subscriber_core& subscriber) noexcept { std::erase(subscribers_, &subscriber); }

task<result<void>> link::connect(time_point deadline) {
    ++connectors_;
    bool late = false;
    waiter<> arrival(host_.on(), [&arrival] { arrival.resume(); });
    timer alarm(host_.on(), [&] {
        late = true;
        arrival.resume();
    });
    alarm.arm(deadline);
    arrivals_.push_back(&arrival);
    auto self = shared_from_this();
    wake();
    if (!session_ && !host_.stopping()) co_await arrival.wait();
    std::erase(arrivals_, &arrival);
    --connectors_;
    if (session_ && session_->open()) co_return result<void>();
    co_return failure(late ? errc::timed_out : errc::cancelled,
                      fmt::format("no session with {}{}{}", name_, late ? " in time" : "", obstacle().empty() ? "" : ": " + obstacle()));
}

void link::wake() {
    if (maintaining_ || peer_only_ || session_ || host_.stopping()) return;
    maintaining_ = host_.scope().spawn("link to " + name_, maintain(shared_from_this())) != nullptr;
}

// One coroutine makes a session as long as somebody wants one and there is none; it holds the link meanwhile.
task<> link::maintain(std::shared_ptr<link> self) {
    struct leaving {
        link& of;
        ~leaving() { of.maintaining_ = false; }
    } guard{*self};
    auto& host = self->host_;
    duration pause{};
    if (self->since_ != time_point{}) { // again: many may have lost the same provider at this moment
        if (host.on().now() - self->since_ >= steady_session) self->pause_.reset();
        pause = self->pause_.after_loss(self->spread_);
    }
    for (;;) {
        if (pause > duration{}) co_await self->wait_before_next_try(pause);
        if (!self->wanted() || host.stopping()) co_return;
        auto made = co_await self->establish();
        if (made) {
            self->adopt(std::move(*made));
            if (self->session_) co_return; // else it broke at its first frames
        } else {
            bool news = self->obstacle_ != made.error().message();
            self->obstacle_ = made.error().message();
            if (news) host.log().debug(self->obstacle_, {{"link", self->name_}});
        }
        pause = self->pause_.next();
    }
}

task<> link::wait_before_next_try(duration pause) {
    auto& on = host_.on();
    auto until = saturating_add(on.now(), pause);
    auto* names = fixed_ ? nullptr : host_.resolver();
    // A short pause is over before it is worth a question.
    if (names && pause > spread_) {
        auto life = co_await names->next_life(path_, tried_life_, until);
        if (life != 0) {
            tried_life_ = life;
            pause_.reset();
            until = std::min(until, saturating_add(on.now(), pause_.after_loss(spread_))); // others have waited for it too
        }
    }
    co_await sleep_until(on, until);
}

void link::adopt(std::shared_ptr<session> made) {
    if (host_.stopping()) {
        made->finish(failure(errc::peer_lost, "the component stops"), std::chrono::seconds(1));
        return;
    }
    if (!made->open()) { // it ended before it was ours
        obstacle_ = made->wire().cause().message();
        return;
    }
    loop::turn in(host_.on());
    if (since_ != time_point{} && !subscribers_.empty()) host_.log().info("is reached again", {{"provider", name_}});
    session_ = std::move(made);
    since_ = host_.on().now();
    obstacle_.clear();
    for (auto* arrival : arrivals_) arrival->resume();
    for (auto* subscriber : std::vector(subscribers_)) session_->subscribe(*subscriber);
    send_waiting();
    consider_moving();
}

void link::send_waiting() {
    for (auto* call : std::exchange(waiting_, {})) {
        if (call->number != 0 && (!session_->wire().lossy() || call->sent_to != session_->peer().incarnation)) {
            auto why = session_->wire().lossy() ? "it was restarted before it answered" : "the session ended before the answer, and the next one is none over which calls are repeated";
            host_.calls().fail(*call, failure(errc::peer_lost, fmt::format("'{}' at {}: {}", call->service, name_, why), execution::unknown));
            continue;
        }
        auto began = call->number != 0 ? execution::unknown : execution::not_executed; // it was sent once before
        auto request = std::exchange(call->waiting, {});
        try {
            bool sent = session_->send(*call, outgoing_packet(request));
            if (!sent) host_.calls().fail(*call, overloaded(*session_, name_, began));
        } catch (const error& thrown) {
            host_.calls().fail(*call, failure(thrown.code(), thrown.why().message(), began));
        } catch (const std::exception& thrown) { // of a packet with functions of its own
            host_.calls().fail(*call, failure(errc::malformed, thrown.what(), began));
        }
    }
}

void link::stop() {
    failure why(errc::cancelled, "the component stops");
    for (auto* arrival : arrivals_) arrival->resume();
    failure in_doubt(why.code(), why.message(), execution::unknown);
    for (auto* call : std::exchange(waiting_, {})) host_.calls().fail(*call, call->number != 0 ? in_doubt : why);
}

task<result<std::shared_ptr<session>>> link::establish() {
    resolution found;
    if (fixed_) {
        auto& there = found.members.emplace_back();
        there.path = path_;
        there.endpoints.push_back(*fixed_);
    } else {
        auto* names = host_.resolver();
        if (!names) co_return failure(errc::invalid_argument, fmt::format("'{}' is a name, and this component was given no name server", path_));
        auto answer = co_await names->resolve(path_);
        if (!answer) {
            if (answer.error().code() == errc::no_such_name) tried_life_ = 0;
            co_return answer.error();
        }
        found = std::move(*answer);
        tried_life_ = found.members.front().incarnation;
        take_members(found);
        if (role_) found.members = role_->choice.candidates();
    }
    std::string tried;
    failure last(errc::unreachable, fmt::format("nobody is known to serve {}", name_));
    for (std::size_t at = 0; at < found.members.size(); ++at) {
        const auto& member = found.members[at];
        // Who is not the last that can be tried gets less patience.
        auto until = at + 1 < found.members.size() ? saturating_add(host_.on().now(), std::min(connect_time_, member_patience)) : time_point::max();
        auto made = co_await reach(member, connect_time_, until);
        if (made) {
            if (role_) role_->choice.took(member);
            co_return made;
        }
        last = made.error();
        tried += fmt::format("{}{}", tried.empty() ? "" : "; ", last.message());
    }
    co_return failure(last.code(), tried.empty() ? last.message() : tried);
}

task<result<std::shared_ptr<session>>> link::reach(location where, duration patience, time_point until) {
    std::string tried;
    failure last(errc::unreachable, fmt::format("{} has no endpoint that can be reached from here", where.path.empty() ? name_ : where.path));
    for (const auto& at : where.endpoints) {
        auto deadline = std::min(saturating_add(host_.on().now(), patience), until);
        // The stream is connected under the same deadline as the greeting.
        auto transport = co_await net::connect_until(host_.on(), at, deadline, host_.credentials().tls);
        if (!transport) {
            last = transport.error();
        } else {
            auto hello = host_.greeting_to(where, at, (*transport)->peer());
            auto greeted = co_await net::initiate(host_.on(), std::move(*transport), std::move(hello), deadline, host_.credentials().key.get());
            if (greeted) co_return host_.run(std::move(*greeted), weak_from_this());
            last = greeted.error();
        }
        tried += fmt::format("{}{}", tried.empty() ? "" : "; ", last.message());
    }
    co_return failure(last.code(), tried.empty() ? last.message() : tried);
}

void link::on_session_end(session& ended, const failure& cause) {
    if (session_.get() != &ended) { // one that the link has moved away from, which gave back what it had not written
        if (session_ && session_->open()) {
            send_waiting();
        } else if (wanted()) {
            wake();
        }
        return;
    }
    session_.reset();
    obstacle_ = cause.message();
    if (role_) role_->on_loss(ended, cause);
    if (host_.stopping()) {
        stop();
    } else if (wanted()) {
        if (!subscribers_.empty()) host_.log().info("was lost; its subscriptions go on when it is back", {{"provider", name_}, {"cause", cause.message()}});
        wake();
    }
}

} // namespace ise
