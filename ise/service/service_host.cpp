#include <ise/service/service_host.hpp>

#include <ise/core/real/room_for_sockets.hpp>
#include <ise/net/bounded_acceptor.hpp>
#include <ise/net/connect.hpp>
#include <ise/net/relayed.hpp>
#include <ise/service/publication_core.hpp>
#include <ise/service/session.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

namespace {

constexpr duration displaced_grace = std::chrono::seconds(1); // to take the goodbye

// Not by their addresses in memory: a run on the virtual world is the same every time.
std::vector<std::shared_ptr<session>> in_order(const std::map<session*, std::shared_ptr<session>>& all) {
    std::vector<std::shared_ptr<session>> made;
    for (const auto& [raw, held] : all) made.push_back(held);
    std::stable_sort(made.begin(), made.end(), [](const auto& a, const auto& b) { return a->peer_name() < b->peer_name(); });
    return made;
}

} // namespace

service_host::service_host(environment& env, loop& on, task_scope& scope, wire::identity self, service_options options, logger log, security credentials)
    : env_(env), on_(on), scope_(scope), self_(std::move(self)), options_(options), log_(std::move(log)), uses_(*this), calls_(on), dispatcher_(schemas_),
      places_(options_.max_sessions), handshakes_(options_.max_handshakes), credentials_(std::move(credentials)) {}

service_host::~service_host() { resolver_.reset(); }

wire::hello service_host::greeting() const {
    wire::hello made;
    made.features = wire::feature::all;
    made.self = self_;
    made.accepts = options_.accepts;
    made.accepts.max_calls = options_.max_calls_per_session;
    made.accepts.max_subscriptions = options_.max_subscriptions_per_session;
    return made;
}

// The same in each session with the same life of a provider, and another one for every other provider: none of them can
// show another one what it was told.
std::uint64_t service_host::reply_key_for(const location& whom, const endpoint& at) {
    if (!reply_secret_) reply_secret_ = net::udp::secret{env_.random(), env_.random()};
    buffer text(64);
    text.append(whom.incarnation);
    text.append(as_bytes(whom.incarnation != 0 ? whom.path : at.text()));
    return net::udp::keyed_hash(*reply_secret_, text.view()) | 1; // 0 says that there is none
}

wire::hello service_host::greeting_to(const location& whom, const endpoint& at, const std::string& connected) {
    auto made = greeting();
    made.wanted_path = whom.path;
    made.wanted_epoch = whom.epoch;
    made.wanted_incarnation = whom.incarnation;
    if (at.kind == protocol::udp) made.reply_key = reply_key_for(whom, at);
    if (!credentials_.key) return made;
    made.dialled.push_back(connected);
    if (at.text() != connected) made.dialled.push_back(at.text());
    made.host_key = env_.identity().host_key;
    return made;
}

class service_host::door final : public net::gatekeeper {
public:
    door(service_host& of, endpoint reached, std::string peer) : of_(of), reached_(std::move(reached)), peer_(std::move(peer)) {}

    result<wire::welcome> admit(const wire::hello& caller) override {
        if (of_.credentials_.key)
            if (auto relayed = net::objection_to_way(caller, reached_, of_.advertised_, of_.env_)) return std::move(*relayed);
        return of_.admit(caller, peer_, reached_.kind, places_);
    }
    session_places take_places() { return std::move(places_); }

private:
    service_host& of_;
    endpoint reached_;
    std::string peer_;
    session_places places_;
};

result<wire::welcome> service_host::admit(const wire::hello& caller, const std::string& peer, protocol over, session_places& into) {
    auto me = self_.path.empty() ? "an unnamed component" : fmt::format("'{}'", self_.path);
    if (!caller.wanted_path.empty() && caller.wanted_path != self_.path)
        return failure(errc::wrong_peer, fmt::format("here is {}, not '{}'", me, caller.wanted_path));
    if (caller.wanted_incarnation != 0 && caller.wanted_incarnation != self_.incarnation)
        return failure(errc::wrong_peer, fmt::format("here is another life of {}: it was restarted", me));
    if (caller.wanted_epoch != 0 && self_.epoch != 0 && caller.wanted_epoch != self_.epoch)
        return failure(errc::wrong_peer, fmt::format("{} has epoch {} here, {} was wanted", me, self_.epoch, caller.wanted_epoch));
    if (stopping_) return failure(errc::cancelled, fmt::format("{} stops", me));
    if (paused_) return *paused_;
    const bool has_socket = over != protocol::udp && over != protocol::inproc;
    if (has_socket && sockets_) {
        auto taken = place_for(peer, *sockets_);
        if (!taken) return taken.error();
        into.socket = std::move(*taken);
    }
    if (over != protocol::inproc) {
        auto taken = place_for(peer, places_);
        if (!taken) return taken.error();
        into.session = std::move(*taken);
    }
    auto mine = greeting();
    wire::welcome made;
    made.features = mine.features;
    made.self = mine.self;
    made.accepts = mine.accepts;
    return made;
}

