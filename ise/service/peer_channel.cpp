#include <ise/service/peer_channel.hpp>

#include <ise/core/limits.hpp>
#include <ise/core/sleep.hpp>
#include <ise/service/peer_sessions.hpp>
#include <ise/service/role_state.hpp>
#include <ise/session/tracer.hpp>

#include <asio/any_io_executor.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace ise {
namespace {

// A session that lived this long was a good one: the next try begins without delay.
constexpr duration steady_session = std::chrono::seconds(5);
// One of several members is given this long before the next is tried.
constexpr duration member_patience = std::chrono::seconds(1);
// How often a session that was left is looked at whether its last calls have been answered.
constexpr duration drain_period = std::chrono::milliseconds(20);

// Why a session in good order did not take a call.
failure overloaded(session& over, const std::string& who, execution began = execution::not_executed) {
    if (auto unsent = over.wire().out().pending_call_bytes(); unsent > over.runtime().options().session_bytes)
        return {errc::overloaded,
                fmt::format("{} bytes of calls and replies wait to be sent to {} (session_bytes)", unsent, who), began};
    return {errc::overloaded, fmt::format("too many calls are pending at {} (max_calls_per_session there)", who),
            began};
}

} // namespace

std::string text_of(const std::vector<endpoint>& all) {
    std::string text;
    for (const auto& one : all) {
        if (!text.empty()) text += ',';
        text += one.text();
    }
    return text;
}

peer_channel::peer_channel(channel_context& of, std::string path, std::vector<endpoint> fixed, role_options how)
    : session_owner(of.calls.next_range(), true), of_(of), path_(std::move(path)), fixed_(std::move(fixed)),
      name_(fixed_.empty() ? path_ : text_of(fixed_)), how_(how),
      pause_(of.runtime.env(), runtime().options().first_back_off, runtime().options().max_back_off),
      connect_time_(runtime().options().connect_time), spread_(runtime().options().max_back_off / 10),
      located_(!fixed_.empty()) {
    of_.uses.add(*this);
}

peer_channel::peer_channel(channel_context& of, const std::shared_ptr<session>& peer)
    : session_owner(of.calls.next_range(), false), of_(of), name_(peer->peer_name()), session_(peer),
      pause_(of.runtime.env(), runtime().options().first_back_off, runtime().options().max_back_off),
      connect_time_(runtime().options().connect_time), spread_(runtime().options().max_back_off / 10) {}

peer_channel::~peer_channel() {
    if (reconnects() && outlived()) return;
    forget_role();
    // Nobody talks to the peer over it any more; a peer that made the session itself keeps it.
    if (connected() && reconnects() && !runtime().on().abandoned())
        session_->finish(failure(errc::cancelled, "nothing more to say"), std::chrono::seconds(1));
}

void peer_channel::hurry(duration max_pause, duration connect_time) noexcept {
    pause_.limit(max_pause);
    spread_ = std::min(spread_, max_pause);
    connect_time_ = std::min(connect_time_, connect_time);
}

std::string peer_channel::obstacle() const {
    if (!obstacle_.empty() || !fixed_.empty() || !reconnects()) return obstacle_;
    return of_.names ? of_.names->trouble() : std::string();
}

// A link back to a caller ends with its session: nothing waits for another one.
void peer_channel::note_wait(std::string_view service, const packet_types* types) {
    if (reconnects()) of_.uses.waits(*this, service, types);
}

void peer_channel::note_miss(std::string_view service, const packet_types* types, std::string cause) {
    if (reconnects()) of_.uses.missed(*this, service, types, std::move(cause));
}

void peer_channel::on_first_call(std::string_view service, const packet_types& types) {
    if (reconnects()) of_.uses.reached(*this, service, &types);
}

void peer_channel::on_established(const subscriber_core& subscriber) {
    if (reconnects()) of_.uses.reached(*this, subscriber.service(), &subscriber.types());
}

void peer_channel::on_missed(const subscriber_core& subscriber) {
    note_miss(subscriber.service(), &subscriber.types(), obstacle());
}

failure peer_channel::misplaced(service_key service) const {
    return {errc::invalid_argument,
            fmt::format("'{}' at {} was used off its component's thread: spawn the call on that component "
                        "(component::spawn), or wait for it from another thread (component::wait)",
                        service.name, name_)};
}

