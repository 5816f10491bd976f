#include <ise/core/verified_peer.hpp>
#include <ise/transport/datagram_stream.hpp>
#include <ise/transport/sealed_stream.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/subject.hpp>
#include <ise/transport/udp/certified.hpp>
#include <ise/transport/udp/port.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

namespace ise::net::udp {
namespace {

endpoint with_kind(endpoint at, protocol kind) {
    at.kind = kind;
    return at;
}
endpoint below(endpoint at) { return with_kind(std::move(at), protocol::udp); }
endpoint certified(endpoint at) { return with_kind(std::move(at), transports::udp_tls); }

// The user's end of an association.
class stream_end : public datagram_stream {
public:
    explicit stream_end(std::shared_ptr<association> over) : over_(std::move(over)), peer_(over_->peer().text()) {}
    ~stream_end() override { over_->leave(); }

    bool deliver_to(stream_reader& reader) override {
        over_->deliver_to(reader);
        return false; // reading waits for the end
    }
    task<transfer> read_some(asio::mutable_buffer into) override { return read(over_, into); }
    transfer try_write(std::span<const asio::const_buffer> from) override { return over_->write(from); }
    task<std::error_code> wait_writable() override { return wait(over_); }
    void limit_unsent(std::size_t most) override { over_->limit_unsent(most); }
    void shutdown_write() override { over_->shutdown_write(); }
    void close() override { over_->leave(); }
    std::string peer() const override { return peer_; }
    std::optional<failure> verdict() const override { return over_->verdict(); }

    void use(std::weak_ptr<user> receiver) override { over_->use(std::move(receiver)); }
    bool show_sign() noexcept override { return over_->show_sign(); }
    std::size_t bytes_held() const noexcept override { return over_->channel().bytes_held(); }
    std::uint64_t max_message_bytes() const noexcept override { return wire::max_datagram_message_bytes; }
    bool wanted() noexcept override { return over_->message_wanted(); }
    void put(std::uint64_t key, const wire::frame_header& header, bytes_view head,
             const shared_bytes& payload) override {
        over_->put_message(key, header, head, payload);
    }
    void forget(std::uint64_t key) noexcept override { over_->forget_messages(key); }

private:
    static task<transfer> read(std::shared_ptr<association> from, asio::mutable_buffer into) {
        for (;;) {
            auto got = from->read(into);
            if (got) co_return *got;
            co_await from->wait_readable();
        }
    }
    static task<std::error_code> wait(std::shared_ptr<association> over) {
        while (over->writable() == asio::error::would_block) co_await over->wait_writable();
        co_return over->writable();
    }

    std::shared_ptr<association> over_;
    std::string peer_;
};

class sealed_end final : public stream_end, public sealed_stream {
public:
    using stream_end::stream_end;
};

class certified_end final : public stream_end, public verified_stream {
public:
    explicit certified_end(std::shared_ptr<association> over)
        : stream_end(over), over_(std::move(over)), peer_(certified(over_->peer()).text()) {}

    std::string peer() const override { return peer_; }
    void add_verified(verified_peer& to) const override {
        const auto* whom = over_->shown();
        if (!whom) return;
        to.certificate = whom->identity;
        to.serial = whom->serial;
        to.chain = whom->chain;
    }

private:
    std::shared_ptr<association> over_;
    std::string peer_;
};

// By what the channels of a row are sealed.
port_security credentials_for(const endpoint& at, security with) {
    port_security made;
    if (at.kind == transports::udp_tls) made.tls = std::move(with.tls);
    else made.key = std::move(with.key);
    return made;
}

std::unique_ptr<stream> make_end(std::shared_ptr<association> over, const port_security& with) {
    if (with.tls) return std::make_unique<certified_end>(std::move(over));
    if (with.key && with.key->seals()) return std::make_unique<sealed_end>(std::move(over));
    return std::make_unique<stream_end>(std::move(over));
}

class udp_listener final : public listener {
public:
    udp_listener(std::shared_ptr<port> at, port_security with) : port_(std::move(at)), with_(std::move(with)) {}
    ~udp_listener() override { port_->close(); }

    task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() override { return next(port_, with_); }
    void close() override { port_->stop_listening(); }
    endpoint where() const override { return with_.tls ? certified(port_->where()) : port_->where(); }

private:
    static task<std::pair<std::error_code, std::unique_ptr<stream>>> next(std::shared_ptr<port> at,
                                                                          port_security with) {
        std::pair<std::error_code, std::unique_ptr<stream>> outcome;
        for (;;) {
            if (auto opened = at->accepted()) {
                outcome.second = make_end(std::move(opened), with);
                co_return outcome;
            }
            outcome.first = at->closed() ? std::error_code(asio::error::operation_aborted) : at->take_problem();
            if (outcome.first) co_return outcome;
            auto woken = co_await at->changed();
            outcome.first = woken.problem;
            if (outcome.first) co_return outcome;
        }
    }

