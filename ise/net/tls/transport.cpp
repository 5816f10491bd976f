#include <ise/net/tls/transport.hpp>

#include <ise/net/tls/stream.hpp>

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

} // namespace

task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to, std::shared_ptr<identity> with) {
    auto made = co_await on.env().connect(on, below(to));
    if (!made) co_return made.error();
    auto secured = co_await greet(on, std::move(*made), std::move(with), std::move(to));
    co_return secured;
}

result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at, std::shared_ptr<identity> with) {
    auto made = on.env().listen(on, below(at));
    if (!made) return made.error();
    return std::unique_ptr<listener>(std::make_unique<tls_listener>(on, std::move(*made), std::move(with)));
}

} // namespace ise::net::tls
