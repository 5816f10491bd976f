#include <ise/transport/system_streams.hpp>

#include <ise/core/loop.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/tls/stream.hpp>

namespace ise::net {
namespace {

class sealing_listener final : public listener {
public:
    sealing_listener(loop& on, std::unique_ptr<listener> from, std::shared_ptr<const shared_key> with)
        : on_(on), from_(std::move(from)), with_(std::move(with)) {}

    task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() override {
        auto [problem, stranger] = co_await from_->accept();
        std::unique_ptr<stream> accepted;
        if (stranger) accepted = tls::answer(on_, std::move(stranger), with_);
        co_return std::pair(problem, std::move(accepted));
    }
    void close() override { from_->close(); }
    endpoint where() const override { return from_->where(); }

private:
    loop& on_;
    std::unique_ptr<listener> from_;
    std::shared_ptr<const shared_key> with_;
};

} // namespace

task<result<std::unique_ptr<stream>>> connect_by_environment(loop& on, endpoint to, security) {
    return on.env().connect(on, std::move(to));
}

result<std::unique_ptr<listener>> listen_by_environment(loop& on, const endpoint& at, security) {
    return on.env().listen(on, at);
}

task<result<std::unique_ptr<stream>>> connect_sealed(loop& on, endpoint to, security with) {
    auto made = co_await on.env().connect(on, to);
    if (!made) co_return made.error();
    auto sealed = co_await seal(on, std::move(*made), std::move(to), std::move(with));
    co_return sealed;
}

task<result<std::unique_ptr<stream>>> seal(loop& on, std::unique_ptr<stream> made, endpoint to, security with) {
    if (!with.key || !with.key->seals()) co_return std::move(made);
    auto sealed = co_await tls::greet(on, std::move(made), std::move(with.key), std::move(to));
    co_return sealed;
}

result<std::unique_ptr<listener>> listen_sealed(loop& on, const endpoint& at, security with) {
    auto made = on.env().listen(on, at);
    if (!made) return made;
    return seal(on, std::move(*made), std::move(with));
}

std::unique_ptr<listener> seal(loop& on, std::unique_ptr<listener> made, security with) {
    if (!with.key || !with.key->seals()) return made;
    return std::make_unique<sealing_listener>(on, std::move(made), std::move(with.key));
}

} // namespace ise::net
