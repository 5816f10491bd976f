// The relay of streams.
#include <support/relay_kinds.hpp>

#include <ise/core/task_scope.hpp>
#include <ise/core/waiter.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <algorithm>
#include <vector>

namespace ise_test {
namespace {

// A connection of the requester, and the one to the provider that goes on from there.
struct passage {
    std::unique_ptr<ise::stream> near, far;
    bool swallowed = false;

    void close() {
        near->close();
        if (far) far->close();
    }
};

class byte_relay final : public relay {
public:
    byte_relay(ise::environment& env, std::unique_ptr<ise::loop_host> host, const ise::endpoint& at, ise::endpoint to,
               std::size_t piece)
        : piece_(piece), env_(env), host_(std::move(host)), on_(host_->loop()), target_(std::move(to)),
          listener_(env.listen(on_, at).value()), scope_(on_, [](const std::string&, std::exception_ptr) {}) {
        scope_.spawn("accept", accept(*this));
    }
    ise::endpoint where() const override { return listener_->where(); }
    void hold() override { held_ = true; }
    void go_on() override {
        held_ = false;
        for (auto* one : std::exchange(stalled_, {})) one->resume();
    }
    void swallow() override {
        for (auto& one : passages_) one->swallowed = true;
    }
    void forget() override {
        for (auto& one : std::exchange(passages_, {})) one->close();
    }
    void roughen() override {}
    void stop() override {
        scope_.stop();
        listener_->close();
    }
    bool ended() const override { return scope_.size() == 0; }

private:
    static ise::task<> accept(byte_relay& of) {
        for (;;) {
            auto came = co_await of.listener_->accept();
            if (came.first == asio::error::operation_aborted) co_return;
            if (came.first) continue;
            auto made = std::make_shared<passage>();
            made->near = std::move(came.second);
            of.scope_.spawn("dial", dial(of, made));
        }
    }
    static ise::task<> dial(byte_relay& of, std::shared_ptr<passage> by) {
        if (of.held_) co_await of.healed();
        auto made = co_await of.env_.connect(of.on_, of.target_);
        if (!made) co_return; // nobody is there: the requester's connection ends with `by`
        by->far = std::move(*made);
        of.passages_.push_back(by);
        of.scope_.spawn("onwards", carry(of, by, by->near.get(), by->far.get()));
        of.scope_.spawn("back", carry(of, by, by->far.get(), by->near.get()));
    }
    static ise::task<> carry(byte_relay& of, std::shared_ptr<passage> by, ise::stream* from, ise::stream* to) {
        ise::bytes room(of.piece_);
        for (;;) {
            auto got = co_await from->read_some(asio::buffer(room));
            while (of.held_) co_await of.healed();
            if (by->swallowed && got.problem) co_return; // nor is the other end told
            if (by->swallowed) continue;
            if (got.problem == asio::error::eof) to->shutdown_write();
            else if (got.problem) by->close();
            if (got.problem) co_return;
            for (std::size_t sent = 0; sent < got.bytes;) {
                asio::const_buffer rest(room.data() + sent, got.bytes - sent);
                auto wrote = to->try_write(std::span(&rest, 1));
                sent += wrote.bytes;
                if (!wrote.problem) continue;
                auto broken = wrote.problem;
                if (broken == asio::error::would_block) broken = co_await to->wait_writable();
                if (!broken) continue;
                by->close();
                co_return;
            }
        }
    }
    ise::task<> healed() {
        ise::waiter<> over(on_);
        struct entry {
            std::vector<ise::waiter<>*>& all;
            ise::waiter<>* mine;
            ~entry() { std::erase(all, mine); }
        } guard{stalled_, &over};
        stalled_.push_back(&over);
        co_await over.wait();
    }

    std::size_t piece_;
    ise::environment& env_;
    std::unique_ptr<ise::loop_host> host_;
    ise::loop& on_;
    ise::endpoint target_;
    std::unique_ptr<ise::listener> listener_;
    std::vector<std::shared_ptr<passage>> passages_;
    std::vector<ise::waiter<>*> stalled_;
    bool held_ = false;
    ise::task_scope scope_;
};

} // namespace

std::unique_ptr<relay> make_byte_relay(ise::environment& env, std::unique_ptr<ise::loop_host> host,
                                       const ise::endpoint& at, const ise::endpoint& to, std::size_t piece) {
    return std::make_unique<byte_relay>(env, std::move(host), at, to, piece);
}

} // namespace ise_test