result<endpoint> service_host::listen(const endpoint& at) {
    auto may = credentials_.may_listen(at);
    if (!may) return may.error();
    auto opened = net::listen(on_, at, credentials_.tls);
    if (!opened) return opened.error();
    bool with_sockets = at.kind != protocol::udp && at.kind != protocol::inproc;
    if (with_sockets && !sockets_) sockets_.emplace(env_.is_virtual() ? options_.max_sessions : room_for_sockets(options_.max_sessions));
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
    net::bounded_acceptor entrance(on_, from, &handshakes_,
                                   [this](const std::string& what, const std::string& at) { tell(peer_trouble::accepting, what, at); });
    while (!stopping_) {
        auto who = co_await entrance.next();
        if (stopping_ || !who.line) co_return;
        if (who.refused || greeting_ >= 2 * options_.max_handshakes) { // those beyond are on their way out yet
            ++counts_.sessions_rejected;
            continue; // closes it
        }
        auto peer = who.line->peer();
        auto reached = who.line->local().value_or(from->where());
        handshake_place held = std::move(who.place); // it may be over at once
        auto* cancel = scope_.spawn("handshake with " + peer, greet(std::move(who.line), std::move(reached), held));
        if (scope_.stopping()) co_return;
        if (!cancel) continue;
        held->on_displaced([this, cancel, host = net::host_of(peer)] {
            bool full = handshakes_.taken() + 1 >= handshakes_.most(); // else there are no descriptors, which the listener has told
            tell(peer_trouble::crowded,
                 fmt::format("{}, most from {}: the oldest of these make way",
                             full ? fmt::format("{} handshakes at once (max_handshakes)", handshakes_.most())
                                  : fmt::format("{} handshakes hold file descriptors of which none are left (ulimit -n)", handshakes_.taken() + 1),
                             host),
                 host);
            cancel->emit(asio::cancellation_type::terminal);
        });
    }
}

void service_host::tell(peer_trouble kind, std::string_view what, std::string_view peer) {
    auto left_out = troubles_[static_cast<std::size_t>(kind)].admit(on_.now());
    if (!left_out) return;
    auto level = kind == peer_trouble::rejected ? log_level::info : log_level::warning;
    log_.write(level, what, {{"peer", std::string(peer)}, {"left_out", std::to_string(*left_out)}});
}

void service_host::on_subscription_ended(const std::string& service, const std::string& provider, const failure& why) {
    constexpr std::size_t most = 16;
    tell(peer_trouble::over, fmt::format("the subscription to '{}' has ended: {}", service, why.message()), provider);
    on_subscribed(service, provider);
    if (ended_subscriptions_.size() >= most) ended_subscriptions_.pop_front();
    ended_subscription ended;
    ended.service = service;
    ended.provider = provider;
    ended.cause = why.message();
    ended_subscriptions_.push_back(std::move(ended));
}

void service_host::on_subscribed(const std::string& service, const std::string& provider) {
    std::erase_if(ended_subscriptions_, [&](const auto& one) { return one.service == service && one.provider == provider; });
}

task<> service_host::greet(std::unique_ptr<stream> stranger, endpoint reached, handshake_place place) {
    struct leaving {
        std::size_t& count;
        handshake_place& mine;
        ~leaving() {
            --count;
            mine.reset();
        }
    } guard{++greeting_, place};
    auto peer = stranger->peer();
    door gate(*this, std::move(reached), peer);
    auto deadline = saturating_add(on_.now(), options_.handshake_time);
    result<std::shared_ptr<net::connection>> made = failure(errc::cancelled, "the handshake was cancelled");
    try {
        made = co_await net::respond(on_, std::move(stranger), gate, deadline, credentials_.key.get());
    } catch (const std::exception& thrown) {
        if (!is_cancellation(std::current_exception())) made = failure(errc::io_failed, thrown.what());
    }
    if (!made) {
        ++counts_.sessions_rejected;
        if (scope_.stopping()) co_return;
        auto code = made.error().code();
        bool strange = place->displaced() || broke_rules(code) || code == errc::timed_out || code == errc::unauthorized || code == errc::invalid_argument || code == errc::io_failed;
        auto cause = place->displaced() ? fmt::format("{} had not greeted when its place was needed", peer) : made.error().message();
        tell(strange ? peer_trouble::handshake : peer_trouble::rejected, fmt::format("a session was not made: {}", cause), peer);
        co_return;
    }
    ++counts_.sessions_accepted;
    auto begun = run(std::move(*made), {});
    keep_places(begun, peer, gate.take_places());
}