[[gnu::hot]] void peer_channel::call(service_key service, duration deadline, const asio::any_io_executor& waiting,
                                     call_waiter& waiter, outgoing_packet request, const std::source_location& where) {
    auto& on = runtime().on();
    auto& call = of_.calls.open(*this, waiter);
    try {
        call.service = service.name;
        call.types = service.types;
        call.began = on.now();
        call.deadline =
            saturating_add(call.began, deadline > duration{} ? deadline : runtime().options().default_deadline);
        call.made_in = context_of(waiting ? waiting : on.get_executor());
        if (call.made_in) call.deadline = std::min(call.deadline, call.made_in->deadline);
        if (const auto& cause = call.made_in ? call.made_in->trace : detail::trace_here()) [[unlikely]]
            call.trace = cause;
        call.where = where;
        if (auto* traces = runtime().options().traces.get()) [[unlikely]]
            call.spans = traces->begin_call(call.trace, call.caused_by, call.made_in != nullptr);
        if (on.abandoned()) return of_.calls.abandon(call);
        if (call.deadline <= call.began)
            return of_.calls.fail(call, failure(errc::timed_out, fmt::format("'{}' at {} was called after its deadline",
                                                                             call.service, name_)));
        call.alarm.arm(call.deadline);
        if (!connected()) return keep_waiting(call, request);
        if (!session_->calls().send(call, request)) of_.calls.fail(call, overloaded(*session_, name_));
    } catch (...) {
        fail_for_thrown(call);
    }
}

// Within a handler: what was thrown ends a call that is about to be sent, or to wait. Nothing holds it any more then.
void peer_channel::fail_for_thrown(pending_call& call) {
    failure why(errc::malformed, {});
    try {
        throw;
    } catch (const error& thrown) {
        why = failure(thrown.code(), thrown.why().message(), call.executed());
    } catch (...) { // of a packet with functions of its own, or there is no memory
        why = failure(errc::malformed, describe(std::current_exception()), call.executed());
    }
    if (call.holder) call.holder->let_go(call, errc::cancelled);
    of_.calls.fail(call, why);
}

// Until there is a session.
void peer_channel::keep_waiting(pending_call& call, outgoing_packet request) {
    if (!reconnects())
        return of_.calls.fail(call, failure(errc::peer_lost, fmt::format("the session with {} has ended", name_)));
    if (runtime().stopping()) return of_.calls.fail(call, failure(errc::cancelled, "the component stops"));
    if (waiting_.size() >= limit::waiting_calls)
        return of_.calls.fail(call, failure(errc::overloaded, fmt::format("{} calls wait for a session with {} "
                                                                          "(waiting_calls)",
                                                                          waiting_.size(), name_)));
    call.waiting = request.keep();
    wait_for_session(call, call_state::waiting);
    note_wait(call.service, call.types);
    wake();
}

void peer_channel::wait_for_session(pending_call& call, call_state how) noexcept {
    call.moves(how, *this);
    waiting_.push_back(call);
}

void peer_channel::requeue(pending_call& call, payload request) {
    call.number = call.sent_to = 0;
    call.waiting = std::move(request);
    wait_for_session(call, call_state::waiting);
}

void peer_channel::repeat(pending_call& call) { wait_for_session(call, call_state::repeating); }

failure peer_channel::let_go(pending_call& call, errc why) {
    waiting_.remove(call);
    if (why == errc::cancelled)
        return {why, fmt::format("the call of '{}' at {} was cancelled", call.service, name_), call.executed()};
    auto cause = obstacle();
    if (call.state == call_state::repeating)
        return {why,
                fmt::format("'{}' at {} did not answer in time; the session was lost meanwhile: {}", call.service,
                            name_, cause),
                call.executed()};
    note_miss(call.service, call.types, cause);
    return {why, fmt::format("'{}' at {} could not be called in time: {}", call.service, name_,
                             cause.empty() ? "no session was made" : cause)};
}

void peer_channel::attach(subscriber_core& subscriber) {
    subscribers_.push_back(&subscriber);
    if (connected()) {
        session_->subscriptions().subscribe(subscriber);
    } else if (!reconnects() || runtime().stopping()) {
        subscriber.on_refused(failure(errc::peer_lost, fmt::format("the session with {} has ended", name_)));
    } else {
        note_wait(subscriber.service(), &subscriber.types());
        wake();
    }
}

bool peer_channel::connected() const noexcept { return session_ && session_->open(); }

void peer_channel::detach(subscriber_core& subscriber) noexcept {
    std::erase(subscribers_, &subscriber);
    consider_moving();
}

