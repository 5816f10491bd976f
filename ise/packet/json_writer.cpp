#include <ise/core/little_endian.hpp>
#include <ise/packet/detail/text_forms.hpp>
#include <ise/packet/detail/walk.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise {

namespace {
class writer {
public:
    writer(detail::reader& in, json_style style, std::size_t max_json_bytes)
        : in_(in), pretty_(style == json_style::pretty), max_json_bytes_(max_json_bytes) {}

    bool value(const type_description& type) {
        if (text.size() > max_json_bytes_)
            return in_.fail(fmt::format("its JSON is longer than {} bytes (max_json_bytes)", max_json_bytes_),
                            errc::too_large);
        switch (type.kind) {
            case type_kind::string:
            case type_kind::opaque: {
                std::size_t size = 0;
                if (!detail::take_count_of(type, in_, size)) return false;
                bytes_view raw(in_.take(size), size);
                if (type.kind == type_kind::string) detail::append_json_string(text, as_text(raw));
                else text += '"' + detail::to_base64(raw) + '"';
                return true;
            }
            case type_kind::structure: return structure(type);
            case type_kind::tuple:
                return list('[', ']', type.members.size(), [&](std::size_t i) { return value(type.members[i].type); });
            case type_kind::array: return elements(type, static_cast<std::size_t>(type.length));
            case type_kind::vector:
            case type_kind::set:
            case type_kind::map: {
                std::size_t count = 0;
                return detail::take_count_of(type, in_, count) && elements(type, count);
            }
            case type_kind::optional: return optional(type.members[0].type);
            case type_kind::variant: {
                std::size_t index = 0;
                if (!detail::take_alternative(type, in_, index)) return false;
                return list('{', '}', 2, [&](std::size_t i) {
                    if (i == 0) return text += fmt::format("\"index\":{}{}", gap(), index), true;
                    text += fmt::format("\"value\":{}", gap());
                    return value(type.members[index].type) || in_.in_alternative(index);
                });
            }
            default: return scalar(type);
        }
    }

    std::string text;

private:
    std::string_view gap() const { return pretty_ ? " " : ""; }
    void line() {
        if (pretty_) text += fmt::format("\n{:{}}", "", 2 * depth_);
    }

    // Short lists of numbers stay on one line also for people.
    template <class F>
    bool list(char open, char close, std::size_t count, F&& one, bool flat = false) {
        text += open;
        ++depth_;
        for (std::size_t i = 0; i < count; ++i) {
            if (i != 0) text += flat && pretty_ ? ", " : ",";
            if (!flat) line();
            if (!one(i)) return false;
        }
        --depth_;
        if (count != 0 && !flat) line();
        text += close;
        return true;
    }

    bool structure(const type_description& type) {
        return list('{', '}', type.members.size(), [&](std::size_t i) {
            const auto& field = type.members[i];
            detail::append_json_string(text, field.name);
            text += ':';
            text += gap();
            return value(field.type) || in_.in_field(field.name);
        });
    }

    bool optional(const type_description& inner) {
        bool there = false;
        if (!detail::take_flag(in_, there)) return false;
        if (!there) return text += "null", true;
        if (inner.kind != type_kind::optional) return value(inner);
        // There, whatever is inside.
        return list(
            '[', ']', 1, [&](std::size_t) { return value(inner); }, true);
    }

    bool elements(const type_description& type, std::size_t count) {
        const auto& element = type.members[0].type;
        auto one = [&](std::size_t i) { return value(element) || in_.in_element(i); };
        if (type.kind == type_kind::map) {
            const auto& mapped = type.members[1].type;
            if (element.kind == type_kind::string)
                return list('{', '}', count, [&](std::size_t i) {
                    if (!value(element)) return in_.in_element(i);
                    text += ':';
                    text += gap();
                    return value(mapped) || in_.in_element(i);
                });
            return list('[', ']', count, [&](std::size_t i) {
                return list(
                           '[', ']', 2, [&](std::size_t k) { return value(k == 0 ? element : mapped); }, true) ||
                       in_.in_element(i);
            });
        }
        if (type.kind != type_kind::set && (element.kind == type_kind::byte || element.kind == type_kind::character)) {
            bytes_view raw(in_.here(), std::min(count, in_.left()));
            if (!in_.take(count) && count != 0) return in_.fail_short(count);
            if (element.kind == type_kind::byte) return text += '"' + detail::to_base64(raw) + '"', true;
            return characters(type, as_text(raw));
        }
        return list('[', ']', count, one, is_scalar(element.kind));
    }

