#pragma once
#include <ise/packet/codec.hpp>
#include <ise/subscription/publication_core.hpp>

#include <coroutine>
#include <functional>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

namespace ise {

/// Awaited by `publication::send()`, which has published at once where there was room; else it waits for room. The
/// publication outlives it. Converts to `ise::task`, which may outlive the publication.
class [[nodiscard]] send_packet final : public awaiter {
public:
    /// @cond
    send_packet() noexcept {} // published already; not `= default`: that would zero the whole of it first
    send_packet(const std::shared_ptr<publication_core>& to, published_packet&& packet) noexcept
        : waits_(std::in_place, to, std::move(packet)) {}

    bool await_ready() const noexcept { return !waits_; }
    template <class Promise>
    void await_suspend(std::coroutine_handle<Promise> coroutine) {
        waits_->going_on.emplace(publication_core::send_when_room(waits_->to, std::move(waits_->packet)))
            .await_suspend(coroutine);
    }
    void await_resume() const {
        if (waits_) waits_->going_on->await_resume();
    }
    void cancel() override {} // the coroutine that waits is on the stack

    operator task<>() && {
        return waits_ ? publication_core::send_when_room(waits_->to, std::move(waits_->packet)) : sent();
    }
    /// @endcond

private:
    struct waiting {
        waiting(const std::shared_ptr<publication_core>& on, published_packet&& made) noexcept
            : to(on), packet(std::move(made)) {}
        std::shared_ptr<publication_core> to;
        published_packet packet;
        std::optional<detail::task_awaiter<void>> going_on;
    };
    static task<> sent() { co_return; }
    std::optional<waiting> waits_;
};

/// A subscription service that this component provides. Calling it publishes a packet to all subscribers by their
/// policies, and never blocks. A value, cheap to copy; used on its component's loop. From another thread, such as the
/// callback of a driver: `gate->post([out, packet] { out(packet); })` with `auto gate = on().gate()` from the loop
/// (<ise/core/loop.hpp>). Functions of an empty one, such as a member that is not assigned yet, throw
/// errc::invalid_argument.
template <class Contract>
class publication {
    using packet_type = typename Contract::packet_type;

public:
    publication() = default;
    /// Made by `component::publish`.
    explicit publication(std::shared_ptr<publication_core> core) : core_(std::move(core)) {}

    /// Publishes to all subscribers. The packet is encoded before this returns, or copied once for subscribers of this
    /// process, which share the copy.
    void operator()(const packet_type& packet) const { publish_now(packet); }
    /// The same by move: subscribers of this process share the moved packet, without a copy.
    void operator()(packet_type&& packet) const { publish_now(std::move(packet)); }

    /// A compile error for packets of another type; so are the next two.
    template <class Other>
    requires(!std::is_convertible_v<Other, packet_type>) void operator()(const Other&) const {
        static_assert(sizeof(Other) == 0,
                      "ise: this publication publishes packets of another type: the one that its service names");
    }
    /// See above.
    template <class Other>
    requires(!std::is_convertible_v<Other, packet_type>) void send(const Other& packet) const { (*this)(packet); }
    /// See above.
    template <class Other>
    requires(!std::is_convertible_v<Other, packet_type>) void try_send(const Other& packet) const { (*this)(packet); }

    /// Publishes only to subscribers for which `wants(const subscriber_info&)` returns true, such as those with a
    /// matching filter, or a new one that needs a snapshot. The others count the packet as skipped, not as lost.
    template <class Wants>
    void publish_if(const packet_type& packet, Wants wants) const {
        core().publish_to(made(packet), wants);
    }

    /// Waits until every connected lossless subscriber has room, then publishes (back-pressure). The subscription of
    /// one that is silent for `max_silence` (1 s), or reads nothing for `max_stall` (30 s), ends. Cancellation:
    /// terminal, the packet is not published. The packet is encoded, or copied, before this returns; if there is room,
    /// it is also published before this returns.
    send_packet send(const packet_type& packet) const { return send_made(packet); }
    /// The same by move: `co_await out.send(std::move(packet))`.
    send_packet send(packet_type&& packet) const { return send_made(std::move(packet)); }

