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

ise::result<void> check_place(const command_traits& of, const std::vector<command_kind>& open, std::size_t most) {
    auto saves = [](const command_traits& traits) { return traits.priority == command_priority::saves; };
    std::size_t alike = 0, asking = 0;
    for (auto kind : open) {
        const auto& traits = traits_of(kind);
        if (saves(traits) == saves(of)) ++alike;
        if (!traits.needs_authority) ++asking;
    }
    if (alike >= most)
        return ise::failure(ise::errc::overloaded, fmt::format("{} telecommands wait for the boat already", alike));
    if (!of.needs_authority && asking >= (most + 1) / 2)
        return ise::failure(ise::errc::overloaded,
                            fmt::format("{} telecommands that need no authority wait for the boat already", asking));
    return {};
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
