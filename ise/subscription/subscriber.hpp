#pragma once
#include <ise/packet/codec.hpp>
#include <ise/subscription/received.hpp>
#include <ise/subscription/subscriber_core.hpp>

#include <memory>
#include <optional>
#include <utility>

namespace ise {

template <class Contract>
class subscriber;

/// What `subscriber::next()` awaits; the subscriber outlives it, or is destroyed while it waits. Converts to
/// `ise::task`.
template <class Contract>
class [[nodiscard]] next_packet final : public awaiter {
    using core = typename subscriber<Contract>::core;
    using value = received<typename Contract::packet_type>;

public:
    explicit next_packet(const std::shared_ptr<core>& of) noexcept : of_(of) {}

    bool await_ready() { return of_->decode_front() || of_->ended(); }
    template <class Promise>
    void await_suspend(std::coroutine_handle<Promise> coroutine) {
        waiting_.emplace(core::next(of_)).await_suspend(coroutine);
    }
    value await_resume() { return waiting_ ? waiting_->await_resume() : of_->take_front(); }
    void cancel() override {} // the coroutine that waits is on the stack

    operator task<value>() && { return core::next(of_); }

private:
    const std::shared_ptr<core>& of_;
    std::optional<detail::task_awaiter<value>> waiting_;
};

/// A live subscription: packets in the order in which they were published. It recovers automatically when the session
/// or the provider is lost; it ends when the provider ends it, or when this object is destroyed, which unsubscribes.
/// Used on its component's loop by one coroutine at a time. Move-only. Functions of an empty one, such as a member that
/// is not assigned yet, throw errc::invalid_argument.
template <class Contract>
class subscriber {
    using packet_type = typename Contract::packet_type;
    using response_type = typename Contract::subscribe_response;

public:
    subscriber() = default;
    /// Whether it is a subscription, live or ended; false for a default-constructed or moved-from one.
    explicit operator bool() const noexcept { return core_ != nullptr; }
    /// Takes the subscription over.
    subscriber(subscriber&&) noexcept = default;
    /// The same; a subscription that was held before is ended.
    subscriber& operator=(subscriber&& other) noexcept {
        if (core_ && core_ != other.core_) core_->unsubscribe();
        core_ = std::move(other.core_);
        return *this;
    }
    ~subscriber() {
        if (core_) core_->unsubscribe();
    }

    /// Waits for the next packet; empty when the subscription has ended (`cause()` says why).
    /// Cancellation: terminal, no packet is lost.
    next_packet<Contract> next() { return next_packet<Contract>(held()); }

    /// A packet that has already arrived, or an empty one. Never suspends.
    received<packet_type> try_next() {
        auto& from = *held();
        return from.decode_front() ? from.take_front() : received<packet_type>();
    }

    /// The provider's response to the subscription.
    const response_type& response() const { return held()->response; }
    /// Counts of received and lost packets so far.
    const subscription_counts& counts() const { return held()->counts(); }
    /// Whether the provider is connected now; false while the connection is being restored.
    bool connected() const { return held()->connected(); }
    /// Whether it has ended: `next()` returns the remaining packets, then empty ones.
    bool ended() const { return held()->ended(); }
    /// Only where `ended()`.
    const failure& cause() const { return held()->cause(); }
    /// Ends it now; a waiting `next()` returns an empty packet. The provider gets a default unsubscribe packet.
    void unsubscribe() { held()->unsubscribe(); }
    /// The same with an unsubscribe packet: returns the provider's response, waiting for it at most `deadline` (zero:
    /// the component's default). Throws ise::error: peer_lost (not executed: the provider is unreachable), timed_out,
    /// handler_failed, and `cause()` if it had ended before; the subscription ends in any case. Cancellation: terminal.
    /// With g++ 12, `request` must be a named variable.
    task<typename Contract::unsubscribe_response> unsubscribe(typename Contract::unsubscribe_request request,
                                                              duration deadline = duration()) {
        return core::leave_with(held(), std::move(request), deadline);
    }

    class core;
    /// Made by `remote::subscribe`.
    explicit subscriber(std::shared_ptr<core> made) : core_(std::move(made)) {}

private:
    const std::shared_ptr<core>& held() const {
        if (!core_) subscriber_core::throw_empty();
        return core_;
    }

    std::shared_ptr<core> core_;
};

/// The same, so that `ise::subscriber<decltype(position)>` can be a member: the constant of a service is const.
template <class Contract>
class subscriber<const Contract> : public subscriber<Contract> {
public:
    subscriber() = default;
    /// What `subscribe` gave.
    subscriber(subscriber<Contract>&& made) noexcept : subscriber<Contract>(std::move(made)) {}
};

template <class Contract>
class subscriber<Contract>::core final : public subscriber_core {
public:
    using subscriber_core::subscriber_core;

    static task<received<packet_type>> next(std::shared_ptr<core> self) {
        while (!self->decode_front() && !self->ended()) co_await self->wait_for_packet();
        co_return self->take_front();
    }

    static task<typename Contract::unsubscribe_response> leave_with(std::shared_ptr<core> self,
                                                                    typename Contract::unsubscribe_request request,
                                                                    duration deadline) {
        auto raw = encode(request);
        auto leaving = self->subscriber_core::leave_with(std::move(raw), deadline);
        auto answer = co_await std::move(leaving);
        typename Contract::unsubscribe_response response{};
        if (!answer.value().empty()) decode_into(response, answer.value());
        co_return response;
    }

    /// Whether there is a packet to take: decodes the oldest one, and drops those that cannot be decoded.
    bool decode_front() {
        while (!queue_.empty()) {
            try {
                if constexpr (travels_as_object<packet_type>) {
                    auto waiting = queue_.front();
                    shared_ = waiting.template shared<packet_type>();
                    if (!shared_) decode_into(*unheld(), waiting.bytes_to_decode());
                } else {
                    decode_into(*unheld(), queue_.front_bytes());
                }
                return true;
            } catch (const error& unreadable) {
                drop_undecodable(unreadable);
            }
        }
        return false;
    }

    /// The packet that was decoded. Empty where the subscription has ended and there is none.
    received<packet_type> take_front() {
        if (queue_.empty()) return {};
        if constexpr (travels_as_object<packet_type>)
            if (shared_) return received<packet_type>(std::exchange(shared_, {}), take_packet());
        return received<packet_type>(cells_[0], take_packet());
    }

    response_type response{};

private:
    void take_response(bytes_view raw) override {
        if (!raw.empty()) decode_into(response, raw);
    }

    bool knows_type() const noexcept override { return travels_as_object<packet_type>; }

    // Where the next packet is decoded: into one that nobody holds any more, with the memory that it has, or a new one.
    counted<packet_type>& unheld() {
        if (cells_[0] && cells_[0].alone()) return cells_[0];
        std::swap(cells_[0], cells_[1]); // who assigns the next packet to the last one holds two
        if (!cells_[0] || !cells_[0].alone()) cells_[0] = counted<packet_type>::make();
        return cells_[0];
    }

    counted<packet_type> cells_[2]; // the first one holds what was decoded last
    counted<packet_type> shared_;   // in its place, where the publisher is in this process
};

} // namespace ise