    bool characters(const type_description& type, std::string_view raw) {
        if (detail::is_utf8(raw)) { // an array of chars is a text that its zeros end
            if (type.kind == type_kind::array) raw = raw.substr(0, raw.find_last_not_of('\0') + 1);
            detail::append_json_string(text, raw);
            return true;
        }
        return list(
            '[', ']', raw.size(),
            [&](std::size_t i) { return text += fmt::format("{}", static_cast<unsigned char>(raw[i])), true; }, true);
    }

    template <class T>
    T load(const std::byte* from) {
        return detail::load_little<T>(from);
    }

    bool number(type_kind kind, const std::byte* from) {
        switch (kind) {
            case type_kind::boolean:
                if (std::to_integer<unsigned>(*from) > 1)
                    return in_.fail_flag("a bool", std::to_integer<unsigned>(*from));
                return text += *from == std::byte{1} ? "true" : "false", true;
            case type_kind::character: {
                auto c = load<unsigned char>(from);
                if (c >= 0x20 && c < 0x7f) detail::append_json_string(text, std::string(1, static_cast<char>(c)));
                else text += fmt::format("{}", c);
                return true;
            }
            case type_kind::f32: return detail::append_json_number(text, load<float>(from)), true;
            case type_kind::f64: return detail::append_json_number(text, load<double>(from)), true;
            case type_kind::i8: return text += fmt::format("{}", load<std::int8_t>(from)), true;
            case type_kind::i16: return text += fmt::format("{}", load<std::int16_t>(from)), true;
            case type_kind::i32: return text += fmt::format("{}", load<std::int32_t>(from)), true;
            case type_kind::i64: return text += fmt::format("{}", load<std::int64_t>(from)), true;
            case type_kind::u16: return text += fmt::format("{}", load<std::uint16_t>(from)), true;
            case type_kind::u32: return text += fmt::format("{}", load<std::uint32_t>(from)), true;
            case type_kind::u64: return text += fmt::format("{}", load<std::uint64_t>(from)), true;
            default: return text += fmt::format("{}", load<std::uint8_t>(from)), true;
        }
    }

    bool scalar(const type_description& type) {
        const std::byte* from = in_.take(static_cast<std::size_t>(type.min_size));
        if (!from) return in_.fail_short(static_cast<std::size_t>(type.min_size));
        if (type.kind == type_kind::time_span || type.kind == type_kind::instant) {
            if (type.number == type_kind::i64) detail::append_json_time(text, type, load<std::int64_t>(from));
            else
                detail::append_json_number(text, load<double>(from) * static_cast<double>(type.period_num) /
                                                     static_cast<double>(type.period_den));
            return true;
        }
        if (type.kind != type_kind::enumeration) return number(type.kind, from);
        std::size_t before = text.size();
        number(type.number, from);
        std::string_view digits = std::string_view(text).substr(before);
        for (const auto& e : type.enumerators) {
            std::string value = type.number == type_kind::u64 ? fmt::format("{}", static_cast<std::uint64_t>(e.value))
                                                              : fmt::format("{}", e.value);
            if (value != digits) continue;
            text.resize(before);
            detail::append_json_string(text, e.name);
            break;
        }
        return true;
    }

    detail::reader& in_;
    bool pretty_;
    std::size_t max_json_bytes_;
    std::size_t depth_ = 0;
};
} // namespace

std::string to_json(const schema& of, bytes_view packet, json_style style, std::size_t max_json_bytes) {
    decode_limits limits;
    detail::reader in(packet, limits);
    writer to(in, style, max_json_bytes);
    if (!to.value(of.type()) || !in.finish()) throw error(in.take_failure(of.name()));
    return std::move(to.text);
}

} // namespace ise
