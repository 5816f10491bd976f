// How a link to a role follows its members and moves between them.
#include <ise/service/peer_channel.hpp>

#include <ise/core/sleep.hpp>
#include <ise/service/role_state.hpp>

#include <fmt/format.h>

namespace ise {
namespace {

// How often a session that was left is looked at whether its last calls have been answered.
constexpr duration drain_period = std::chrono::milliseconds(20);

} // namespace

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

void peer_channel::consider_moving() {
    if (!role_ || moving_) return;
    std::optional<role_choice::change> better;
    if (session_ && session_->open() && !runtime().stopping()) better = role_->choice.better();
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
    if (self->role_) wanted = self->role_->choice.better();
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
    if (self->role_ && self->session_ && self->session_->open()) still = self->role_->choice.better();
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