    /// Publishes if every lossless subscriber has room; otherwise does nothing and returns false, and the caller awaits
    /// `send`. For publishing many packets without suspending while there is room.
    bool try_send(const packet_type& packet) const {
        if (!core().has_room()) return false;
        (*this)(packet);
        return true;
    }

    /// The number of subscribers, including unreachable ones within their linger.
    std::size_t subscribers() const { return core().subscribers(); }
    /// The number of packets published so far, which is the sequence number of the last one.
    std::uint64_t published() const { return core().published(); }

private:
    const std::shared_ptr<publication_core>& held() const {
        if (!core_) publication_core::throw_empty();
        return core_;
    }
    publication_core& core() const { return *held(); }
    template <class Packet>
    send_packet send_made(Packet&& packet) const {
        if (!core().has_room()) return send_packet(core_, made(std::forward<Packet>(packet)));
        publish_now(std::forward<Packet>(packet));
        return {};
    }
    template <class Packet>
    void publish_now(Packet&& packet) const {
        auto& to = core();
        give(to, std::forward<Packet>(packet),
             [&to](auto&&... what) { to.publish(std::forward<decltype(what)>(what)...); });
    }
    template <class Packet>
    published_packet made(Packet&& packet) const {
        auto& by = core();
        return give(by, std::forward<Packet>(packet),
                    [&by](auto&&... what) { return by.encoded(std::forward<decltype(what)>(what)...); });
    }
    // Calls `to` with the packet's trace, and with the packet as an object, as bytes, or as a function that writes it.
    template <class Packet, class To>
    static auto give(const publication_core& of, Packet&& packet, To to) {
        if constexpr (travels_as_object<packet_type>)
            if (of.wants_object()) return to(current_trace(), share_packet<packet_type>(std::forward<Packet>(packet)));
        if constexpr (detail::codec<packet_type>::raw) return to(current_trace(), detail::raw_bytes(packet));
        else return to(current_trace(), [&packet](buffer& out) { encode(packet, out); });
    }

    std::shared_ptr<publication_core> core_;
};

/// The same, so that `ise::publication<decltype(position)>` can be a member: the constant of a service is const.
template <class Contract>
class publication<const Contract> : public publication<Contract> {
public:
    publication() = default;
    /// What `publish` gave.
    publication(publication<Contract> made) : publication<Contract>(std::move(made)) {}
};

/// The provider's callbacks of a subscription; each may be empty.
template <class Contract>
struct publication_callbacks {
    /// Accepts a subscriber by returning a response, or refuses it with a failure such as errc::refused.
    std::function<result<typename Contract::subscribe_response>(const typename Contract::subscribe_request&,
                                                                const subscriber_info&)>
        on_subscribe;
    /// A subscriber has left (its request) or vanished (a default request).
    std::function<typename Contract::unsubscribe_response(const typename Contract::unsubscribe_request&,
                                                          const subscriber_info&)>
        on_unsubscribe;
};

/// Implementation of `component::publish`.
template <class Contract>
std::shared_ptr<publication_core> make_publication(service_runtime& runtime, const Contract& contract,
                                                   publication_callbacks<Contract> callbacks = {}) {
    auto made = std::make_shared<publication_core>(runtime, std::string(contract.name()), Contract::types());
    auto read = [](bytes_view raw, const adapter* adapt, auto packet) {
        if (!raw.empty() && adapt) {
            decode_into(packet, (*adapt)(raw));
        } else if (!raw.empty()) {
            decode_into(packet, raw);
        }
        return packet;
    };
    made->accept = [decide = std::move(callbacks.on_subscribe), read](bytes_view raw, const adapter* adapt,
                                                                      const subscriber_info& who) -> result<bytes> {
        auto request = read(raw, adapt, typename Contract::subscribe_request{});
        if (!decide) return encode(typename Contract::subscribe_response{});
        auto response = decide(request, who);
        if (!response) return response.error();
        return encode(*response);
    };
    made->removed = [tell = std::move(callbacks.on_unsubscribe), read](bytes_view raw, const adapter* adapt,
                                                                       const subscriber_info& who) {
        auto request = read(raw, adapt, typename Contract::unsubscribe_request{});
        return encode(tell ? tell(request, who) : typename Contract::unsubscribe_response{});
    };
    return made;
}

} // namespace ise
