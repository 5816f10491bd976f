#include <ise/core/inproc.hpp>

#include <ise/core/inproc_stream.hpp>
#include <ise/core/waiter.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <deque>

namespace ise {

// What stands behind a name, shared by the listener, its coroutine and whoever connects just now.
class inproc_acceptor {
public:
    using accepted = std::pair<std::error_code, std::unique_ptr<stream>>;

    inproc_acceptor(loop& owner, std::string listens_on)
        : incoming(owner), name(std::move(listens_on)), loop_(owner), gate_(owner.gate()) {}

    // From any thread.
    result<std::unique_ptr<stream>> connect(loop& from, const std::shared_ptr<inproc_acceptor>& self) {
        std::unique_lock held(mutex_);
        if (closed_) return failure(errc::unreachable, fmt::format("nothing listens on inproc://{}", name));
        if (backlog_.size() >= inproc_registry::backlog)
            return failure(errc::overloaded, fmt::format("inproc://{} has {} connections that it did not accept yet",
                                                         name, backlog_.size()));
        auto [near, far] = make_inproc_pair(from, loop_, "inproc://" + name);
        backlog_.push_back(std::move(far));
        const bool wake = std::exchange(waits_, false);
        held.unlock();
        if (wake)
            gate_->post([weak = std::weak_ptr(self)] {
                if (auto acceptor = weak.lock()) acceptor->incoming.resume();
            });
        return std::move(near);
    }

    accepted take() { // would_block: nothing yet, and the acceptor will be woken
        std::lock_guard held(mutex_);
        if (closed_) return {asio::error::operation_aborted, nullptr};
        if (backlog_.empty()) {
            waits_ = true;
            return {asio::error::would_block, nullptr};
        }
        auto first = std::move(backlog_.front());
        backlog_.pop_front();
        return {std::error_code{}, std::move(first)};
    }

    void close() {
        std::deque<std::unique_ptr<stream>> refused; // closed outside of the lock
        {
            std::lock_guard held(mutex_);
            closed_ = true;
            refused.swap(backlog_);
        }
        refused.clear();
        incoming.resume({asio::error::operation_aborted});
    }

    struct woken { // not std::error_code: Asio would throw it
        std::error_code problem;
    };
    waiter<woken> incoming;
    const std::string name;

private:
    loop& loop_;
    std::shared_ptr<loop_gate> gate_;
    std::mutex mutex_;
    std::deque<std::unique_ptr<stream>> backlog_;
    bool closed_ = false;
    bool waits_ = false;
};

namespace {

class inproc_listener final : public listener {
public:
    inproc_listener(std::shared_ptr<inproc_acceptor> acceptor, std::function<void()> withdraw)
        : acceptor_(std::move(acceptor)), withdraw_(std::move(withdraw)) {}
    ~inproc_listener() override { close(); }

    task<inproc_acceptor::accepted> accept() override { return next(acceptor_); }

    void close() override {
        if (auto withdraw = std::exchange(withdraw_, nullptr)) withdraw();
        acceptor_->close();
    }

    endpoint where() const override {
        endpoint at;
        at.kind = protocol::inproc;
        at.path = acceptor_->name;
        return at;
    }

private:
    static task<inproc_acceptor::accepted> next(std::shared_ptr<inproc_acceptor> acceptor) {
        for (;;) {
            auto taken = acceptor->take();
            if (taken.first != asio::error::would_block) co_return taken;
            auto woken = co_await acceptor->incoming.wait();
            if (woken.problem) {
                inproc_acceptor::accepted ended{woken.problem, nullptr};
                co_return ended;
            }
        }
    }

    std::shared_ptr<inproc_acceptor> acceptor_;
    std::function<void()> withdraw_;
};

} // namespace

inproc_registry::inproc_registry() : table_(std::make_shared<table>()) {}
inproc_registry::~inproc_registry() = default;

result<std::unique_ptr<listener>> inproc_registry::listen(loop& on, const std::string& name) {
    if (name.empty()) return failure(errc::invalid_argument, "an in-process endpoint needs a name: inproc://name");
    std::lock_guard held(table_->mutex);
    auto& entry = table_->names[name];
    if (!entry.expired())
        return failure(errc::address_in_use, fmt::format("inproc://{} is taken in this process", name));
    auto acceptor = std::make_shared<inproc_acceptor>(on, name);
    entry = acceptor;
    return std::unique_ptr<listener>(
        std::make_unique<inproc_listener>(acceptor, [names = table_, name, weak = std::weak_ptr(acceptor)] {
            std::lock_guard lock(names->mutex);
            auto found = names->names.find(name);
            if (found != names->names.end() && !found->second.owner_before(weak) && !weak.owner_before(found->second))
                names->names.erase(found);
        }));
}

result<std::unique_ptr<stream>> inproc_registry::connect(loop& on, const std::string& name) {
    std::shared_ptr<inproc_acceptor> acceptor;
    {
        std::lock_guard held(table_->mutex);
        auto found = table_->names.find(name);
        if (found != table_->names.end()) acceptor = found->second.lock();
    }
    if (!acceptor)
        return failure(errc::unreachable, fmt::format("nothing listens on inproc://{} in this process", name));
    return acceptor->connect(on, acceptor);
}

} // namespace ise
