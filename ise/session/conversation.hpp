#pragma once
#include <ise/core/function_ref.hpp>
#include <ise/core/transport.hpp>
#include <ise/net/connection.hpp>
#include <ise/session/schema_exchange.hpp>
#include <ise/session/service_runtime.hpp>

#include <memory>
#include <optional>
#include <string>

namespace ise {

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
    schema_exchange& schemas() noexcept { return schemas_; }

    /// Sends a frame in line with calls and replies.
    void send(wire::frame_type type, std::uint8_t flags, std::uint64_t id, function_ref<void(buffer&)> write_body);
    /// Sends a frame that overtakes calls, replies and packets.
    void send_ahead(wire::frame_type type, std::uint64_t id, function_ref<void(buffer&)> write_body);
    /// errc::overloaded where the peer does not take its answers: each further frame that is answered makes it worse.
    result<void> takes_answers() const;

    /// Ends it, saying why.
    void finish(failure why, duration grace) { connection_->finish(std::move(why), grace); }

protected:
    conversation(service_runtime& runtime, std::shared_ptr<net::connection> connection)
        : runtime_(runtime), connection_(std::move(connection)),
          schemas_(runtime.schemas(), *connection_, runtime.options().session_bytes),
          over_(peer().path.empty() ? transport_of(peer_name()) : nullptr) {}
    ~conversation() = default;

private:
    service_runtime& runtime_;
    std::shared_ptr<net::connection> connection_;
    schema_exchange schemas_;
    const transport* const over_; // of a peer without a name; null: it has one, or the transport is not known
};

/// Why a peer's introduction of a service cannot be taken, by the limit's name; the session ends over it.
std::optional<failure> objection_to(const wire::introduction& told);

} // namespace ise
