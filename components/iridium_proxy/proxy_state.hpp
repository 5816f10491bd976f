#pragma once
#include <components/boat/duplicate_filter.hpp>
#include <components/boat/newest_by_kind.hpp>
#include <components/boat/telecommand_service.hpp>
#include <components/boat/telemetry_keeper.hpp>
#include <components/iridium/directip_exchange.hpp>
#include <components/iridium/jwt.hpp>
#include <components/iridium_proxy/mt_path.hpp>
#include <components/iridium_proxy/sbd_policy.hpp>
#include <components/iridium_proxy/sbd_store.hpp>
#include <components/iridium_proxy/services.hpp>
#include <components/mail/mail.hpp>
#include <components/seal_store/seal_store.hpp>
#include <ise/http/http_server.hpp>

#include <ise/component/component.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/waiter.hpp>

#include <functional>
#include <memory>
#include <optional>
#include <string>

// Private to this folder.
namespace atirma {

struct proxy_state {
    proxy_state(ise::component& of, sbd_store opened, const link_policy& policy, std::function<void()> hand_on)
        : store(std::move(opened)), commands(of, policy), wake_sender(of.on()), more(of.on()),
          hand_on_soon(of.on(), std::move(hand_on)) {}

    std::unique_ptr<seal::shore_link> seal; // empty: no key
    sbd_store store;
    telecommand_service commands;
    queue_clock clock;
    duplicate_filter seen;
    std::optional<iridium::jwt_key> key;
    iridium::address_list gateways;
    std::unique_ptr<mt_path> path;
    std::unique_ptr<ise::http_server> webhook;
    std::unique_ptr<iridium::directip_server> directip;
    std::unique_ptr<mailbox> mails;
    ise::waiter<std::error_code> wake_sender;
    ise::waiter<std::error_code> more; // messages, for the store
    ise::timer hand_on_soon;
    ise::log_limiter quiet;
    newest_by_kind newest; // that was published
    std::string disk_trouble, mail_trouble, send_trouble;
    std::optional<telemetry_keeper> keeper;
    iridium_account counts;
    ise::publication<ise::subscription<telemetry_packet>> telemetry;
    ise::publication<ise::subscription<iridium_account>> account;
    bool sender_rests = false; // the disk takes nothing
};

} // namespace atirma
