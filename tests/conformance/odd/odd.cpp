#include "odd.hpp"

#include <ise/core/loop.hpp>
#include <ise/core/transport.hpp>

#include <asio/buffer.hpp>

#include <array>

namespace conformance {
namespace {

using ise::endpoint, ise::loop, ise::result, ise::stream, ise::task, ise::transfer;

// The sizes of its pieces, one after the other.
class odd_sizes {
public:
    std::size_t next() noexcept { return all[at_++ % all.size()]; }

private:
    static constexpr std::array<std::size_t, 6> all{1, 7, 61, 509, 4093, 16381};
    std::size_t at_ = 0;
};

extern const ise::transport odd_row;

endpoint with_kind(endpoint at, ise::protocol kind) {
    at.kind = kind;
    return at;
}

class odd_stream final : public stream {
public:
    explicit odd_stream(std::unique_ptr<stream> below) : below_(std::move(below)) {}

    task<transfer> read_some(asio::mutable_buffer into) override {
        return below_->read_some(asio::buffer(into, reads_.next()));
    }
    transfer try_write(std::span<const asio::const_buffer> from) override {
        transfer made;
        if (++writes_ % 5 == 0) {
            made.problem = asio::error::would_block;
            return made;
        }
        auto left = sizes_.next();
        for (const auto& one : from) {
            auto piece = asio::buffer(one, left);
            if (piece.size() == 0) continue;
            auto wrote = below_->try_write(std::span(&piece, 1));
            made.bytes += wrote.bytes;
            left -= wrote.bytes;
            if (made.bytes == 0) made.problem = wrote.problem;
            if (wrote.problem || wrote.bytes < piece.size() || left == 0) break;
        }
        return made;
    }
    task<std::error_code> wait_writable() override { return below_->wait_writable(); }
    void limit_unsent(std::size_t most) override { below_->limit_unsent(most); }
    void shutdown_write() override { below_->shutdown_write(); }
    void close() override { below_->close(); }
    std::string peer() const override {
        auto text = below_->peer();
        return "odd" + text.substr(std::min(text.find("://"), text.size()));
    }
    std::optional<endpoint> local() const override {
        auto here = below_->local();
        if (here) here->kind = odd_row;
        return here;
    }

private:
    std::unique_ptr<stream> below_;
    odd_sizes reads_, sizes_;
    std::size_t writes_ = 0;
};

class odd_listener final : public ise::listener {
public:
    explicit odd_listener(std::unique_ptr<ise::listener> below) : below_(std::move(below)) {}

    task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() override {
        auto [problem, came] = co_await below_->accept();
        std::unique_ptr<stream> accepted;
        if (came) accepted = std::make_unique<odd_stream>(std::move(came));
        co_return std::pair(problem, std::move(accepted));
    }
    void close() override { below_->close(); }
    endpoint where() const override { return with_kind(below_->where(), odd_row); }

private:
    std::unique_ptr<ise::listener> below_;
};

task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to, ise::security) {
    auto below = with_kind(std::move(to), ise::protocol::tcp);
    auto made = co_await on.env().connect(on, std::move(below));
    if (!made) co_return made.error();
    std::unique_ptr<stream> connected = std::make_unique<odd_stream>(std::move(*made));
    co_return connected;
}

result<std::unique_ptr<ise::listener>> listen(loop& on, const endpoint& at, ise::security) {
    auto made = on.env().listen(on, with_kind(at, ise::protocol::tcp));
    if (!made) return made.error();
    return std::unique_ptr<ise::listener>(std::make_unique<odd_listener>(std::move(*made)));
}

constinit const ise::transport odd_row{
    .scheme = "odd",
    .example = "odd://127.0.0.1:7400",
    .connect = connect,
    .listen = listen,
};

const bool added = (ise::add_transport(odd_row), true);

} // namespace

odd::odd() : real_world(of_streams("odd://127.0.0.1:0", "tcp://127.0.0.1:0")) {}
virtual_odd::virtual_odd()
    : virtual_world(of_streams("odd://10.0.0.1:7400", "tcp://10.0.0.1:7500"), {"clean", 11, 0, 0, 0}) {}

} // namespace conformance