std::string service_host::session_limit(const net::fair_places& all) const {
    return fmt::format("{} sessions{} are allowed ({})", all.most(), &all == &places_ ? "" : " over connections",
                       all.most() == options_.max_sessions ? "max_sessions" : "the limit of open files, ulimit -n");
}

result<std::unique_ptr<net::fair_places::place>> service_host::place_for(const std::string& peer, net::fair_places& all) const {
    auto taken = all.take(peer);
    if (!taken)
        return failure(errc::overloaded, fmt::format("{} at {}, and no host has more of them than {}", session_limit(all),
                                                     self_.path.empty() ? "an unnamed component" : fmt::format("'{}'", self_.path), net::host_of(peer)));
    taken->serve();
    return taken;
}

void service_host::keep_places(const std::shared_ptr<session>& of, const std::string& peer, session_places held) {
    if (!sessions_.contains(of.get())) return; // over already
    auto make_way = [this, whose = std::weak_ptr(of), host = net::host_of(peer)](const net::fair_places& all) {
        auto told = whose.lock();
        if (!told) return;
        held_places_.erase(told.get());
        auto limit = session_limit(all);
        tell(peer_trouble::excess, fmt::format("{}, {} has most: the oldest of these make way for other hosts", limit, host), host);
        told->finish(failure(errc::overloaded, fmt::format("{}, of which {} has most: its place was needed for another host", limit, host)), displaced_grace);
    };
    bool lost_socket = held.socket && held.socket->displaced(); // during the handshake
    bool lost_session = held.session && held.session->displaced();
    if (lost_socket || lost_session) return make_way(lost_socket ? *sockets_ : places_);
    if (held.socket) held.socket->on_displaced([this, make_way] { make_way(*sockets_); });
    if (held.session) held.session->on_displaced([this, make_way] { make_way(places_); });
    held_places_.emplace(of.get(), std::move(held));
}

std::shared_ptr<session> service_host::run(std::shared_ptr<net::connection> connection, std::weak_ptr<link> owner) {
    connection->limit_unsent(options_.unsent_bytes);
    signs_->add(connection->signs());
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
    held_places_.erase(&ended);
    on_.later([last = std::move(last)] {});
    if (sessions_.empty())
        for (auto* told : awaiting_sessions_end_) told->resume();
}

task<> service_host::sessions_ended(time_point limit) {
    waiter<> told(on_, [&told] { told.resume(); });
    timer late(on_, [&told] { told.resume(); });
    struct listed {
        std::vector<waiter<>*>& all;
        waiter<>* who;
        ~listed() { std::erase(all, who); }
    } among{awaiting_sessions_end_, &told};
    awaiting_sessions_end_.push_back(&told);
    late.arm(limit);
    if (!sessions_.empty()) co_await told.wait();
}

std::shared_ptr<link> service_host::link_to(const std::string& path, role_options how) {
    // No path has a blank.
    auto& known = links_[how.come_back ? fmt::format("{} {}", path, how.steady.count()) : path + " stay"];
    auto held = known.lock();
    if (!held) known = held = std::make_shared<link>(*this, path, std::nullopt, how);
    return held;
}

std::shared_ptr<link> service_host::link_to(const endpoint& at, const std::string& path) {
    auto& known = links_[path.empty() ? at.text() : fmt::format("{} {}", at.text(), path)];
    auto held = known.lock();
    if (!held) known = held = std::make_shared<link>(*this, path, at);
    return held;
}

void service_host::stop(duration grace) {
    if (std::exchange(stopping_, true)) return;
    uses_.stop();
    for (auto& entry : listeners_) entry->close();
    dispatcher_.stop();
    auto all = in_order(sessions_);
    for (auto& [name, known] : links_)
        if (auto held = known.lock()) held->stop();
    for (auto& held : all) held->finish(failure(errc::peer_lost, "the component stops"), grace);
}

void service_host::pause(const failure& why, duration grace) {
    paused_ = why;
    for (auto& held : in_order(sessions_)) held->finish(why, grace);
}

} // namespace ise
