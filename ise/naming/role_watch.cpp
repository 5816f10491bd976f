#include <ise/naming/role_watch.hpp>

#include <ise/core/sleep.hpp>

#include <optional>

namespace ise {
namespace {

// The server has refused, or ended the subscription: it is asked again after this.
constexpr duration pause_after_refusal = std::chrono::seconds(1);

} // namespace

struct role_watch::state {
    state(service_host& of, remote names, std::string what, std::function<void(const naming::role_members&)> tell)
        : host(of), server(std::move(names)), role(std::move(what)), on_news(std::move(tell)) {}

    service_host& host;
    remote server;
    std::string role;
    std::function<void(const naming::role_members&)> on_news;
    subscriber<subscription<naming::role_members, naming::role_request>> packets;
    bool subscribed = false;
    bool heard = false; // something, over the subscription that there is
    bool over = false;
};

role_watch::role_watch(service_host& host, remote server, std::string role,
                       std::function<void(const naming::role_members&)> on_news)
    : state_(std::make_shared<state>(host, std::move(server), std::move(role), std::move(on_news))) {
    host.scope().spawn("members of " + state_->role, run(state_));
}

role_watch::~role_watch() {
    state_->over = true;
    if (state_->subscribed && !state_->host.on().abandoned()) state_->packets.unsubscribe(); // which ends the coroutine
}

bool role_watch::current() const noexcept { return state_->heard && state_->packets.connected(); }

task<> role_watch::run(std::shared_ptr<state> self) {
    auto& on = self->host.on();
    while (!self->over) {
        naming::role_request request;
        request.role = self->role;
        auto options = subscribe_options::keep_latest();
        std::optional<failure> why;
        try {
            auto begun = co_await self->server.subscribe(naming::role_changes, request, options);
            if (self->over) co_return;
            self->packets = std::move(begun);
            self->subscribed = true;
        } catch (const error& refused) {
            why = refused.why();
        }
        while (!why) {
            auto packet = co_await self->packets.next();
            if (self->over) co_return;
            if (!packet) {
                why = self->packets.cause();
                break;
            }
            self->heard = true;
            self->on_news(*packet);
            if (self->over) co_return;
        }
        self->subscribed = self->heard = false;
        if (self->host.stopping()) co_return;
        self->host.log().debug(why->message(), {{"role", self->role}});
        co_await sleep_for(on, pause_after_refusal);
    }
}

} // namespace ise
