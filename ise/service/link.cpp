#include <ise/service/link.hpp>

#include <ise/core/sleep.hpp>
#include <ise/net/connect.hpp>
#include <ise/service/back_off.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>
#include <ise/service/subscriber_core.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {
namespace {

// A session that lived this long was a good one: the next try begins without delay.
constexpr duration steady_session = std::chrono::seconds(5);
constexpr std::size_t max_waiting_calls = 100'000;

} // namespace

link::link(service_host& host, std::string path, std::optional<endpoint> fixed)
    : host_(host), path_(std::move(path)), fixed_(std::move(fixed)), name_(fixed_ ? fixed_->text() : path_),
      pause_(host.env(), host.options().first_back_off, host.options().longest_back_off), connect_time_(host.options().connect_time) {}

link::link(service_host& host, const std::shared_ptr<session>& peer)
    : host_(host), name_(peer->peer_name()), session_(peer),
      pause_(host.env(), host.options().first_back_off, host.options().longest_back_off), connect_time_(host.options().connect_time), peer_only_(true) {}

link::~link() {
    // Nobody talks to the peer over it any more; a peer that made the session itself keeps it.
    if (session_ && session_->open() && !peer_only_ && !host_.on().abandoned()) session_->finish(failure(errc::cancelled, "nothing more to say"), std::chrono::seconds(1));
}

void link::hurry(duration longest_pause, duration connect_time) noexcept {
    pause_.limit(longest_pause);
    connect_time_ = std::min(connect_time_, connect_time);
}

void link::submit(pending_call& call, function_ref<void(buffer&)> write_request) {
    call.owner = shared_from_this();
    if (call.deadline <= host_.on().now()) {
        host_.calls().fail(call, failure(errc::timed_out, fmt::format("'{}' at {} was called after its deadline", call.service, name_)));
        return;
    }
    call.alarm.arm(call.deadline);
    try {
        if (session_ && session_->open()) {
            if (session_->send(call, write_request)) return;
            host_.calls().fail(call, failure(errc::overloaded, fmt::format("too many calls are pending at {}", name_)));
            return;
        }
        if (host_.stopping() || peer_only_) {
            auto why = peer_only_ ? failure(errc::peer_lost, fmt::format("the session with {} has ended", name_))
                                  : failure(errc::cancelled, "the component stops");
            host_.calls().fail(call, why);
            return;
        }
        if (waiting_.size() >= max_waiting_calls) {
            host_.calls().fail(call, failure(errc::overloaded, fmt::format("{} calls wait for a session with {}", waiting_.size(), name_)));
            return;
        }
        write_request(call.waiting);
    } catch (const error& thrown) {
        host_.calls().fail(call, thrown.why());
        return;
    }
    call.sent_on = nullptr;
    waiting_.push_back(&call);
    wake();
}

void link::requeue(pending_call& call, bytes_view request) {
    call.sent_on = nullptr;
    call.waiting.clear();
    call.waiting.append(request);
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
                      fmt::format("no session with {}{}{}", name_, late ? " in time" : "", obstacle_.empty() ? "" : ": " + obstacle_));
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
    bool pause = false;
    if (self->since_ != time_point{}) { // again: what broke at once is not tried again at once
        pause = true;
        if (host.on().now() - self->since_ >= steady_session) self->pause_.reset();
    }
    for (;;) {
        if (pause) co_await sleep_for(host.on(), self->pause_.next());
        if (!self->wanted() || host.stopping()) co_return;
        pause = true;
        auto made = co_await self->establish();
        if (made) {
            self->adopt(std::move(*made));
            if (self->session_) co_return;
            continue; // it broke at its first frames
        }
        bool news = self->obstacle_ != made.error().message();
        self->obstacle_ = made.error().message();
        if (news) host.log().debug(self->obstacle_, {{"link", self->name_}});
    }
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
    session_ = std::move(made);
    since_ = host_.on().now();
    obstacle_.clear();
    for (auto* arrival : arrivals_) arrival->resume();
    for (auto* subscriber : std::vector(subscribers_)) session_->subscribe(*subscriber);
    for (auto* call : std::exchange(waiting_, {})) {
        buffer request = std::move(call->waiting);
        call->waiting = buffer();
        try {
            bool sent = session_->send(*call, [&](buffer& out) { out.append(request.view()); });
            if (!sent) host_.calls().fail(*call, failure(errc::overloaded, fmt::format("too many calls are pending at {}", name_)));
        } catch (const error& thrown) {
            host_.calls().fail(*call, thrown.why());
        }
    }
}

void link::stop() {
    failure why(errc::cancelled, "the component stops");
    for (auto* arrival : arrivals_) arrival->resume();
    for (auto* call : std::exchange(waiting_, {})) host_.calls().fail(*call, why);
}

task<result<std::shared_ptr<session>>> link::establish() {
    location where;
    if (fixed_) {
        where.endpoints.push_back(*fixed_);
    } else {
        auto* names = host_.resolver();
        if (!names) co_return failure(errc::invalid_argument, fmt::format("'{}' is a name, and this component was given no name server", path_));
        auto found = co_await names->resolve(path_);
        if (!found) co_return found.error();
        where = std::move(*found);
    }
    std::string tried;
    failure last(errc::unreachable, fmt::format("{} has no endpoint that can be reached from here", name_));
    for (const auto& at : where.endpoints) {
        auto deadline = saturating_add(host_.on().now(), connect_time_);
        // The stream is connected under the same deadline as the greeting.
        auto transport = co_await net::connect_until(host_.on(), at, deadline);
        if (!transport) {
            last = transport.error();
        } else {
            auto hello = host_.greeting();
            hello.wanted_path = where.path;
            hello.wanted_epoch = where.epoch;
            hello.wanted_incarnation = where.incarnation;
            auto greeted = co_await net::initiate(host_.on(), std::move(*transport), std::move(hello), deadline);
            if (greeted) co_return host_.run(std::move(*greeted), weak_from_this());
            last = greeted.error();
        }
        tried += fmt::format("{}{}", tried.empty() ? "" : "; ", last.message());
    }
    co_return failure(last.code(), tried.empty() ? last.message() : tried);
}

void link::on_session_end(session& ended, const failure& cause) {
    if (session_.get() != &ended) return;
    session_.reset();
    obstacle_ = cause.message();
    if (host_.stopping()) {
        stop();
    } else if (wanted()) {
        wake();
    }
}

} // namespace ise
