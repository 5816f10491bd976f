#include <ise/packet/dynamic.hpp>

#include <ise/core/little_endian.hpp>
#include <ise/packet/detail/walk.hpp>

#include <fmt/format.h>

#include <charconv>
#include <cmath>

namespace ise {

namespace {
type_kind number_of(const type_description& type) noexcept {
    bool inside =
        type.kind == type_kind::enumeration || type.kind == type_kind::time_span || type.kind == type_kind::instant;
    return inside ? type.number : type.kind;
}

bool is_unsigned(type_kind kind) noexcept {
    return kind == type_kind::u8 || kind == type_kind::u16 || kind == type_kind::u32 || kind == type_kind::u64 ||
           kind == type_kind::boolean || kind == type_kind::byte || kind == type_kind::character;
}

bool is_real(type_kind kind) noexcept { return kind == type_kind::f32 || kind == type_kind::f64; }

// An integer of any width, sign-extended where it has a sign.
std::uint64_t load_integer(type_kind kind, bytes_view raw) noexcept {
    std::uint64_t value = 0;
    for (std::size_t i = 0; i < raw.size() && i < 8; ++i) value |= std::to_integer<std::uint64_t>(raw[i]) << (8 * i);
    std::size_t bits = raw.size() * 8;
    if (!is_unsigned(kind) && bits < 64 && bits > 0 && (value >> (bits - 1) & 1) != 0)
        value |= ~std::uint64_t{0} << bits;
    return value;
}
} // namespace

void field_view::wrong(std::string_view wanted) const {
    throw error(errc::type_mismatch, fmt::format("{}: is {}, not {}", path_, short_text(*type_), wanted));
}

std::int64_t field_view::ranged(std::int64_t value, std::int64_t low, std::int64_t high) const {
    if (value < low || value > high) wrong(fmt::format("a number from {} to {} (it is {})", low, high, value));
    return value;
}

std::uint64_t field_view::ranged(std::uint64_t value, std::uint64_t high) const {
    if (value > high) wrong(fmt::format("a number up to {} (it is {})", high, value));
    return value;
}

bool field_view::as_bool() const {
    if (kind() != type_kind::boolean) wrong("a bool");
    return raw_[0] == std::byte{1};
}

std::int64_t field_view::as_int() const {
    type_kind number = number_of(*type_);
    if (!is_scalar(number) || is_real(number) || number == type_kind::boolean) wrong("an integer");
    std::uint64_t value = load_integer(number, raw_);
    if (is_unsigned(number) && value > static_cast<std::uint64_t>(std::numeric_limits<std::int64_t>::max()))
        wrong(fmt::format("an integer below 2^63 (it is {})", value));
    return static_cast<std::int64_t>(value);
}

std::uint64_t field_view::as_uint() const {
    type_kind number = number_of(*type_);
    if (!is_scalar(number) || is_real(number) || number == type_kind::boolean) wrong("an integer");
    std::uint64_t value = load_integer(number, raw_);
    if (!is_unsigned(number) && static_cast<std::int64_t>(value) < 0)
        wrong(fmt::format("an integer without sign (it is {})", static_cast<std::int64_t>(value)));
    return value;
}

double field_view::as_double() const {
    type_kind number = number_of(*type_);
    double value = 0;
    if (number == type_kind::f64) value = detail::load_little<double>(raw_.data());
    else if (number == type_kind::f32) value = static_cast<double>(detail::load_little<float>(raw_.data()));
    else if (!is_scalar(number) || number == type_kind::boolean) wrong("a number");
    else if (is_unsigned(number)) value = static_cast<double>(load_integer(number, raw_));
    else value = static_cast<double>(static_cast<std::int64_t>(load_integer(number, raw_)));
    if (kind() == type_kind::time_span || kind() == type_kind::instant)
        value = value * static_cast<double>(type_->period_num) / static_cast<double>(type_->period_den);
    return value;
}

std::string field_view::as_string() const {
    if (kind() == type_kind::string) return std::string(as_text(raw_.subspan(4)));
    if (kind() == type_kind::character) return std::string(as_text(raw_));
    std::string text = to_json();
    if (kind() == type_kind::enumeration && text.starts_with('"')) text = text.substr(1, text.size() - 2);
    return text;
}

bool field_view::is_null() const { return kind() == type_kind::optional && raw_[0] == std::byte{0}; }

std::size_t field_view::size() const {
    switch (kind()) {
        case type_kind::string:
        case type_kind::vector:
        case type_kind::set:
        case type_kind::map:
        case type_kind::opaque: return detail::load_little<std::uint32_t>(raw_.data());
        case type_kind::array: return static_cast<std::size_t>(type_->length);
        case type_kind::tuple:
        case type_kind::structure: return type_->members.size();
        default: wrong("a container");
    }
}

std::string field_view::to_json() const { return ise::to_json(schema(*type_), raw_); }

dynamic_packet::dynamic_packet(schema of, bytes encoded, const decode_limits& limits)
    : schema_(std::move(of)), encoded_(std::move(encoded)) {
    detail::reader in(encoded_, limits);
    if (!detail::skip(schema_.type(), in) || !in.finish()) throw error(in.take_failure(schema_.name()));
}

dynamic_packet dynamic_packet::from_json(schema of, std::string_view json, const json_limits& limits) {
    bytes encoded = ise::from_json(of, json, limits);
    return dynamic_packet(std::move(of), std::move(encoded));
}

namespace {
// Steps into a value; the bytes were checked before, so that the reader does not fail.
class finder {
public:
    finder(const type_description& root, bytes_view encoded, std::string_view path)
        : type(&root), path_(path), limits_(trusting()), in_(encoded, limits_) {}

