#pragma once
#include <ise/packet/codec.hpp>
#include <ise/service/received.hpp>
#include <ise/service/subscriber_core.hpp>

#include <memory>
#include <optional>

namespace ise {

/// A live subscription: packets in the order in which they were published. It heals by itself when the session or
/// the provider is lost; it ends when the provider ends it, or when this object goes. Used on its component's loop by
/// one coroutine at a time. Move-only; dropping it unsubscribes.
template <class Contract>
class stream_of {
    using packet_type = typename Contract::packet_type;
    using response_type = typename Contract::subscribe_response;

public:
    stream_of() = default;
    stream_of(stream_of&&) noexcept = default;
    stream_of& operator=(stream_of&& other) noexcept {
        if (core_ && core_ != other.core_) core_->leave();
        core_ = std::move(other.core_);
        return *this;
    }
    ~stream_of() {
        if (core_) core_->leave();
    }

    /// The next packet; empty when the subscription has ended (`cause()` says why).
    /// Cancellation: terminal, no packet is lost.
    task<received<packet_type>> next() { return core::next(core_); }

    /// A packet that is there already, or an empty one. Never suspends.
    received<packet_type> try_next() { return core_->take(); }

    /// What the provider answered to the subscription.
    const response_type& response() const noexcept { return core_->response; }
    const subscription_counts& counts() const noexcept { return core_->counts(); }
    /// Whether the provider is reached now; false while the link heals.
    bool connected() const noexcept { return core_->connected(); }
    bool ended() const noexcept { return core_->ended(); }
    /// Only where `ended()`.
    const failure& cause() const noexcept { return core_->cause(); }
    /// Ends it now; waiting coroutines get the end.
    void leave() { core_->leave(); }

    class core;
    explicit stream_of(std::shared_ptr<core> made) : core_(std::move(made)) {}

private:
    std::shared_ptr<core> core_;
};

template <class Contract>
class stream_of<Contract>::core final : public subscriber_core {
public:
    using subscriber_core::subscriber_core;

    static task<received<packet_type>> next(std::shared_ptr<core> self) {
        while (self->queue_.empty() && !self->ended()) co_await self->wait_for_packet();
        co_return self->take();
    }

    received<packet_type> take() {
        if (!queue_.empty()) taken();
        return queue_.take();
    }

    response_type response{};

private:
    void push(bytes_view packet, const adapter* adapt, std::uint64_t lost_before) override {
        auto decoded = std::make_shared<packet_type>();
        if (adapt) {
            decode_into(*decoded, (*adapt)(packet));
        } else {
            decode_into(*decoded, packet);
        }
        queue_.push(std::move(decoded), lost_before);
    }
    std::size_t queued() const noexcept override { return queue_.size(); }
    std::uint64_t drop_oldest() override { return queue_.drop_oldest(); }
    void take_response(bytes_view raw) override {
        if (!raw.empty()) decode_into(response, raw);
    }

    received_queue<packet_type> queue_;
};

} // namespace ise
