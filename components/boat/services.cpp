#include <components/boat/services.hpp>

#include <fmt/format.h>

namespace atirma {

ise::result<void> check_request(const telecommand_request& request) {
    if (!(request.valid_s >= 1 && request.valid_s <= 86400)) // not a number, too
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("valid_s is 1 to 86400 s, not {:g}", request.valid_s));
    return check(request.command);
}

} // namespace atirma
