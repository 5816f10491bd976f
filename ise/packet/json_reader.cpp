#include <ise/packet/detail/natural.hpp>
#include <ise/packet/detail/text_forms.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numeric>

namespace ise {

namespace {
using nlohmann::json;

// Where we are, as a chain on the stack.
struct place {
    const place* outer = nullptr;
    std::string_view name = {};
    std::size_t index = 0;

    std::string path() const {
        if (!outer) return std::string();
        std::string before = outer->path();
        if (name.empty()) return fmt::format("{}[{}]", before, index);
        return before.empty() ? std::string(name) : fmt::format("{}.{}", before, name);
    }
};

std::size_t field_name_distance(std::string_view a, std::string_view b) {
    std::vector<std::size_t> row(b.size() + 1);
    std::iota(row.begin(), row.end(), std::size_t{0}); // what was left out costs least: lat_deg means latitude_deg
    for (std::size_t i = 1; i <= a.size(); ++i) {
        std::size_t diagonal = std::exchange(row[0], 2 * i);
        for (std::size_t j = 1; j <= b.size(); ++j) {
            std::size_t changed = diagonal + (a[i - 1] != b[j - 1] ? 2 : 0);
            diagonal = row[j];
            row[j] = std::min({row[j] + 2, row[j - 1] + 1, changed});
        }
    }
    return row.back();
}

std::string shown(const json& value) {
    if (value.is_object()) return "an object";
    if (value.is_array()) return "a list";
    std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
    constexpr std::size_t most = 40;
    if (text.size() > most) text = text.substr(0, most) + "…";
    return text;
}

class transcriber {
public:
    transcriber(std::string_view packet_name, const json_limits& limits) : packet_name_(packet_name), limits_(limits) {}

    void value(const type_description& type, const json& from, const place& at) {
        if (out.size() > limits_.max_packet_bytes)
            throw error(errc::too_large, fmt::format("{}: the packet grows beyond {} bytes (max_packet_bytes)",
                                                     where(at), limits_.max_packet_bytes));
        switch (type.kind) {
            case type_kind::boolean:
                if (!from.is_boolean()) wrong(at, "true or false", from);
                return out.append(static_cast<std::uint8_t>(from.get<bool>()));
            case type_kind::character: return character(from, at);
            case type_kind::f32:
            case type_kind::f64: return real(type.kind, from, at);
            case type_kind::string:
                if (!from.is_string()) wrong(at, "a string", from);
                return text(from.get_ref<const std::string&>());
            case type_kind::structure: return structure(type, from, at);
            case type_kind::enumeration: return enumeration(type, from, at);
            case type_kind::time_span:
            case type_kind::instant: return time(type, from, at);
            case type_kind::opaque: return base64(from, at, true, 0);
            case type_kind::optional: return optional(type.members[0].type, from, at);
            case type_kind::variant: return variant(type, from, at);
            case type_kind::map: return map(type, from, at);
            case type_kind::tuple:
                if (!from.is_array() || from.size() != type.members.size())
                    wrong(at, fmt::format("a list of {}", type.members.size()), from);
                for (std::size_t i = 0; i < from.size(); ++i) value(type.members[i].type, from[i], {&at, {}, i});
                return;
            case type_kind::vector:
            case type_kind::set:
            case type_kind::array: return elements(type, from, at);
            default: return integer(type.kind, from, at);
        }
    }

    buffer out;

private:
    std::string where(const place& at) const {
        std::string path = at.path();
        return path.empty() ? std::string(packet_name_) : path;
    }
    [[noreturn]] void wrong(const place& at, std::string_view expected, const json& from) const {
        throw error(errc::malformed, fmt::format("{}: expected {}, found {}", where(at), expected, shown(from)));
    }

    void count(std::size_t n, const place& at) {
        if (n > std::numeric_limits<std::uint32_t>::max())
            throw error(errc::too_large, fmt::format("{}: too long", where(at)));
        out.append(static_cast<std::uint32_t>(n));
    }
    void text(std::string_view value) {
        out.append(static_cast<std::uint32_t>(value.size())); // below the limit of the JSON text
        out.append(as_bytes(value));
    }

