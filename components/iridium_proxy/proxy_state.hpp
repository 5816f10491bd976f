#pragma once
#include <components/boat/duplicate_filter.hpp>
#include <components/http/http_server.hpp>
#include <components/iridium/directip_exchange.hpp>
#include <components/iridium/jwt.hpp>
#include <components/iridium_proxy/mt_path.hpp>
#include <components/iridium_proxy/mt_queue.hpp>
#include <components/iridium_proxy/sbd_store.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/mail/mail.hpp>

#include <ise/component/component.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/waiter.hpp>

#include <functional>
#include <list>
#include <map>
#include <memory>
#include <optional>
#include <string>

// Private to this folder.
namespace atirma {

struct proxy_state {
    struct waiting_call {
        waiting_call(ise::loop& on, std::uint32_t of)
            : id(of), wake(on, [this] { wake.resume(asio::error::operation_aborted); }),
              late(on, [this] { wake.resume({}); }) {}
        std::uint32_t id;
        ise::waiter<std::error_code> wake;
        ise::timer late;
    };

    proxy_state(ise::loop& on, sbd_store opened, const mt_queue_options& queued, std::function<void()> work,
                std::function<void()> hand_on)
        : store(std::move(opened)), queue(queued),
          wake_sender(on, [this] { wake_sender.resume(asio::error::operation_aborted); }),
          more(on, [this] { more.resume(asio::error::operation_aborted); }), due(on, std::move(work)),
          hand_on_soon(on, std::move(hand_on)) {}

    sbd_store store;
    mt_queue queue;
    std::chrono::milliseconds clock_ahead = std::chrono::milliseconds::min(); // of the queue, of the steady clock
    duplicate_filter seen;
    std::optional<iridium::jwt_key> key;
    iridium::address_list gateways;
    std::unique_ptr<mt_path> path;
    std::unique_ptr<http_server> webhook;
    std::unique_ptr<iridium::directip_server> directip;
    std::unique_ptr<mailbox> mails;
    ise::waiter<std::error_code> wake_sender;
    ise::waiter<std::error_code> more; // messages, for the store
    ise::timer due;
    ise::timer hand_on_soon;
    ise::log_limiter quiet;
    std::list<waiting_call*> calls;
    std::map<std::uint64_t, std::uint32_t> followers; // subscriber's number → id, 0 for all
    std::map<std::size_t, utc_time> newest;           // measured, of each type of packet that was published
    std::string disk_trouble, mail_trouble, send_trouble, store_trouble;
    iridium_account counts;
    ise::publication<ise::subscription<telemetry_packet>> telemetry;
    ise::publication<std::decay_t<decltype(services::telecommand_state)>> states;
    ise::publication<ise::subscription<iridium_account>> account;
    bool working = false;
};

} // namespace atirma
