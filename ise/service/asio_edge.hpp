#pragma once
#include <ise/core/asio_configuration.hpp>
#include <ise/service/remote.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/associated_cancellation_slot.hpp>
#include <asio/associated_executor.hpp>
#include <asio/async_result.hpp>
#include <asio/cancellation_type.hpp>

#include <memory>
#include <utility>

namespace ise::detail {

/// Cancels a call through the slot of a completion handler.
struct slot_cancellation : call_cancellation {
    void operator()(asio::cancellation_type kind) {
        if (kind != asio::cancellation_type::none) cancel();
    }
};

template <class Token>
struct asio_edge {
    /// A call that completes `token` (`remote::try_call`).
    template <class Contract>
    static auto call(const std::shared_ptr<peer_channel>& to, const Contract& service,
                     typename Contract::request_type request, duration deadline, Token token) {
        using request_type = typename Contract::request_type;
        using response_type = typename Contract::response_type;
        return asio::async_initiate<Token, void(result<response_type>)>(
            [](auto handler, const std::shared_ptr<peer_channel>& callee, service_key key, request_type packet,
               duration limit) {
                asio::any_io_executor waiting = asio::get_associated_executor(handler, asio::any_io_executor());
                auto slot = asio::get_associated_cancellation_slot(handler);
                call_completion done = [handler = std::move(handler)](const call_outcome& outcome) mutable {
                    return [handler = std::move(handler), got = response_of<response_type>(outcome)]() mutable {
                        auto taken = std::move(handler);
                        taken(std::move(got));
                    };
                };
                call_cancellation nobody;
                auto& cancellation = slot.is_connected() ? slot.template emplace<slot_cancellation>() : nobody;
                start_call(*callee, nullptr, key, limit, waiting, cancellation, std::move(done),
                           outgoing_packet(packet));
            },
            token, to, service.key(), std::move(request), deadline);
    }
};

} // namespace ise::detail