    template <class T>
    void put_integer(const json& from, const place& at, type_kind kind) {
        auto misfit = [&] {
            wrong(at,
                  fmt::format("a number from {} to {} ({})", +std::numeric_limits<T>::min(),
                              +std::numeric_limits<T>::max(), name_of(kind)),
                  from);
        };
        if (from.is_number_unsigned()) {
            auto number = from.get<std::uint64_t>();
            if (!std::in_range<T>(number)) misfit();
            return out.append(static_cast<T>(number));
        }
        if (from.is_number_integer()) {
            auto number = from.get<std::int64_t>();
            if (!std::in_range<T>(number)) misfit();
            return out.append(static_cast<T>(number));
        }
        double number = from.is_number_float() ? from.get<double>() : 0.5;
        if (number != std::floor(number)) wrong(at, "a whole number", from);
        // Exact bounds as doubles: -2^n and 2^m, the upper one outside.
        double above = std::ldexp(1.0, std::numeric_limits<T>::digits);
        if (!(number >= (std::is_signed_v<T> ? -above : 0.0) && number < above)) misfit();
        out.append(static_cast<T>(number));
    }

    void integer(type_kind kind, const json& from, const place& at) {
        switch (kind) {
            case type_kind::i8: return put_integer<std::int8_t>(from, at, kind);
            case type_kind::i16: return put_integer<std::int16_t>(from, at, kind);
            case type_kind::i32: return put_integer<std::int32_t>(from, at, kind);
            case type_kind::i64: return put_integer<std::int64_t>(from, at, kind);
            case type_kind::u16: return put_integer<std::uint16_t>(from, at, kind);
            case type_kind::u32: return put_integer<std::uint32_t>(from, at, kind);
            case type_kind::u64: return put_integer<std::uint64_t>(from, at, kind);
            default: return put_integer<std::uint8_t>(from, at, kind);
        }
    }

    void character(const json& from, const place& at) {
        if (!from.is_string()) return put_integer<std::uint8_t>(from, at, type_kind::u8);
        const auto& one = from.get_ref<const std::string&>();
        if (one.size() != 1) wrong(at, "one character", from);
        out.append(one[0]);
    }

    // Also what JSON has no numbers for.
    double real_number(const json& from, const place& at, std::string_view expected) const {
        if (from == "NaN") return std::numeric_limits<double>::quiet_NaN();
        if (from == "Infinity") return std::numeric_limits<double>::infinity();
        if (from == "-Infinity") return -std::numeric_limits<double>::infinity();
        if (!from.is_number()) wrong(at, expected, from);
        return from.get<double>();
    }

    void real(type_kind kind, const json& from, const place& at) {
        const double number = real_number(from, at, "a number");
        if (kind == type_kind::f64) return out.append(number);
        // The text of the largest float is a little more than that: up to here it is the nearest one.
        constexpr double too_large = 0x1.ffffffp127;
        constexpr double largest = std::numeric_limits<float>::max();
        if (!std::isfinite(number)) return out.append(static_cast<float>(number));
        if (std::abs(number) >= too_large) wrong(at, "a number that fits f32", from);
        out.append(static_cast<float>(std::clamp(number, -largest, largest)));
    }

    void enumeration(const type_description& type, const json& from, const place& at) {
        if (!from.is_string()) {
            if (!from.is_number()) wrong(at, "the name of an enumerator, or its number", from);
            return integer(type.number, from, at);
        }
        const auto& name = from.get_ref<const std::string&>();
        for (const auto& e : type.enumerators)
            if (e.name == name)
                return integer(
                    type.number,
                    type.number == type_kind::u64 ? json(static_cast<std::uint64_t>(e.value)) : json(e.value), at);
        std::string known;
        for (std::size_t i = 0; i < type.enumerators.size() && i < 16; ++i)
            known += (i ? ", " : "") + type.enumerators[i].name;
        wrong(at, fmt::format("one of {}", known.empty() ? "its numbers" : known), from);
    }