task<result<void>> peer_channel::connect(time_point deadline) {
    ++connectors_;
    bool late = false;
    waiter<> arrival(runtime().on());
    timer alarm(runtime().on(), [&] {
        late = true;
        arrival.resume();
    });
    alarm.arm(deadline);
    arrivals_.push_back(&arrival);
    auto self = shared_from_this();
    if (!connected()) note_wait({}, nullptr);
    wake();
    if (!connected() && !runtime().stopping()) co_await arrival.wait();
    std::erase(arrivals_, &arrival);
    --connectors_;
    if (connected()) {
        of_.uses.reached(*this, {}, nullptr);
        co_return result<void>();
    }
    if (late) note_miss({}, nullptr, obstacle());
    co_return failure(late ? errc::timed_out : errc::cancelled,
                      fmt::format("no session with {}{}{}", name_, late ? " in time" : "",
                                  obstacle().empty() ? "" : ": " + obstacle()));
}

task<result<void>> peer_channel::find(std::shared_ptr<peer_channel> self, time_point deadline) {
    auto* names = self->of_.names.get();
    if (!names)
        co_return failure(
            errc::invalid_argument,
            fmt::format("'{}' cannot be found: this component has no name server; use at(endpoint)", self->path_));
    struct seeking {
        peer_channel& of;
        explicit seeking(peer_channel& who) : of(who) { ++of.seekers_; }
        ~seeking() { --of.seekers_; }
    } guard(*self);
    self->note_wait({}, nullptr);
    auto place = co_await names->resolve_when_present(self->path_, deadline);
    if (place) {
        self->located_ = true;
        self->of_.uses.reached(*self, {}, nullptr);
        co_return result<void>();
    }
    if (place.error().code() != errc::cancelled) self->note_miss({}, nullptr, place.error().message());
    co_return place.error();
}

bool peer_channel::awaits(std::string_view service) const noexcept {
    if (service.empty()) return seekers_ > 0 || (connectors_ > 0 && !session_);
    for (const auto* call = waiting_.first(); call; call = call->next)
        if (call->service == service) return true;
    return std::ranges::any_of(subscribers_,
                               [&](const auto* one) { return one->service() == service && !one->connected(); });
}

void peer_channel::wake() {
    if (maintaining_ || !reconnects() || session_ || runtime().stopping()) return;
    maintaining_ = runtime().scope().spawn("link to " + name_, maintain(shared_from_this())) != nullptr;
}

// One coroutine makes a session as long as somebody wants one and there is none; it holds the link meanwhile.
task<> peer_channel::maintain(std::shared_ptr<peer_channel> self) {
    struct leaving {
        peer_channel& of;
        ~leaving() { of.maintaining_ = false; }
    } guard{*self};
    auto& runtime = self->runtime();
    duration pause{};
    if (self->since_ != time_point{}) { // again: many may have lost the same provider at this moment
        if (runtime.on().now() - self->since_ >= steady_session) self->pause_.reset();
        pause = self->pause_.after_loss(self->spread_);
    }
    for (;;) {
        if (pause > duration{}) co_await self->wait_before_next_try(pause);
        if (!self->wanted() || runtime.stopping()) co_return;
        auto made = co_await self->establish();
        if (made) {
            self->adopt(std::move(*made));
            if (self->session_) co_return; // else it broke at its first frames
        } else {
            bool news = self->obstacle_ != made.error().message();
            self->obstacle_ = made.error().message();
            if (news) runtime.log().debug(self->obstacle_, {{"link", self->name_}});
        }
        pause = self->pause_.next();
    }
}

task<> peer_channel::wait_before_next_try(duration pause) {
    auto& on = runtime().on();
    auto until = saturating_add(on.now(), pause);
    auto* names = fixed_.empty() ? of_.names.get() : nullptr;
    // A short pause is over before it is worth a question.
    if (names && pause > spread_) {
        auto life = co_await names->next_life(path_, tried_life_, until);
        if (life != 0) {
            tried_life_ = life;
            pause_.reset();
            // Others have waited for it too.
            until = std::min(until, saturating_add(on.now(), pause_.after_loss(spread_)));
        }
    }
    co_await sleep_until(on, until);
}

void peer_channel::adopt(std::shared_ptr<session> made) {
    if (runtime().stopping()) {
        made->finish(failure(errc::peer_lost, "the component stops"), std::chrono::seconds(1));
        return;
    }
    if (!made->open()) { // it ended before it was ours
        obstacle_ = made->wire().cause().message();
        return;
    }
    loop::turn in(runtime().on());
    if (since_ != time_point{} && !subscribers_.empty())
        runtime().log().info("is reached again", {{"provider", name_}});
    session_ = std::move(made);
    since_ = runtime().on().now();
    obstacle_.clear();
    for (auto* arrival : arrivals_) arrival->resume();
    for (auto* subscriber : std::vector(subscribers_)) session_->subscriptions().subscribe(*subscriber);
    send_waiting();
    consider_moving();
}

