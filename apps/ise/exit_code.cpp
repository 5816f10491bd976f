#include "exit_code.hpp"

namespace ise::cli {

exit_code code_of(errc why) noexcept {
    switch (why) {
        case errc::refused:
        case errc::handler_failed:
        case errc::overloaded:
        case errc::cancelled:
        case errc::access_denied:
        case errc::unauthorized: return exit_code::failed;
        case errc::type_mismatch:
        case errc::malformed:
        case errc::too_large: return exit_code::mismatch;
        case errc::invalid_argument: return exit_code::usage;
        default: return exit_code::not_reached;
    }
}

problem::problem(const failure& why, std::string advice)
    : problem(code_of(why.code()), std::string(ise::name_of(why.code())), why.message(), std::move(advice)) {}

problem& problem::of_call(execution state) {
    executed_ = ise::name_of(state);
    return *this;
}

} // namespace ise::cli
