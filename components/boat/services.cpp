#include <components/boat/services.hpp>

#include <fmt/format.h>

namespace atirma {

telecommand to_telecommand(std::uint32_t id, utc_time sent_at, const boat_command& what, std::uint32_t authority) {
    telecommand made;
    made.id = id;
    made.kind = what.kind;
    made.sent_at = sent_at;
    made.mode = what.mode;
    made.index = what.index;
    made.point = what.point;
    made.parameter = what.parameter;
    made.value = what.value;
    made.link = what.link;
    made.period_s = what.period_s;
    made.on = what.on;
    made.authority = authority;
    return made;
}

ise::result<void> check_request(const telecommand_request& request) {
    if (!(request.valid_s >= 1 && request.valid_s <= 86400)) // not a number, too
        return ise::failure(ise::errc::invalid_argument, fmt::format("valid_s is 1 to 86400 s, not {:g}", request.valid_s));
    if (!is_known(request.command.kind))
        return ise::failure(ise::errc::invalid_argument, fmt::format("no telecommand has number {}", static_cast<int>(request.command.kind)));
    const auto& point = request.command.point;
    if (!(point.latitude_deg >= -90 && point.latitude_deg <= 90 && point.longitude_deg >= -180 && point.longitude_deg <= 180))
        return ise::failure(ise::errc::invalid_argument, fmt::format("{:g}, {:g} is not a place on the globe", point.latitude_deg, point.longitude_deg));
    return {};
}

} // namespace atirma
