#include <ise/packet/bounded.hpp>

#include <fmt/format.h>

namespace ise::detail {

template <class T>
std::string out_of_range(T value, T minimum, T maximum, std::string_view unit) {
    return fmt::format("{} is outside of {} to {}{}", value, minimum, maximum,
                       unit.empty() ? std::string() : fmt::format(" ({})", unit));
}
template std::string out_of_range(double, double, double, std::string_view);
template std::string out_of_range(std::int64_t, std::int64_t, std::int64_t, std::string_view);
template std::string out_of_range(std::uint64_t, std::uint64_t, std::uint64_t, std::string_view);

} // namespace ise::detail
