#pragma once
#include <components/boat/services.hpp>

#include <ise/session/contract.hpp>

#include <cstdint>
#include <optional>
#include <string>

namespace atirma {

/// A telecommand that is not to be sent any more: the boat has answered over another link, or its operator calls it
/// back.
struct recall_request {
    std::uint32_t id = 0;
    std::string why; ///< "acknowledged over gprs"
};
struct recall_reply {
    bool recalled = false;                  ///< nothing more of it leaves the shore here
    std::string text;                       ///< for people
    std::optional<telecommand_stage> state; ///< where it stands then; nothing: it is not known
};

namespace services {

/// Of a proxy, and of a communication node, which asks the proxies that have it; there only the operator who gave it,
/// or who has the authority, may call it back (else refused). What the boat may have got already is decided as
/// `expired`, what never left as `failed`; an id that is not known or decided changes nothing.
inline constexpr ise::request_response<recall_request, recall_reply> telecommand_recall{"telecommand_recall"};

} // namespace services

} // namespace atirma
