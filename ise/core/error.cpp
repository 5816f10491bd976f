#include <ise/core/error.hpp>

#include <ise/core/real/system_errors.hpp>

#include <fmt/format.h>

namespace ise {

std::string_view name_of(errc code) noexcept {
    switch (code) {
        case errc::refused: return "refused";
        case errc::no_such_service: return "no_such_service";
        case errc::type_mismatch: return "type_mismatch";
        case errc::timed_out: return "timed_out";
        case errc::peer_lost: return "peer_lost";
        case errc::cancelled: return "cancelled";
        case errc::overloaded: return "overloaded";
        case errc::handler_failed: return "handler_failed";
        case errc::malformed: return "malformed";
        case errc::too_large: return "too_large";
        case errc::protocol_error: return "protocol_error";
        case errc::version_mismatch: return "version_mismatch";
        case errc::wrong_peer: return "wrong_peer";
        case errc::unreachable: return "unreachable";
        case errc::no_such_name: return "no_such_name";
        case errc::name_taken: return "name_taken";
        case errc::name_server_lost: return "name_server_lost";
        case errc::superseded: return "superseded";
        case errc::address_in_use: return "address_in_use";
        case errc::invalid_argument: return "invalid_argument";
        case errc::would_block_self: return "would_block_self";
        case errc::io_failed: return "io_failed";
        case errc::unauthorized: return "unauthorized";
        case errc::not_connected: return "not_connected";
        case errc::access_denied: return "access_denied";
    }
    return "unknown_error"; // a newer peer's code
}

std::string_view name_of(execution state) noexcept {
    return state == execution::not_executed ? "not_executed" : "unknown";
}

namespace {
class ise_category final : public std::error_category {
    const char* name() const noexcept override { return "ise"; }
    std::string message(int value) const override { return std::string(name_of(static_cast<errc>(value))); }
};
} // namespace

const std::error_category& error_category() noexcept {
    static const ise_category category;
    return category;
}

std::error_code make_error_code(errc code) noexcept { return {static_cast<int>(code), error_category()}; }

failure::failure(errc code, std::string message, execution state)
    : message_(std::move(message)), code_(code), execution_(state) {}

failure io_failure(std::string_view what, const std::error_code& cause) {
    auto code = real::is_address_taken(cause) ? errc::address_in_use : errc::io_failed;
    return failure(code, fmt::format("{}: {}{}", what, cause.message(), real::advice_on(cause)));
}

} // namespace ise
