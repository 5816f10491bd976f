#include <ise/service/session_acceptor.hpp>

#include <ise/access/guard.hpp>
#include <ise/core/real/room_for_sockets.hpp>
#include <ise/net/bounded_acceptor.hpp>
#include <ise/net/handshake.hpp>
#include <ise/net/relayed.hpp>
#include <ise/session/conversation.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise {
namespace {

constexpr duration displaced_grace = std::chrono::seconds(1); // to take the goodbye

} // namespace

session_acceptor::session_acceptor(service_runtime& runtime, peer_sessions& sessions)
    : runtime_(runtime), sessions_(sessions), places_(runtime.options().max_sessions),
      handshakes_(runtime.options().max_handshakes) {}

class session_acceptor::door final : public net::gatekeeper {
public:
    door(session_acceptor& of, endpoint reached, std::string peer)
        : of_(of), reached_(std::move(reached)), peer_(std::move(peer)) {}

    result<wire::welcome> admit(const wire::hello& caller) override {
        if (of_.sessions_.credentials().key)
            if (auto relayed = net::objection_to_way(caller, reached_, of_.advertised_, of_.runtime_.env()))
                return std::move(*relayed);
        if (auto denied = of_.objection(caller, caller_)) return std::move(*denied);
        return of_.admit(caller, peer_, reached_.kind, places_);
    }
    void note(const verified_peer& caller) override { caller_ = caller; }
    session_places take_places() { return std::move(places_); }

private:
    session_acceptor& of_;
    endpoint reached_;
    std::string peer_;
    verified_peer caller_;
    session_places places_;
};

std::optional<failure> session_acceptor::objection(const wire::hello& caller, const verified_peer& as) const {
    const auto& policy = sessions_.credentials().access;
    if (!policy || as.same_process) return {};
    if (auto broken = policy->broken())
        return failure(broken->code(), fmt::format("at {}, {}", runtime_.name_for_people(), broken->message()));
    if (of_its_maker(runtime_, as)) return {};
    net::session_peer peer(caller.self);
    peer.verified = as;
    return sessions_.objection_to_name(peer);
}

result<wire::welcome> session_acceptor::admit(const wire::hello& caller, const std::string& peer, protocol over,
                                              session_places& into) {
    const auto& self = runtime_.self();
    auto me = runtime_.name_for_people();
    if (!caller.wanted_path.empty() && caller.wanted_path != self.path)
        return failure(errc::wrong_peer, fmt::format("here is {}, not '{}'", me, caller.wanted_path));
    if (caller.wanted_incarnation != 0 && caller.wanted_incarnation != self.incarnation)
        return failure(errc::wrong_peer, fmt::format("here is another life of {}: it was restarted", me));
    if (caller.wanted_epoch != 0 && self.epoch != 0 && caller.wanted_epoch != self.epoch)
        return failure(errc::wrong_peer,
                       fmt::format("{} has epoch {} here, {} was wanted", me, self.epoch, caller.wanted_epoch));
    if (runtime_.stopping()) return failure(errc::cancelled, fmt::format("{} stops", me));
    if (paused_) return *paused_;
    if (over->needs_descriptors && sockets_) {
        auto taken = place_for(peer, *sockets_);
        if (!taken) return taken.error();
        into.socket = std::move(*taken);
    }
    if (!over->same_process) {
        auto taken = place_for(peer, places_);
        if (!taken) return taken.error();
        into.session = std::move(*taken);
    }
    auto mine = sessions_.greeting();
    wire::welcome made;
    made.features = mine.features;
    made.self = mine.self;
    made.accepts = mine.accepts;
    return made;
}

result<endpoint> session_acceptor::listen(const endpoint& at) {
    auto may = sessions_.credentials().may_listen(at);
    if (!may) return may.error();
    auto opened = at.kind->listen(runtime_.on(), at, sessions_.credentials());
    if (!opened) return opened.error();
    if (at.kind->needs_descriptors && !sockets_)
        sockets_.emplace(runtime_.env().is_virtual() ? runtime_.options().max_sessions
                                                     : room_for_sockets(runtime_.options().max_sessions));
    std::shared_ptr<listener> from = std::move(*opened);
    listeners_.push_back(from);
    if (!held_) accept_from(from);
    return from->where();
}

void session_acceptor::accept_from(const std::shared_ptr<listener>& from) {
    auto tell = [this](const std::string& what, const std::string& at) {
        runtime_.tell(peer_trouble::accepting, what, at);
    };
    runtime_.scope().spawn(
        "listener on " + from->where().text(),
        net::accept_each(runtime_.on(), from, &handshakes_, tell,
                         [this, raw = from.get()](net::admitted who) { take(std::move(who), raw->where()); }));
}

void session_acceptor::begin() {
    if (!std::exchange(held_, false)) return;
    for (const auto& from : listeners_) accept_from(from);
}

