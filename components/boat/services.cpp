#include <components/boat/services.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {

ise::result<void> check_request(const telecommand_request& request) {
    if (request.valid_s && !(*request.valid_s >= 1 && *request.valid_s <= 86400)) // not a number, too
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("valid_s is 1 to 86400 s, not {:g}", *request.valid_s));
    return check(request.command);
}

std::optional<std::chrono::milliseconds> validity_of(const telecommand_request& request, utc_time now, link_id over) {
    using std::chrono::milliseconds;
    milliseconds valid = default_validity(request.command.kind(), over);
    if (request.valid_s) valid = std::chrono::round<milliseconds>(std::chrono::duration<double>(*request.valid_s));
    else if (request.valid_until) valid = std::chrono::hours(24);
    if (request.valid_until) valid = std::min(valid, *request.valid_until - now);
    if (valid < milliseconds(10)) return std::nullopt; // a step of the format
    return valid;
}

} // namespace atirma
