#pragma once
#include <cstddef>
#include <string_view>

/// Names out of the compiler's own words. They are shown and compared as text; a type's name is never hashed, for
/// compilers write those differently.
namespace ise::detail {

constexpr bool is_name_char(char c) noexcept {
    return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' ||
           static_cast<unsigned char>(c) >= 0x80;
}

/// The identifier at the end of a text: "ns::mode::manual" gives "manual", "(mode)7" nothing.
constexpr std::string_view last_identifier(std::string_view text) noexcept {
    std::size_t end = text.size();
    std::size_t begin = end;
    while (begin > 0 && is_name_char(text[begin - 1])) --begin;
    if (begin == end || (text[begin] >= '0' && text[begin] <= '9')) return {};
    return text.substr(begin, end - begin);
}

/// "a::stamped<b::fix>" gives "stamped".
constexpr std::string_view short_type_name(std::string_view full) noexcept {
    if (std::size_t arguments = full.find('<'); arguments != std::string_view::npos && arguments > 0)
        full = full.substr(0, arguments);
    std::string_view name = last_identifier(full);
    return name.empty() ? std::string_view("unnamed") : name;
}

template <class T>
constexpr std::string_view full_type_name() noexcept {
    std::string_view text = __PRETTY_FUNCTION__; // "… [with T = x; …]" or "… [T = x]"
    std::size_t begin = text.find("T = ") + 4;
    std::size_t end = text.find_first_of(";]", begin);
    return text.substr(begin, end - begin);
}

/// The name of the field that a pointer points to.
template <auto* pointer>
constexpr std::string_view pointed_name() noexcept {
    std::string_view text = __PRETTY_FUNCTION__; // "… pointer = (& object<fix>::value.fix::speed_kn)]"
    text = text.substr(text.rfind("pointer = "));
    std::size_t end = text.find_first_of(";]"); // g++ goes on with "; std::string_view = …]"
    while (end > 0 && !is_name_char(text[end - 1])) --end;
    return last_identifier(text.substr(0, end));
}

} // namespace ise::detail
