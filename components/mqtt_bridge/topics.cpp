#include <components/mqtt_bridge/topics.hpp>

#include <ise/core/readable.hpp>

#include <fmt/format.h>

namespace ise::mqtt {
namespace {

bool is_replaced(char c) noexcept { return c < ' ' || c > '~' || c == '+' || c == '#' || c == '%'; }

int digit_of(char c) noexcept {
    if (c >= '0' && c <= '9') return c - '0';
    if (c >= 'A' && c <= 'F') return c - 'A' + 10;
    return -1;
}

failure no_topic(std::string_view topic, std::string_view why) {
    return failure(errc::malformed, fmt::format("the topic '{}' {}", readable(topic.substr(0, 200)), why));
}

} // namespace

std::string escape(std::string_view text, bool levels) {
    std::string made;
    made.reserve(text.size());
    for (char c : text) {
        if (is_replaced(c) || (c == '/' && !levels)) made += fmt::format("%{:02X}", static_cast<unsigned char>(c));
        else made += c;
    }
    return made;
}

result<std::string> unescape(std::string_view text) {
    std::string made;
    made.reserve(text.size());
    for (std::size_t at = 0; at < text.size(); ++at) {
        if (text[at] != '%') {
            if (is_replaced(text[at])) return no_topic(text, "has a character that must be written as %XX");
            made += text[at];
            continue;
        }
        const int high = at + 2 < text.size() ? digit_of(text[at + 1]) : -1;
        const int low = high < 0 ? -1 : digit_of(text[at + 2]);
        if (low < 0) return no_topic(text, "has a % without two hexadecimal digits (0-9, A-F)");
        made += static_cast<char>(16 * high + low);
        at += 2;
    }
    return made;
}

result<void> check_prefix(std::string_view prefix) {
    std::string_view why;
    if (prefix.empty()) why = "is empty";
    else if (prefix.size() > max_prefix_bytes) why = "has more than 200 bytes";
    else if (prefix.front() == '$') why = "begins with $, which is for brokers";
    else if (prefix.front() == '/' || prefix.back() == '/') why = "begins or ends with /";
    for (char c : prefix)
        if (is_replaced(c)) why = "has a wildcard, a % or a character that is not printable ASCII";
    if (why.empty()) return {};
    return failure(
        errc::invalid_argument,
        fmt::format("the prefix of topics '{}' {}; use such as ise or fleet/boat-7 (--prefix)", readable(prefix), why));
}

result<std::string> topic_of(std::string_view prefix, std::string_view kind, const service_place& of) {
    auto made = fmt::format("{}/{}/{}/{}", prefix, kind, escape(of.path, true), escape(of.service, false));
    if (made.size() <= max_topic_bytes) return made;
    return failure(errc::too_large, fmt::format("the topic of '{}/{}' would have {} bytes, {} at most "
                                                "(max_topic_bytes): shorten the prefix or the names",
                                                of.path, of.service, made.size(), max_topic_bytes));
}

result<service_place> read_topic(std::string_view prefix, std::string_view kind, std::string_view topic) {
    auto begin = fmt::format("{}/{}/", prefix, kind);
    if (topic.size() > max_topic_bytes) return no_topic(topic, "is too long (max_topic_bytes)");
    if (!topic.starts_with(begin)) return no_topic(topic, fmt::format("does not begin with {}", begin));
    auto rest = topic.substr(begin.size());
    auto cut = rest.rfind('/');
    if (cut == std::string_view::npos || cut == 0 || cut + 1 == rest.size())
        return no_topic(topic, fmt::format("is not {}PATH/SERVICE", begin));
    auto path = unescape(rest.substr(0, cut));
    if (!path) return path.error();
    auto service = unescape(rest.substr(cut + 1));
    if (!service) return service.error();
    service_place made;
    made.path = std::move(*path);
    made.service = std::move(*service);
    return made;
}

} // namespace ise::mqtt
