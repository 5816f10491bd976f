#pragma once
#include <ise/core/time.hpp>
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>

/// What a component with an access policy tells of it. Packets: fields are only ever appended.
namespace ise {

struct access_request {};

struct access_report {
    std::string file;      ///< on its host
    std::string hash;      ///< of the content that counts: equal where that is
    wall_time read_at{};   ///< when it was read
    std::string problem;   ///< why the file cannot be used now; empty: it can
    std::string who;       ///< the identity of the component's own credentials; empty: none
    std::string asked_by;  ///< the identity that the caller has there; empty: none
    std::uint64_t rules{}; ///< how many there are
};

/// Provided where there is a policy; errc::no_such_service elsewhere.
inline constexpr request_response<access_request, access_report> access_service{"ise.access"};

} // namespace ise
