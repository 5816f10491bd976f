#include <components/postgres/postgres.hpp>

#include <charconv>

namespace atirma {
namespace {

constexpr std::string_view digits = "0123456789abcdef";

unsigned digit_of(char letter) {
    auto at = digits.find(letter);
    return at == digits.npos ? 0u : static_cast<unsigned>(at);
}

} // namespace

std::string postgres_bytes(const std::vector<std::byte>& raw) {
    std::string made = "\\x";
    made.reserve(2 + 2 * raw.size());
    for (auto one : raw) {
        made += digits[std::to_integer<unsigned>(one) >> 4];
        made += digits[std::to_integer<unsigned>(one) & 15u];
    }
    return made;
}

std::vector<std::byte> bytes_of_postgres(const postgres_value& text) {
    std::vector<std::byte> made;
    if (!text || !text->starts_with("\\x")) return made;
    made.reserve(text->size() / 2);
    for (std::size_t i = 2; i + 1 < text->size(); i += 2)
        made.push_back(static_cast<std::byte>(digit_of((*text)[i]) << 4 | digit_of((*text)[i + 1])));
    return made;
}

std::string postgres_array(const std::vector<std::string>& values) {
    std::string made = "{";
    for (const auto& value : values) {
        made += made.size() > 1 ? ",\"" : "\"";
        for (char letter : value) {
            if (letter == '"' || letter == '\\') made += '\\';
            made += letter;
        }
        made += '"';
    }
    return made + "}";
}

std::int64_t integer_of(const postgres_row& row, std::size_t column) {
    const auto& text = text_of(row, column);
    std::int64_t made = 0;
    std::from_chars(text.data(), text.data() + text.size(), made);
    return made;
}

const std::string& text_of(const postgres_row& row, std::size_t column) {
    static const std::string none;
    const auto& value = row.at(column);
    return value ? *value : none;
}

bool is_postgres_url(std::string_view text) noexcept {
    return text.starts_with("postgresql://") || text.starts_with("postgres://");
}

} // namespace atirma