    std::shared_ptr<port> port_;
    port_security with_;
};

// From a socket of one family of addresses. `problem`: what stood in the way, if the failure has a cause of that kind.
task<result<std::unique_ptr<stream>>> connect_from(loop& on, endpoint to, std::string any_host,
                                                   std::error_code& problem, port_security with) {
    endpoint any;
    any.kind = protocol::udp;
    any.host = std::move(any_host);
    auto opened = on.env().open_datagram(on, any);
    if (!opened) co_return opened.error();
    auto socket = std::make_shared<port>(on, std::move(*opened), false, with);
    struct leaving { // an attempt that was given up leaves nothing
        port& of;
        bool done = false;
        ~leaving() {
            if (!done) of.close();
        }
    } guard{*socket};
    auto refused = [&](const std::error_code& why) {
        problem = why;
        return failure(errc::unreachable, fmt::format("cannot connect to {}: {}", to.text(), why.message()));
    };
    auto asked = socket->dial(below(to));
    if (asked && asked != asio::error::would_block) co_return refused(asked);
    while (!socket->opened() || !socket->opened()->settled()) {
        if (auto broken = socket->take_problem()) co_return refused(broken);
        if (socket->closed()) co_return refused(asio::error::connection_reset);
        auto woken = co_await socket->changed();
        if (woken.problem) co_return failure(errc::cancelled, "connecting was cancelled");
    }
    if (auto why = socket->opened()->verdict())
        co_return failure(why->code(), fmt::format("{}: {}", to.text(), why->message()));
    guard.done = true;
    auto made = make_end(socket->opened(), with);
    co_return made;
}

// A datagram_stream to whoever answers at `to`, asked again and again until then: the caller sets the limit.
task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to, security given) {
    auto with = credentials_for(to, std::move(given));
    const bool literal_6 = to.host.find(':') != std::string::npos;
    const std::string any_6 = "::", first = literal_6 ? any_6 : "0.0.0.0";
    std::error_code problem;
    auto made = co_await connect_from(on, to, first, problem, with);
    if (made || literal_6 || problem != asio::error::host_not_found) co_return made;
    // A name without an IPv4 address may have others. What the first look-up said stays true where there is no IPv6.
    auto other = co_await connect_from(on, to, any_6, problem, with);
    if (other) co_return other;
    co_return made;
}

// After `close()` of the listener, `accept` goes on serving the streams that it gave, and completes when the last of
// them has gone.
result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at, security given) {
    auto opened = on.env().open_datagram(on, below(at));
    if (!opened) return opened.error();
    auto with = credentials_for(at, std::move(given));
    auto made = std::make_shared<port>(on, std::move(*opened), true, with);
    return std::unique_ptr<listener>(std::make_unique<udp_listener>(std::move(made), std::move(with)));
}

failure no_identity(const endpoint& at) {
    return {errc::invalid_argument, fmt::format("{} takes a certificate of this side: give the folder with ca.pem, "
                                                "certificate.pem and key.pem with --tls FOLDER or ISE_TLS",
                                                at.text())};
}

// Checks that the certificate shown is valid and for `to.host`. That the other side refuses the certificate of this one
// is known at the first read only.
task<result<std::unique_ptr<stream>>> connect_certified(loop& on, endpoint to, security with) {
    if (!with.tls) co_return no_identity(to);
    auto made = co_await connect(on, std::move(to), std::move(with));
    co_return made;
}

result<std::unique_ptr<listener>> listen_certified(loop& on, const endpoint& at, security with) {
    if (!with.tls) return no_identity(at);
    return listen(on, at, std::move(with));
}

} // namespace
} // namespace ise::net::udp

namespace ise {

constinit const transport transports::udp{
    .scheme = "udp",
    .example = "udp://127.0.0.1:7400",
    .rank = 100,
    .lossy = true,
    .needs_descriptors = false,
    .connect = net::udp::connect,
    .listen = net::udp::listen,
};

constinit const transport transports::udp_tls{
    .scheme = "udp+tls",
    .example = "udp+tls://boat.local:7400",
    .rank = 100,
    .lossy = true,
    .encrypted = true,
    .needs_certificates = true,
    .needs_descriptors = false,
    .connect = net::udp::connect_certified,
    .listen = net::udp::listen_certified,
};

} // namespace ise
