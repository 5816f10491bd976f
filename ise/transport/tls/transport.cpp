#include <ise/core/environment.hpp>
#include <ise/transport/security.hpp>
#include <ise/transport/tls/stream.hpp>

#include <fmt/format.h>

namespace ise::net::tls {
namespace {

endpoint below(endpoint at) {
    at.kind = protocol::tcp;
    return at;
}

class tls_listener final : public listener {
public:
    tls_listener(loop& on, std::unique_ptr<listener> from, std::shared_ptr<identity> with)
        : on_(on), from_(std::move(from)), with_(std::move(with)) {}

    task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() override {
        auto [problem, stranger] = co_await from_->accept();
        std::unique_ptr<stream> accepted;
        if (stranger) accepted = answer(on_, std::move(stranger), with_);
        co_return std::pair(problem, std::move(accepted));
    }
    void close() override { from_->close(); }
    endpoint where() const override {
        auto at = from_->where();
        at.kind = protocol::tls;
        return at;
    }

private:
    loop& on_;
    std::unique_ptr<listener> from_;
    std::shared_ptr<identity> with_;
};

failure no_identity(const endpoint& at) {
    return {errc::invalid_argument, fmt::format("{} takes a certificate of this side: give the folder with ca.pem, "
                                                "certificate.pem and key.pem with --tls FOLDER or ISE_TLS",
                                                at.text())};
}

// Checks that the certificate shown is valid and for `to.host`. That the other side refuses the certificate of this one
// is known at the first read only.
task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to, security with) {
    if (!with.tls) co_return no_identity(to);
    auto made = co_await on.env().connect(on, below(to));
    if (!made) co_return made.error();
    auto secured = co_await greet(on, std::move(*made), std::move(with.tls), std::move(to));
    co_return secured;
}

// The streams accepted shake hands in their first read.
result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at, security with) {
    if (!with.tls) return no_identity(at);
    auto made = on.env().listen(on, below(at));
    if (!made) return made.error();
    return std::unique_ptr<listener>(std::make_unique<tls_listener>(on, std::move(*made), std::move(with.tls)));
}

} // namespace
} // namespace ise::net::tls

namespace ise {

constinit const transport transports::tls{
    .scheme = "tls",
    .example = "tls://boat.local:7400",
    .rank = 100,
    .encrypted = true,
    .needs_certificates = true,
    .connect = net::tls::connect,
    .listen = net::tls::listen,
};

} // namespace ise
