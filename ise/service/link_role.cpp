// How a link to a role follows its members and moves between them.
#include <ise/service/link_role.hpp>

#include <ise/core/sleep.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>
#include <ise/service/subscriber_core.hpp>

#include <fmt/format.h>

namespace ise {
namespace {

// How often a session that was left is looked at whether its last calls have been answered.
constexpr duration drain_period = std::chrono::milliseconds(20);

} // namespace

link::role_state::role_state(link& owner, role_options how)
    : on(owner.host_.on()), choice(how), due(on, [&owner] {
          if (owner.moving_) return;
          owner.moving_ = owner.host_.scope().spawn("move of " + owner.name_, move(owner.shared_from_this())) != nullptr;
      }) {}

void link::role_state::on_loss(session& ended, const failure& cause) {
    due.disarm();
    auto heartbeat = duration(static_cast<std::int64_t>(ended.wire().terms().we_accept.heartbeat_ns));
    bool silent = on.now() - ended.wire().last_heard() >= heartbeat * 2;
    choice.lost(silent || cause.code() == errc::superseded);
}

std::string link::holder() const { return session_ ? session_->peer().path : std::string(); }

void link::on_members(const resolution& found) {
    if (host_.stopping()) return;
    take_members(found);
    if (!role_ || found.members.empty()) return;
    if (auto missing = role_->choice.unlisted()) host_.scope().spawn("question of " + name_, ask_about(shared_from_this(), std::move(*missing)));
}

// The member that is talked to is not told of any more. One whose lease is over is kept as long as its session lives; one
// that is registered still has left the role.
task<> link::ask_about(std::shared_ptr<link> self, location unlisted) {
    auto* names = self->host_.resolver();
    if (!names) co_return;
    auto found = co_await names->resolve(unlisted.path);
    if (!self->role_ || !found || found->role || found->members.front().incarnation != unlisted.incarnation) co_return;
    self->role_->choice.left(unlisted);
    self->consider_moving();
}

void link::take_members(const resolution& found) {
    if (!found.role) {
        forget_role();
        return;
    }
    if (!role_) {
        role_ = std::make_unique<role_state>(*this, how_);
        host_.resolver()->follow(path_, *this);
    }
    role_->choice.know(found.members, host_.on().now());
    consider_moving();
}

void link::forget_role() noexcept {
    if (!role_) return;
    if (auto* names = host_.resolver()) names->unfollow(path_, *this);
    role_.reset();
}

void link::consider_moving() {
    if (!role_ || moving_) return;
    std::optional<role_choice::change> better;
    if (session_ && session_->open() && !host_.stopping()) better = role_->choice.better();
    if (better) {
        role_->due.arm(std::max(better->at, host_.on().now()));
    } else {
        role_->due.disarm();
    }
}

task<> link::move(std::shared_ptr<link> self) {
    struct leaving {
        link& of;
        ~leaving() {
            of.moving_ = false;
            if (!of.host_.on().abandoned()) of.consider_moving();
        }
    } guard{*self};
    auto& host = self->host_;
    auto now = host.on().now();
    std::optional<role_choice::change> wanted;
    if (self->role_) wanted = self->role_->choice.better();
    if (!wanted || wanted->at > now) co_return;
    auto made = co_await self->reach(wanted->to, self->connect_time_, time_point::max());
    if (!made) {
        host.log().debug("a better member is not reached", {{"role", self->name_}, {"member", wanted->to.path}, {"cause", made.error().message()}});
        if (self->role_) self->role_->choice.put_off(wanted->to.path, host.on().now());
        co_return;
    }
    // Meanwhile the present one may have been lost, or the better one.
    std::optional<role_choice::change> still;
    if (self->role_ && self->session_ && self->session_->open()) still = self->role_->choice.better();
    if (still && still->to.path == wanted->to.path && (*made)->open()) {
        self->switch_to(std::move(*made), wanted->to);
    } else {
        (*made)->finish(failure(errc::cancelled, "is not needed any more"), std::chrono::seconds(1));
    }
}

void link::switch_to(std::shared_ptr<session> made, const location& member) {
    loop::turn in(host_.on());
    auto old = std::exchange(session_, nullptr);
    host_.log().info("goes on with a better member of a role", {{"role", name_}, {"from", old->peer_name()}, {"to", made->peer_name()}});
    failure moved(errc::peer_lost, fmt::format("'{}' is served by a better member", name_));
    for (auto* subscriber : std::vector(subscribers_)) {
        old->unsubscribe(*subscriber);
        subscriber->on_session_end(moved);
    }
    role_->choice.took(member);
    adopt(std::move(made));
    auto name = "farewell to " + old->peer_name();
    host_.scope().spawn(std::move(name), retire(std::move(old)));
}

// Calls that were written to it are answered there.
task<> link::retire(std::shared_ptr<session> old) {
    auto& on = old->host().on();
    while (old->open() && old->pending_calls() > 0) co_await sleep_for(on, drain_period);
    if (old->open()) old->finish(failure(errc::cancelled, "a better member is there"), std::chrono::seconds(1));
}

} // namespace ise
