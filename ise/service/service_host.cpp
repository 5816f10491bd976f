#include <ise/service/service_host.hpp>

#include <ise/core/sleep.hpp>
#include <ise/service/publication_core.hpp>
#include <ise/service/session.hpp>

#include <fmt/format.h>

namespace ise {

service_host::service_host(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options, logger log)
    : env_(env), on_(on), scope_(scope), self_(std::move(self)), options_(options), log_(std::move(log)), calls_(on), dispatcher_(schemas_) {}

service_host::~service_host() = default;

wire::hello service_host::greeting() const {
    wire::hello made;
    made.self = self_;
    made.accepts = options_.accepts;
    made.accepts.max_calls = options_.max_calls_per_session;
    made.accepts.max_subscriptions = options_.max_subscriptions_per_session;
    return made;
}

result<wire::welcome> service_host::admit(const wire::hello& caller) {
    auto me = self_.path.empty() ? "an unnamed component" : fmt::format("'{}'", self_.path);
    if (!caller.wanted_path.empty() && caller.wanted_path != self_.path)
        return failure(errc::wrong_peer, fmt::format("here is {}, not '{}'", me, caller.wanted_path));
    if (caller.wanted_incarnation != 0 && caller.wanted_incarnation != self_.incarnation)
        return failure(errc::wrong_peer, fmt::format("here is another life of {}: it was restarted", me));
    if (caller.wanted_epoch != 0 && self_.epoch != 0 && caller.wanted_epoch != self_.epoch)
        return failure(errc::wrong_peer, fmt::format("{} has epoch {} here, {} was wanted", me, self_.epoch, caller.wanted_epoch));
    if (stopping_) return failure(errc::cancelled, fmt::format("{} stops", me));
    if (paused_) return *paused_;
    if (sessions_.size() >= options_.max_sessions)
        return failure(errc::overloaded, fmt::format("{} has {} sessions, no more are allowed", me, sessions_.size()));
    auto mine = greeting();
    wire::welcome made;
    made.self = mine.self;
    made.accepts = mine.accepts;
    return made;
}

result<endpoint> service_host::listen(const endpoint& at) {
    auto opened = env_.listen(on_, at);
    if (!opened) return opened.error();
    std::shared_ptr<listener> from = std::move(*opened);
    listeners_.push_back(from);
    scope_.spawn("listener on " + from->where().text(), accept(from));
    return from->where();
}

std::vector<endpoint> service_host::listening() const {
    std::vector<endpoint> where;
    for (const auto& entry : listeners_) where.push_back(entry->where());
    return where;
}

task<> service_host::accept(std::shared_ptr<listener> from) {
    // Out of descriptors or memory: wait until something was freed, and say so once.
    bool complained = false;
    while (!stopping_) {
        auto [problem, stranger] = co_await from->accept();
        if (stopping_ || problem == asio::error::operation_aborted) co_return;
        if (problem) {
            if (!std::exchange(complained, true)) log_.error("cannot accept", {{"endpoint", from->where().text()}, {"cause", problem.message()}});
            co_await sleep_for(on_, std::chrono::milliseconds(100));
            continue;
        }
        complained = false;
        if (handshakes_ >= options_.max_handshakes) {
            ++counts_.sessions_rejected;
            log_.warning("too many handshakes at once", {{"peer", stranger->peer()}, {"max_handshakes", std::to_string(options_.max_handshakes)}});
            continue; // closes it
        }
        ++handshakes_;
        auto name = "handshake with " + stranger->peer();
        if (!scope_.spawn(std::move(name), greet(std::move(stranger)))) co_return;
    }
}

task<> service_host::greet(std::unique_ptr<stream> stranger) {
    struct leaving {
        std::size_t& count;
        ~leaving() { --count; }
    } guard{handshakes_};
    auto deadline = saturating_add(on_.now(), options_.handshake_time);
    auto made = co_await net::respond(on_, std::move(stranger), *this, deadline);
    if (!made) {
        ++counts_.sessions_rejected;
        log_.info("a session was not made", {{"cause", made.error().message()}});
        co_return;
    }
    ++counts_.sessions_accepted;
    run(std::move(*made), {});
}

std::shared_ptr<session> service_host::run(std::shared_ptr<net::connection> connection, std::weak_ptr<link> owner) {
    auto made = std::make_shared<session>(*this, std::move(connection), std::move(owner));
    sessions_.emplace(made.get(), made);
    made->start();
    return made;
}

void service_host::forget(session& ended) {
    auto found = sessions_.find(&ended);
    if (found == sessions_.end()) return;
    // Its coroutines are on their way out; it goes when they and its calls have let go.
    auto last = std::move(found->second);
    sessions_.erase(found);
    on_.later([last = std::move(last)] {});
}

std::shared_ptr<link> service_host::link_to(const std::string& path) {
    auto& known = links_[path];
    auto held = known.lock();
    if (!held) known = held = std::make_shared<link>(*this, path, std::nullopt);
    return held;
}

std::shared_ptr<link> service_host::link_to(const endpoint& at) {
    auto& known = links_[at.text()];
    auto held = known.lock();
    if (!held) known = held = std::make_shared<link>(*this, std::string(), at);
    return held;
}

void service_host::stop(duration grace) {
    if (std::exchange(stopping_, true)) return;
    for (auto& entry : listeners_) entry->close();
    dispatcher_.stop();
    auto all = sessions_;
    for (auto& [name, known] : links_)
        if (auto held = known.lock()) held->stop();
    for (auto& [raw, held] : all) held->finish(failure(errc::peer_lost, "the component stops"), grace);
}

void service_host::pause(const failure& why, duration grace) {
    paused_ = why;
    auto all = sessions_;
    for (auto& [raw, held] : all) held->finish(why, grace);
}

} // namespace ise
