#include <ise/service/peer_sessions.hpp>

#include <ise/access/guard.hpp>
#include <ise/core/listed_waiter.hpp>
#include <ise/net/connect.hpp>
#include <ise/net/handshake.hpp>
#include <ise/transport/tls/identity.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

peer_sessions::peer_sessions(const session_context& shared, security credentials)
    : shared_(shared), credentials_(std::move(credentials)) {}

// On a loop that was abandoned they have not ended, and somebody may still hold one; their places belong to the
// acceptor.
peer_sessions::~peer_sessions() {
    for (const auto& [raw, held] : all_) held->let_go();
}

wire::hello peer_sessions::greeting() const {
    const auto& options = shared_.runtime.options();
    wire::hello made;
    made.features = wire::feature::all;
    made.self = shared_.runtime.self();
    made.accepts = options.accepts;
    made.accepts.max_calls = options.max_calls_per_session;
    made.accepts.max_subscriptions = options.max_subscriptions_per_session;
    return made;
}

// The same in each session with the same life of a provider, and another one for every other provider: none of them can
// show another one what it was told.
std::uint64_t peer_sessions::reply_key_for(const location& whom, const endpoint& at) {
    auto& env = shared_.runtime.env();
    if (!reply_secret_) reply_secret_ = net::udp::secret{env.random(), env.random()};
    buffer text(64);
    text.append(whom.incarnation);
    text.append(as_bytes(whom.incarnation != 0 ? whom.path : at.text()));
    return net::udp::keyed_hash(*reply_secret_, text.view()) | 1; // 0 says that there is none
}

wire::hello peer_sessions::greeting_to(const location& whom, const endpoint& at, const std::string& connected) {
    auto made = greeting();
    made.wanted_path = whom.path;
    made.wanted_epoch = whom.epoch;
    made.wanted_incarnation = whom.incarnation;
    if (at.kind->lossy) made.reply_key = reply_key_for(whom, at);
    if (!credentials_.key) return made;
    made.dialled.push_back(connected);
    if (at.text() != connected) made.dialled.push_back(at.text());
    made.host_key = shared_.runtime.env().identity().host_key;
    return made;
}

task<result<std::shared_ptr<session>>> peer_sessions::connect(location whom, endpoint at, time_point deadline,
                                                              std::weak_ptr<session_owner> owner) {
    auto& on = shared_.runtime.on();
    if (credentials_.access && !at.kind->same_process)
        if (auto broken = credentials_.access->broken()) co_return std::move(*broken);
    auto transport = co_await net::connect_until(on, at, deadline, credentials_);
    if (!transport) co_return transport.error();
    auto hello = greeting_to(whom, at, (*transport)->peer());
    auto greeted =
        co_await net::initiate(on, std::move(*transport), std::move(hello), deadline, credentials_.key.get());
    if (!greeted) co_return greeted.error();
    if (auto impostor = objection_to_name((*greeted)->terms().peer)) {
        (*greeted)->close(*impostor);
        co_return std::move(*impostor);
    }
    co_return run(std::move(*greeted), std::move(owner));
}

std::optional<failure> peer_sessions::objection_to_name(const net::session_peer& peer) const {
    if (!credentials_.access || peer.verified.same_process || peer.path.empty()) return {};
    auto known = peer.verified;
    known.who = access::identity_of(known, credentials_.own, credentials_.access->current().get());
    const std::string named[] = {peer.path};
    access::request what;
    what.what = access::action::name;
    what.targets = named;
    const auto& here = shared_.runtime.self().path;
    auto denied = credentials_.access->objection(&known, what, here, false);
    if (denied) (void)credentials_.access->objection(&known, what, here, true); // only a refusal is news
    return denied;
}

std::shared_ptr<session> peer_sessions::run(std::shared_ptr<net::connection> connection,
                                            std::weak_ptr<session_owner> owner) {
    connection->limit_unsent(shared_.runtime.options().unsent_bytes);
    shared_.runtime.signs()->add(connection->signs());
    auto made = std::make_shared<session>(shared_, std::move(connection), std::move(owner),
                                          [this](session& ended) { forget(ended); });
    all_.emplace(made.get(), made);
    made->start();
    return made;
}

void peer_sessions::forget(session& ended) {
    auto found = all_.find(&ended);
    if (found == all_.end()) return;
    // Its coroutines are on their way out; it goes when they and its calls have let go.
    auto last = std::move(found->second);
    all_.erase(found);
    ended.let_go();
    shared_.runtime.on().later([last = std::move(last)] {});
    if (all_.empty())
        for (auto* result : awaiting_end_) result->resume();
}

// Not by their addresses in memory: a run on the virtual world is the same every time.
std::vector<std::shared_ptr<session>> peer_sessions::in_order() const {
    std::vector<std::shared_ptr<session>> all;
    for (const auto& [raw, held] : all_) all.push_back(held);
    std::ranges::stable_sort(all, [](const auto& a, const auto& b) { return a->peer_name() < b->peer_name(); });
    return all;
}

void peer_sessions::review_access() {
    for (auto& one : in_order()) one->review_access(); // some may end meanwhile
}

void peer_sessions::end_revoked() {
    if (!credentials_.tls) return;
    for (auto& one : in_order()) {
        const auto& peer = one->verified();
        if (peer.chain.empty() || !credentials_.tls->revoked(shared_.runtime.env(), peer.chain)) continue;
        one->revoke(failure(errc::unauthorized, fmt::format("the certificate of {} (serial {}) was revoked",
                                                            access::shown(peer.who), peer.serial)));
    }
}

void peer_sessions::finish_all(const failure& why, duration grace) {
    for (auto& held : in_order()) held->finish(why, grace);
}

task<> peer_sessions::ended(time_point limit) {
    auto& on = shared_.runtime.on();
    listed_waiter result(on, awaiting_end_);
    timer late(on, [&result] { result.resume(); });
    late.arm(limit);
    if (!all_.empty()) co_await result.wait();
}

} // namespace ise
