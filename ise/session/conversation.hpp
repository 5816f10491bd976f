#pragma once
#include <ise/core/function_ref.hpp>
#include <ise/core/transport.hpp>
#include <ise/net/connection.hpp>
#include <ise/session/contract.hpp>
#include <ise/session/schema_exchange.hpp>
#include <ise/session/service_runtime.hpp>

#include <memory>
#include <optional>
#include <string>
#include <string_view>

namespace ise {

namespace access {
class view;
}

/// Whether `peer` is the instantiation server that made the process of this component, which is the one that starts
/// others in it: one without a path. It is of the same user, and could kill the process as well; no policy is asked.
bool of_its_maker(const service_runtime& runtime, const verified_peer& peer);

/// What everything that two components say to each other over one connection shares: the connection, who the peer is,
/// and the schemas that both sides agree on. Calls and subscriptions are parts above it, which `session` puts together.
class conversation : public net::connection::user, public std::enable_shared_from_this<conversation> {
public:
    conversation(const conversation&) = delete;
    conversation& operator=(const conversation&) = delete;

    service_runtime& runtime() const noexcept { return runtime_; }
    loop& on() const noexcept { return runtime_.on(); }
    net::connection& wire() const noexcept { return *connection_; }
    bool open() const noexcept { return connection_->open(); }
    const std::string& peer_name() const noexcept { return connection_->peer_name(); }
    /// The peer as a caller or subscriber, for people: one without a name shows none of this side's addresses.
    std::string caller_name() const;
    const net::session_peer& peer() const noexcept { return connection_->terms().peer; }
    /// Who the peer is, as far as this side has verified it.
    const verified_peer& verified() const noexcept { return peer().verified; }
    /// What the access policy has against the peer's use of a service of this side, as a failure for the peer; with
    /// `note` that is a line of the audit log. Nothing: it is allowed, or there is no policy.
    std::optional<failure> objection_to_use(service_kind kind, const std::string& service, bool note);
    /// Whether each use of that service is a line of the audit log.
    bool audited(const std::string& service) const;
    void note_use(service_kind kind, const std::string& service);
    schema_exchange& schemas() noexcept { return schemas_; }

    /// Why the peer does not accept a frame whose body has so many bytes; `what` has them, for people.
    std::optional<failure> too_large(std::string_view what, std::size_t size) const;
    /// Sends a frame in line with calls and replies.
    void send(wire::frame_type type, std::uint8_t flags, std::uint64_t id, function_ref<void(buffer&)> write_body);
    /// Sends a frame that overtakes calls, replies and packets.
    void send_ahead(wire::frame_type type, std::uint64_t id, function_ref<void(buffer&)> write_body);
    /// Whether so much waits that `replies_not_taken` has to be asked.
    bool replies_wait() const noexcept { return connection_->out().pending_call_bytes() > host_memory::free_bytes; }
    /// Why the peer gets no further reply, as a failure for it: it, or its host, does not take those that wait, without
    /// the last `besides` bytes.
    std::optional<failure> replies_not_taken(execution state, std::size_t besides = 0);
    /// errc::overloaded where the peer does not take its answers: each further frame that is answered makes it worse.
    result<void> takes_answers();
    /// errc::too_large where the unfinished messages of the peer's host hold more than `unfinished_bytes`.
    result<void> messages_fit();

    /// Ends it, saying why.
    void finish(failure why, duration grace) { connection_->finish(std::move(why), grace); }

protected:
    conversation(service_runtime& runtime, std::shared_ptr<net::connection> connection);
    ~conversation();

    /// The policy has changed: what it has against the session as such.
    std::optional<failure> objection_to_session();

private:
    service_runtime& runtime_;
    std::shared_ptr<net::connection> connection_;
    schema_exchange schemas_;
    std::shared_ptr<host_memory> counted_in_; // once it held much for its peer
    std::unique_ptr<access::view> view_;      // of the policy by the peer; once it was asked for
    const transport* const over_; // of a peer without a name; null: it has one, or the transport is not known
};

/// Why a peer's introduction of a service cannot be taken, by the limit's name; the session ends over it.
std::optional<failure> objection_to(const wire::introduction& result);

} // namespace ise