std::vector<endpoint> session_acceptor::listening() const {
    std::vector<endpoint> where;
    for (const auto& entry : listeners_) where.push_back(entry->where());
    return where;
}

void session_acceptor::take(net::admitted who, const endpoint& at) {
    if (runtime_.stopping()) return;
    if (who.refused || greeting_ >= 2 * runtime_.options().max_handshakes) { // those beyond are on their way out yet
        ++runtime_.counts().sessions_rejected;
        return; // closes it
    }
    auto peer = who.line->peer();
    auto reached = who.line->local().value_or(at);
    handshake_place held = std::move(who.place); // it may be over at once
    auto* cancel =
        runtime_.scope().spawn("handshake with " + peer, greet(std::move(who.line), std::move(reached), held));
    if (runtime_.scope().stopping() || !cancel) return;
    held->on_displaced([this, cancel, host = net::host_of(peer)] {
        // Else there are no descriptors, which the listener has told.
        bool full = handshakes_.taken() + 1 >= handshakes_.most();
        runtime_.tell(
            peer_trouble::crowded,
            fmt::format("{}, most from {}: the oldest of these make way",
                        full ? fmt::format("{} handshakes at once (max_handshakes)", handshakes_.most())
                             : fmt::format("{} handshakes hold file descriptors of which none are left (ulimit -n)",
                                           handshakes_.taken() + 1),
                        host),
            host);
        cancel->cancel();
    });
}

task<> session_acceptor::greet(std::unique_ptr<stream> stranger, endpoint reached, handshake_place place) {
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
    auto deadline = saturating_add(runtime_.on().now(), runtime_.options().connect_time);
    result<std::shared_ptr<net::connection>> made = failure(errc::cancelled, "the handshake was cancelled");
    try {
        made = co_await net::respond(runtime_.on(), std::move(stranger), gate, deadline,
                                     sessions_.credentials().key.get());
    } catch (const std::exception& thrown) {
        if (!is_cancellation(std::current_exception())) made = failure(errc::io_failed, thrown.what());
    }
    if (!made) {
        ++runtime_.counts().sessions_rejected;
        if (runtime_.scope().stopping()) co_return;
        auto code = made.error().code();
        bool strange = place->displaced() || broke_rules(code) || code == errc::timed_out ||
                       code == errc::unauthorized || code == errc::access_denied || code == errc::invalid_argument ||
                       code == errc::io_failed;
        auto cause = place->displaced() ? fmt::format("{} had not greeted when its place was needed", peer)
                                        : made.error().message();
        runtime_.tell(strange ? peer_trouble::handshake : peer_trouble::rejected,
                      fmt::format("a session was not made: {}", cause), peer);
        co_return;
    }
    ++runtime_.counts().sessions_accepted;
    auto begun = sessions_.run(std::move(*made), {});
    keep_places(*begun, gate.take_places());
}

std::string session_acceptor::session_limit(const net::fair_places& all) const {
    return fmt::format("{} sessions{} are allowed ({})", all.most(), &all == &places_ ? "" : " over connections",
                       all.most() == runtime_.options().max_sessions ? "max_sessions"
                                                                     : "the limit of open files, ulimit -n");
}

result<std::unique_ptr<net::fair_places::place>> session_acceptor::place_for(const std::string& peer,
                                                                             net::fair_places& all) const {
    auto taken = all.take(peer);
    if (!taken)
        return failure(errc::overloaded,
                       fmt::format("{} at {}, and no host has more of them than {}", session_limit(all),
                                   runtime_.name_for_people(), net::host_of(peer)));
    taken->serve();
    return taken;
}

// Its places are kept by the session, and so their functions need not own it.
void session_acceptor::keep_places(session& of, session_places held) {
    if (!sessions_.all().contains(&of)) return;                 // over already
    bool lost_socket = held.socket && held.socket->displaced(); // during the handshake
    bool lost_session = held.session && held.session->displaced();
    if (lost_socket || lost_session) return make_way(of, lost_socket ? *sockets_ : places_);
    if (held.socket) held.socket->on_displaced([this, &of] { make_way(of, *sockets_); });
    if (held.session) held.session->on_displaced([this, &of] { make_way(of, places_); });
    of.keep(std::make_shared<session_places>(std::move(held)));
}

void session_acceptor::make_way(session& which, const net::fair_places& all) {
    which.let_go();
    const auto host = net::host_of(which.verified().from);
    const auto limit = session_limit(all);
    runtime_.tell(peer_trouble::excess,
                  fmt::format("{}, {} has most: the oldest of these make way for other hosts", limit, host), host);
    which.finish(failure(errc::overloaded,
                         fmt::format("{}, of which {} has most: its place was needed for another host", limit, host)),
                 displaced_grace);
}

void session_acceptor::close() {
    for (auto& entry : listeners_) entry->close();
}

} // namespace ise