    const type_description* type;

    bytes_view find() {
        std::string_view rest = path_;
        while (!rest.empty()) {
            look_through();
            if (rest[0] == '[') {
                std::size_t index = 0;
                auto [end, failed] = std::from_chars(rest.data() + 1, rest.data() + rest.size(), index);
                if (failed != std::errc() || end == rest.data() + rest.size() || *end != ']')
                    no("expected [number]", rest);
                into_element(index, rest);
                rest.remove_prefix(static_cast<std::size_t>(end - rest.data()) + 1);
            } else {
                if (rest[0] == '.') rest.remove_prefix(1);
                std::string_view name = rest.substr(0, rest.find_first_of(".["));
                into_field(name, rest);
                rest.remove_prefix(name.size());
            }
        }
        const std::byte* start = in_.here();
        std::size_t before = in_.left();
        detail::skip(*type, in_);
        return {start, before - in_.left()};
    }

private:
    // The bytes were accepted when the packet was made.
    static decode_limits trusting() {
        decode_limits limits;
        limits.max_zero_size_elements = std::numeric_limits<std::size_t>::max();
        return limits;
    }

    [[noreturn]] void no(std::string_view why, std::string_view rest) const {
        std::string_view done = path_.substr(0, path_.size() - rest.size());
        if (done.ends_with('.')) done.remove_suffix(1);
        throw error(errc::invalid_argument, fmt::format("no field '{}': {} in {}", path_, why,
                                                        done.empty() ? "the packet" : fmt::format("'{}'", done)));
    }

    void look_through() {
        while (type->kind == type_kind::optional || type->kind == type_kind::variant) {
            if (type->kind == type_kind::variant) {
                std::size_t index = 0;
                detail::take_alternative(*type, in_, index);
                type = &type->members[index].type;
            } else {
                bool there = false;
                detail::take_flag(in_, there);
                if (!there)
                    throw error(errc::invalid_argument,
                                fmt::format("no field '{}': an optional on the way has no value", path_));
                type = &type->members[0].type;
            }
        }
    }

    void into_element(std::size_t index, std::string_view rest) {
        std::size_t count = static_cast<std::size_t>(type->length);
        bool counted = type->kind == type_kind::vector || type->kind == type_kind::set || type->kind == type_kind::map;
        if (!counted && type->kind != type_kind::array) no(fmt::format("{} has no elements", short_text(*type)), rest);
        if (counted) detail::take_count_of(*type, in_, count);
        if (index >= count) no(fmt::format("element {} of {}", index, count), rest);
        if (type->members.size() == 1 && type->members[0].type.fixed_size) {
            in_.take(index * static_cast<std::size_t>(type->members[0].type.min_size));
        } else {
            for (std::size_t i = 0; i < index; ++i)
                for (const auto& member : type->members) detail::skip(member.type, in_);
        }
        if (type->kind == type_kind::map) detail::skip(type->members[0].type, in_); // to the value
        type = &type->members.back().type;
    }

    void into_field(std::string_view name, std::string_view rest) {
        if (type->kind == type_kind::map && type->members[0].type.kind == type_kind::string)
            return into_key(name, rest);
        if (type->kind != type_kind::structure && type->kind != type_kind::tuple)
            no(fmt::format("{} has no fields", short_text(*type)), rest);
        for (std::size_t i = 0; i < type->members.size(); ++i) {
            const auto& member = type->members[i];
            if (type->kind == type_kind::tuple ? name == std::to_string(i) : name == member.name) {
                type = &member.type;
                return;
            }
            detail::skip(member.type, in_);
        }
        std::string known;
        for (const auto& member : type->members) known += (known.empty() ? "" : ", ") + member.name;
        no(fmt::format("'{}' is none of {}", name, known), rest);
    }

    void into_key(std::string_view name, std::string_view rest) {
        std::size_t count = 0;
        detail::take_count_of(*type, in_, count);
        for (std::size_t i = 0; i < count; ++i) {
            std::size_t size = 0;
            detail::take_count_of(type->members[0].type, in_, size);
            bool same = as_text({in_.here(), size}) == name;
            in_.take(size);
            if (same) {
                type = &type->members[1].type;
                return;
            }
            detail::skip(type->members[1].type, in_);
        }
        no(fmt::format("no key '{}'", name), rest);
    }

    std::string_view path_;
    decode_limits limits_;
    detail::reader in_;
};
} // namespace

field_view dynamic_packet::field(std::string_view path) const {
    finder find(schema_.type(), encoded_, path);
    bytes_view raw = find.find();
    return field_view(*find.type, raw, path.empty() ? schema_.name() : std::string(path));
}

} // namespace ise
