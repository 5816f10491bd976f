#pragma once
#include <ise/session/contract.hpp>

#include <cstdint>
#include <string>
#include <vector>

/// The services that tests of the lower layers call.
namespace boat_services {

struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted = false;
    std::string reason;
};
struct fix {
    double latitude_deg = 0, longitude_deg = 0;
    float speed_kn = 0;
};
struct blob {
    std::vector<std::uint8_t> content;
};

inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};
inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::request_response<blob, blob> echo{"echo"};
inline constexpr ise::subscription<blob> pictures{"pictures"};

} // namespace boat_services