void peer_channel::send_waiting() {
    while (!waiting_.empty()) {
        auto& call = waiting_.pop_front();
        if (call.state == call_state::repeating &&
            (!session_->wire().lossy() || call.sent_to != session_->peer().incarnation)) {
            auto why =
                session_->wire().lossy()
                    ? "it was restarted before it answered"
                    : "the session ended before the answer, and the next one is none over which calls are repeated";
            of_.calls.fail(call, failure(errc::peer_lost, fmt::format("'{}' at {}: {}", call.service, name_, why),
                                         execution::unknown));
            continue;
        }
        auto request = std::exchange(call.waiting, {});
        try {
            if (!session_->calls().send(call, outgoing_packet(request)))
                of_.calls.fail(call, overloaded(*session_, name_, call.executed()));
        } catch (...) {
            fail_for_thrown(call);
        }
    }
}

void peer_channel::stop() {
    for (auto* arrival : arrivals_) arrival->resume();
    while (!waiting_.empty()) {
        auto& call = waiting_.pop_front();
        of_.calls.fail(call, failure(errc::cancelled, "the component stops", call.executed()));
    }
}

task<result<std::shared_ptr<session>>> peer_channel::establish() {
    resolution found;
    if (!fixed_.empty()) {
        auto& there = found.members.emplace_back();
        there.path = path_;
        there.endpoints = fixed_;
    } else {
        auto* names = of_.names.get();
        if (!names)
            co_return failure(errc::invalid_argument,
                              fmt::format("'{}' is a name, and this component was given no name server", path_));
        auto answer = co_await names->resolve(path_);
        located_ = answer.has_value();
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
    failure last(errc::unreachable, fmt::format("no known component serves {}", name_));
    for (std::size_t at = 0; at < found.members.size(); ++at) {
        const auto& member = found.members[at];
        // Who is not the last that can be tried gets less patience.
        auto until = at + 1 < found.members.size()
                         ? saturating_add(runtime().on().now(), std::min(connect_time_, member_patience))
                         : time_point::max();
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

task<result<std::shared_ptr<session>>> peer_channel::reach(location where, duration patience, time_point until) {
    std::string tried;
    failure last(errc::unreachable, fmt::format("{} has no endpoint that can be reached from here",
                                                where.path.empty() ? name_ : where.path));
    for (const auto& at : where.endpoints) {
        auto deadline = std::min(saturating_add(runtime().on().now(), patience), until);
        // The stream is connected under the same deadline as the greeting.
        auto made = co_await of_.sessions.connect(where, at, deadline, weak_from_this());
        if (made && !fixed_.empty()) std::ranges::rotate(fixed_, std::ranges::find(fixed_, at));
        if (made) co_return made;
        last = made.error();
        tried += fmt::format("{}{}", tried.empty() ? "" : "; ", last.message());
    }
    co_return failure(last.code(), tried.empty() ? last.message() : tried);
}

void peer_channel::try_next(const failure& why) {
    if (fixed_.size() < 2 || !connected()) return;
    runtime().log().info("goes on with the next one", {{"provider", fixed_.front().text()}, {"cause", why.message()}});
    session_->finish(failure(errc::peer_lost, why.message()), duration{});
}

void peer_channel::on_session_end(session& ended, const failure& cause) {
    if (session_.get() != &ended) { // one that the link has moved away from, which gave back what it had not written
        if (connected()) {
            send_waiting();
        } else if (wanted()) {
            wake();
        }
        return;
    }
    session_.reset();
    obstacle_ = cause.message();
    if (!fixed_.empty()) std::ranges::rotate(fixed_, fixed_.begin() + 1); // the next one, before this one again
    if (role_) lose_member(ended, cause);
    if (runtime().stopping()) {
        stop();
    } else if (wanted()) {
        for (const auto* one : subscribers_) note_wait(one->service(), &one->types());
        std::string_view last; // many calls are mostly of few services
        for (const auto* call = waiting_.first(); call; call = call->next) {
            if (last != call->service) note_wait(call->service, call->types);
            last = call->service;
        }
        if (!subscribers_.empty())
            runtime().log().info("was lost; its subscriptions go on when it is back",
                                 {{"provider", name_}, {"cause", cause.message()}});
        wake();
    }
}

// How it follows the members of a role, and moves between them.

// The session with the member that was taken has ended.
void peer_channel::lose_member(session& ended, const failure& cause) {
    role_->due.disarm();
    auto heartbeat = duration(static_cast<std::int64_t>(ended.wire().terms().we_accept.heartbeat_ns));
    bool silent = runtime().on().now() - ended.wire().last_heard() >= heartbeat * 2;
    role_->choice.lost(silent || cause.code() == errc::superseded);
}

std::string peer_channel::holder() const { return session_ ? session_->peer().path : std::string(); }

void peer_channel::on_members(const resolution& found) {
    if (runtime().stopping()) return;
    take_members(found);
    if (!role_ || found.members.empty()) return;
    if (auto missing = role_->choice.unlisted())
        runtime().scope().spawn("question of " + name_, ask_about(shared_from_this(), std::move(*missing)));
}

// The member that is talked to is not told of any more. One whose lease is over is kept as long as its session lives;
// one that is registered still has left the role.
task<> peer_channel::ask_about(std::shared_ptr<peer_channel> self, location unlisted) {
    auto* names = self->of_.names.get();
    if (!names) co_return;
    auto found = co_await names->resolve(unlisted.path);
    if (!self->role_ || !found || found->role || found->members.front().incarnation != unlisted.incarnation) co_return;
    self->role_->choice.left(unlisted);
    self->consider_moving();
}

void peer_channel::take_members(const resolution& found) {
    if (!found.role) {
        forget_role();
        return;
    }
    if (!role_) {
        role_ = std::make_unique<role_state>(runtime().on(), how_, [this] {
            if (!moving_) moving_ = runtime().scope().spawn("move of " + name_, move(shared_from_this())) != nullptr;
        });
        of_.names->follow(path_, *this);
    }
    role_->choice.know(found.members, runtime().on().now());
    consider_moving();
}

void peer_channel::forget_role() noexcept {
    if (!role_) return;
    if (of_.names) of_.names->unfollow(path_, *this);
    role_.reset();
}

// Which a move would end.
bool peer_channel::runs_actions() const noexcept {
    return std::ranges::any_of(subscribers_, [](const auto* one) { return !one->resumes(); });
}

void peer_channel::consider_moving() {
    if (!role_ || moving_) return;
    std::optional<role_choice::change> better;
    if (connected() && !runtime().stopping()) better = role_->choice.better(runs_actions());
    if (better) {
        role_->due.arm(std::max(better->at, runtime().on().now()));
    } else {
        role_->due.disarm();
    }
}

task<> peer_channel::move(std::shared_ptr<peer_channel> self) {
    struct leaving {
        peer_channel& of;
        ~leaving() {
            of.moving_ = false;
            if (!of.runtime().on().abandoned()) of.consider_moving();
        }
    } guard{*self};
    auto& runtime = self->runtime();
    auto now = runtime.on().now();
    std::optional<role_choice::change> wanted;
    if (self->role_) wanted = self->role_->choice.better(self->runs_actions());
    if (!wanted || wanted->at > now) co_return;
    auto made = co_await self->reach(wanted->to, self->connect_time_, time_point::max());
    if (!made) {
        runtime.log().debug("a better member is not reached",
                            {{"role", self->name_}, {"member", wanted->to.path}, {"cause", made.error().message()}});
        if (self->role_) self->role_->choice.put_off(wanted->to.path, runtime.on().now());
        co_return;
    }
    // Meanwhile the present one may have been lost, or the better one.
    std::optional<role_choice::change> still;
    if (self->role_ && self->connected()) still = self->role_->choice.better(self->runs_actions());
    if (still && still->to.path == wanted->to.path && (*made)->open()) {
        self->switch_to(std::move(*made), wanted->to);
    } else {
        (*made)->finish(failure(errc::cancelled, "is not needed any more"), std::chrono::seconds(1));
    }
}

void peer_channel::switch_to(std::shared_ptr<session> made, const location& member) {
    loop::turn in(runtime().on());
    auto old = std::exchange(session_, nullptr);
    runtime().log().info("goes on with a better member of a role",
                         {{"role", name_}, {"from", old->peer_name()}, {"to", made->peer_name()}});
    failure moved(errc::peer_lost, fmt::format("'{}' is served by a better member", name_));
    for (auto* subscriber : std::vector(subscribers_)) {
        old->subscriptions().unsubscribe(*subscriber, subscriber->farewell(), {});
        subscriber->on_session_end(moved);
    }
    role_->choice.took(member);
    adopt(std::move(made));
    auto name = "farewell to " + old->peer_name();
    runtime().scope().spawn(std::move(name), retire(std::move(old)));
}

// Calls that were written to it are answered there.
task<> peer_channel::retire(std::shared_ptr<session> old) {
    auto& on = old->on();
    while (old->open() && old->calls().pending() > 0) co_await sleep_for(on, drain_period);
    if (old->open()) old->finish(failure(errc::cancelled, "a better member is there"), std::chrono::seconds(1));
}

} // namespace ise