    void time(const type_description& type, const json& from, const place& at) {
        if (type.number == type_kind::f64) {
            const double seconds = real_number(from, at, "a number of seconds");
            return out.append(seconds * static_cast<double>(type.period_den) / static_cast<double>(type.period_num));
        }
        std::optional<std::int64_t> ticks;
        if (from.is_number()) ticks = detail::ticks_from_seconds(type, from.get<double>());
        if (from.is_string()) ticks = detail::ticks_from_text(type, from.get_ref<const std::string&>());
        if (!ticks)
            wrong(at,
                  type.kind == type_kind::time_span ? "a number of seconds (or \"7 ticks\")"
                                                    : "a time such as \"2026-11-21T08:00:00Z\", or seconds since 1970",
                  from);
        out.append(*ticks);
    }

    void base64(const json& from, const place& at, bool counted, std::size_t fixed) {
        auto raw = from.is_string() ? detail::from_base64(from.get_ref<const std::string&>()) : std::nullopt;
        if (!raw) wrong(at, "base64", from);
        if (!counted && raw->size() != fixed) wrong(at, fmt::format("base64 of {} bytes", fixed), from);
        if (counted) count(raw->size(), at);
        out.append(*raw);
    }

    void optional(const type_description& inner, const json& from, const place& at) {
        out.append(static_cast<std::uint8_t>(!from.is_null()));
        if (from.is_null()) return;
        if (inner.kind != type_kind::optional) return value(inner, from, at);
        if (!from.is_array() || from.size() != 1)
            wrong(at, "null or a list of one (an optional within an optional)", from);
        value(inner, from[0], at);
    }

    void variant(const type_description& type, const json& from, const place& at) {
        auto index = from.is_object() ? from.find("index") : from.end();
        if (!from.is_object() || from.size() != 2 || index == from.end() || !from.contains("value"))
            wrong(at, "an object {\"index\": …, \"value\": …}", from);
        std::uint64_t which = index->is_number_unsigned() ? index->get<std::uint64_t>() : type.members.size();
        if (which >= type.members.size())
            wrong({&at, "index"}, fmt::format("an alternative from 0 to {}", type.members.size() - 1), *index);
        if (type.members.size() > 255) out.append(static_cast<std::uint16_t>(which));
        else out.append(static_cast<std::uint8_t>(which));
        value(type.members[static_cast<std::size_t>(which)].type, from["value"], {&at, "value"});
    }

    void map(const type_description& type, const json& from, const place& at) {
        const auto& key = type.members[0].type;
        const auto& mapped = type.members[1].type;
        if (key.kind == type_kind::string && from.is_object()) {
            count(from.size(), at);
            for (const auto& [name, held] : from.items()) {
                text(name);
                value(mapped, held, {&at, name});
            }
            return;
        }
        if (!from.is_array()) wrong(at, key.kind == type_kind::string ? "an object" : "a list of [key, value]", from);
        count(from.size(), at);
        for (std::size_t i = 0; i < from.size(); ++i) {
            place here{&at, {}, i};
            if (!from[i].is_array() || from[i].size() != 2) wrong(here, "[key, value]", from[i]);
            value(key, from[i][0], {&here, {}, 0});
            value(mapped, from[i][1], {&here, {}, 1});
        }
    }

    void elements(const type_description& type, const json& from, const place& at) {
        const auto& element = type.members[0].type;
        bool is_array = type.kind == type_kind::array;
        if (element.kind == type_kind::byte && from.is_string())
            return base64(from, at, !is_array, static_cast<std::size_t>(type.length));
        if (element.kind == type_kind::character && from.is_string()) {
            const auto& chars = from.get_ref<const std::string&>();
            if (!is_array) return text(chars);
            if (chars.size() > type.length) wrong(at, fmt::format("at most {} characters", type.length), from);
            room(type.length, at);
            out.append(as_bytes(chars));
            auto rest = static_cast<std::size_t>(type.length) - chars.size();
            if (rest != 0) std::memset(out.grow(rest), 0, rest);
            return;
        }
        if (!from.is_array()) wrong(at, element.kind == type_kind::byte ? "base64 or a list" : "a list", from);
        if (is_array && from.size() != type.length)
            wrong(at, fmt::format("a list of {} (not of {})", type.length, from.size()), from);
        if (!is_array) count(from.size(), at);
        for (std::size_t i = 0; i < from.size(); ++i) value(element, from[i], {&at, {}, i});
    }

