#include <ise/component/poll_window.hpp>

#include <fmt/format.h>

#include <charconv>

namespace ise::detail {
namespace {

// Who looks for longer does nothing else.
constexpr std::chrono::microseconds longest = std::chrono::seconds(1);

} // namespace

result<duration> parse_poll_window(std::string_view microseconds) {
    std::uint32_t count = 0;
    const char* end = microseconds.data() + microseconds.size();
    auto [rest, problem] = std::from_chars(microseconds.data(), end, count);
    if (problem != std::errc() || rest != end || count > longest.count())
        return failure(errc::invalid_argument, fmt::format("'{}' is not a time to poll for: microseconds, from 0 to {}",
                                                           microseconds.substr(0, 40), longest.count()));
    return duration(std::chrono::microseconds(count));
}

duration poll_window_of(const std::optional<duration>& given, const environment& env) {
    if (given) {
        if (*given >= duration{} && *given <= longest) return *given;
        throw error(errc::invalid_argument, fmt::format("node_options::poll is {} ns; a node polls for 0 to {} us",
                                                        given->count(), longest.count()));
    }
    auto result = env.variable("ISE_POLL_US");
    if (!result || result->empty()) return {};
    auto window = parse_poll_window(*result);
    if (!window) throw error(window.error().code(), "ISE_POLL_US: " + window.error().message());
    return *window;
}

} // namespace ise::detail
