#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>

namespace atirma {

/// A telecommand that need not be sent any more over this link: the boat has answered over another one.
struct recall_request {
    std::uint32_t id = 0;
    std::string why; ///< "acknowledged over gprs"
};
struct recall_reply {
    bool recalled = false; ///< nothing more of it leaves the shore here
    std::string text;      ///< for people
};

namespace services {

/// Of a proxy. What the boat may have got already is decided as `expired`, what never left as `failed`; an id that is
/// not known or decided changes nothing.
inline constexpr ise::request_response<recall_request, recall_reply> telecommand_recall{"telecommand_recall"};

} // namespace services

} // namespace atirma