    void room(std::uint64_t more, const place& at) const {
        if (more > limits_.max_packet_bytes || out.size() > limits_.max_packet_bytes - more)
            throw error(errc::too_large, fmt::format("{}: the packet grows beyond {} bytes (max_packet_bytes)",
                                                     where(at), limits_.max_packet_bytes));
    }

    void structure(const type_description& type, const json& from, const place& at) {
        if (!from.is_object()) wrong(at, "an object", from);
        std::size_t found = 0;
        for (const auto& field : type.members) found += from.contains(field.name);
        if (found != from.size()) unknown_field(type, from, at);
        for (const auto& field : type.members) {
            auto given = from.find(field.name);
            if (given != from.end()) value(field.type, *given, {&at, field.name});
            else detail::append_preset(field, out, detail::size_limit(limits_.max_packet_bytes, "max_packet_bytes"));
        }
    }

    [[noreturn]] void unknown_field(const type_description& type, const json& from, const place& at) const {
        for (const auto& [name, held] : from.items()) {
            auto is = [&](const type_member& field) { return field.name == name; };
            if (std::any_of(type.members.begin(), type.members.end(), is)) continue;
            std::string_view shortened = std::string_view(name).substr(0, 64);
            std::string advice = type.members.empty() ? ": it has no fields" : "";
            std::size_t nearest = std::numeric_limits<std::size_t>::max();
            for (const auto& field : type.members)
                if (std::size_t distance = field_name_distance(shortened, field.name); distance < nearest) {
                    nearest = distance;
                    advice = fmt::format(", did you mean '{}'?", field.name);
                }
            throw error(errc::malformed, fmt::format("{}: no such field{}", place{&at, shortened}.path(), advice));
        }
        throw error(errc::malformed, fmt::format("{}: a field is there twice", where(at)));
    }

    std::string_view packet_name_;
    const json_limits& limits_;
};

// How deep it is nested, as far as it is JSON at all. (The parser has a callback that could tell, but with one it looks
// at all elements of a list whenever one of them ends.)
std::size_t depth_of(std::string_view text) {
    std::size_t depth = 0, deepest = 0;
    bool in_string = false;
    for (std::size_t at = 0; at < text.size(); ++at) {
        char letter = text[at];
        if (in_string) {
            if (letter == '\\') ++at;
            else if (letter == '"') in_string = false;
        } else if (letter == '"') {
            in_string = true;
        } else if (letter == '{' || letter == '[') {
            deepest = std::max(deepest, ++depth);
        } else if ((letter == '}' || letter == ']') && depth > 0) {
            --depth;
        }
    }
    return deepest;
}

json parse(std::string_view text, const json_limits& limits, std::string_view packet_name) {
    if (text.size() > limits.max_text_bytes)
        throw error(errc::too_large,
                    fmt::format("{}: a JSON text of {} bytes, at most {} are accepted (max_text_bytes)", packet_name,
                                text.size(), limits.max_text_bytes));
    if (depth_of(text) > limits.max_depth)
        throw error(errc::too_large,
                    fmt::format("{}: JSON nested deeper than {} levels (max_depth)", packet_name, limits.max_depth));
    try {
        return json::parse(text);
    } catch (const json::exception& why) {
        throw error(errc::malformed, fmt::format("{}: no JSON: {}", packet_name, detail::reason_of(why)));
    }
}
} // namespace

bytes from_json(const schema& of, std::string_view text, const json_limits& limits) {
    json parsed = parse(text, limits, of.name());
    transcriber to(of.name(), limits);
    to.value(of.type(), parsed, {});
    return to.out.to_bytes();
}

} // namespace ise
