#include <ise/packet/detail/text_forms.hpp>
#include <ise/packet/detail/walk.hpp>
#include <ise/packet/schema.hpp>

#include <fmt/format.h>

#include <array>
#include <charconv>
#include <limits>
#include <set>

namespace ise {

namespace {
class parser {
public:
    parser(std::string_view text, const schema_limits& limits) : text_(text), limits_(limits) {}

    type_description whole() {
        type_description type = parse_type(0);
        if (at_ != text_.size()) wrong("the end");
        return type;
    }

private:
    [[noreturn]] void wrong(std::string_view expected) const {
        throw error(errc::malformed,
                    fmt::format("schema text, character {}: expected {}, found {}", at_, expected,
                                at_ < text_.size() ? fmt::format("'{}'", text_.substr(at_, 16)) : "the end"));
    }
    [[noreturn]] void too_many(std::string_view what, std::uint64_t most, std::string_view limit) const {
        throw error(errc::too_large,
                    fmt::format("schema text, character {}: {}, at most {} are accepted ({})", at_, what, most, limit));
    }

    bool take(char c) {
        if (at_ >= text_.size() || text_[at_] != c) return false;
        ++at_;
        return true;
    }
    void need(char c) {
        if (!take(c)) wrong(fmt::format("'{}'", c));
    }
    template <class Accepts>
    std::string_view take_while(Accepts accepts, std::string_view what) {
        std::size_t begin = at_;
        while (at_ < text_.size() && accepts(text_[at_])) ++at_;
        if (at_ == begin) wrong(what);
        if (at_ - begin > limits_.max_name_bytes)
            too_many("a name is too long: its bytes", limits_.max_name_bytes, "max_name_bytes");
        auto taken = text_.substr(begin, at_ - begin);
        if (!detail::is_utf8(taken)) at_ = begin, wrong("a name in UTF-8"); // JSON could not name the field
        return taken;
    }
    std::string_view word() { return take_while(detail::is_name_char, "a name"); }
    template <class T>
    T number() {
        std::size_t begin = at_;
        T value{};
        auto [end, failed] = std::from_chars(text_.data() + at_, text_.data() + text_.size(), value);
        if (failed != std::errc()) wrong("a number in range");
        at_ = static_cast<std::size_t>(end - text_.data());
        // One number, one text: otherwise equal schemas had two fingerprints' worth of texts.
        if (text_.substr(begin, at_ - begin) != fmt::format("{}", value))
            at_ = begin, wrong("a number without leading zeros");
        return value;
    }

    static bool find_scalar(std::string_view name, type_kind& kind) {
        for (int i = 0; i <= static_cast<int>(type_kind::f64); ++i)
            if (name_of(static_cast<type_kind>(i)) == name) return kind = static_cast<type_kind>(i), true;
        return false;
    }

    type_description parse_type(std::size_t depth) {
        if (depth >= limits_.max_depth)
            too_many("the types are nested too deep: levels", limits_.max_depth, "max_depth");
        if (++types_ > limits_.max_types) too_many("too many types", limits_.max_types, "max_types");
        std::size_t begin = at_;
        std::string_view name = word();
        type_description type;
        if (find_scalar(name, type.kind)) {
        } else if (name == "string") type.kind = type_kind::string;
        else if (name == "struct") parse_struct(type, depth);
        else if (name == "enum") parse_enum(type);
        else if (name == "vector") parse_members(type, type_kind::vector, 1, 1, depth);
        else if (name == "set") parse_members(type, type_kind::set, 1, 1, depth);
        else if (name == "optional") parse_members(type, type_kind::optional, 1, 1, depth);
        else if (name == "map") parse_members(type, type_kind::map, 2, 2, depth);
        else if (name == "variant") parse_members(type, type_kind::variant, 1, limits_.max_members, depth);
        else if (name == "tuple") parse_members(type, type_kind::tuple, 0, limits_.max_members, depth);
        else if (name == "array") parse_array(type, depth);
        else if (name == "duration") parse_time(type, type_kind::time_span);
        else if (name == "time") parse_time(type, type_kind::instant);
        else if (name == "opaque") parse_opaque(type);
        else at_ = begin, wrong("a type");
        type.complete();
        if (type.min_size > limits_.max_min_size)
            too_many("a value is too big: its bytes", limits_.max_min_size, "max_min_size");
        return type;
    }

    void parse_members(type_description& type, type_kind kind, std::size_t least, std::size_t most, std::size_t depth) {
        type.kind = kind;
        need('<');
        if (least == 0 && take('>')) return;
        do {
            if (type.members.size() == most) {
                if (kind == type_kind::variant || kind == type_kind::tuple)
                    too_many("too many alternatives", most, "max_members");
                wrong("'>'");
            }
            type.members.push_back({{}, parse_type(depth + 1), {}});
        } while (take(','));
        if (type.members.size() < least) wrong("','");
        need('>');
    }

    void parse_array(type_description& type, std::size_t depth) {
        type.kind = type_kind::array;
        need('<');
        type.members.push_back({{}, parse_type(depth + 1), {}});
        need(',');
        type.length = number<std::uint64_t>();
        if (type.length > limits_.max_array_length)
            too_many("an array is too long: its elements", limits_.max_array_length, "max_array_length");
        need('>');
    }

    void parse_time(type_description& type, type_kind kind) {
        type.kind = kind;
        need('<');
        if (!find_scalar(word(), type.number) || (type.number != type_kind::i64 && type.number != type_kind::f64))
            wrong("i64 or f64 before this");
        need(',');
        type.period_num = number<std::int64_t>();
        need('/');
        type.period_den = number<std::int64_t>();
        if (type.period_num <= 0 || type.period_den <= 0) wrong("a positive period before this");
        need('>');
    }

    void parse_opaque(type_description& type) {
        type.kind = type_kind::opaque;
        need('<');
        type.name =
            take_while([](char c) { return detail::is_name_char(c) || c == '.' || c == ':' || c == '/' || c == '-'; },
                       "the name of an opaque type");
        need(',');
        type.version = number<std::uint32_t>();
        need('>');
    }

    void parse_enum(type_description& type) {
        type.kind = type_kind::enumeration;
        if (take(' ')) type.name = word();
        need(':');
        if (!find_scalar(word(), type.number) || type.number < type_kind::i8 || type.number > type_kind::u64)
            wrong("an integer type before this");
        need('{');
        if (take('}')) return;
        std::set<std::string_view> names;
        std::set<std::int64_t> values;
        do {
            if (type.enumerators.size() == limits_.max_enumerators)
                too_many("too many enumerators", limits_.max_enumerators, "max_enumerators");
            std::string_view name = word();
            need('=');
            std::int64_t value = type.number == type_kind::u64 ? static_cast<std::int64_t>(number<std::uint64_t>())
                                                               : number<std::int64_t>();
            if (!fits(type.number, value)) wrong("a value in the enum's range before this");
            if (!names.insert(name).second || !values.insert(value).second)
                wrong("an enumerator of its own before this");
            type.enumerators.push_back({std::string(name), value});
        } while (take(','));
        need('}');
    }

    static bool fits(type_kind number, std::int64_t value) {
        std::size_t bits = size_of(number) * 8;
        if (bits == 64) return true;
        bool is_signed = number == type_kind::i8 || number == type_kind::i16 || number == type_kind::i32;
        if (is_signed) return value >= -(std::int64_t{1} << (bits - 1)) && value < (std::int64_t{1} << (bits - 1));
        return value >= 0 && value < (std::int64_t{1} << bits);
    }

    void parse_struct(type_description& type, std::size_t depth) {
        type.kind = type_kind::structure;
        if (take(' ')) type.name = word();
        need('{');
        if (take('}')) return;
        std::set<std::string_view> names;
        do {
            if (type.members.size() == limits_.max_members)
                too_many("too many fields", limits_.max_members, "max_members");
            std::string_view name = word();
            if (!names.insert(name).second) wrong("a field name of its own before this");
            need(':');
            type_member field{std::string(name), parse_type(depth + 1), {}};
            if (take('=')) field.preset = parse_preset(field.type);
            type.members.push_back(std::move(field));
        } while (take(','));
        need('}');
    }

    static int digit(char c) { return c >= '0' && c <= '9' ? c - '0' : c >= 'a' && c <= 'f' ? c - 'a' + 10 : -1; }

    bytes parse_preset(const type_description& type) {
        bytes preset;
        while (at_ + 1 < text_.size() && digit(text_[at_]) >= 0 && digit(text_[at_ + 1]) >= 0) {
            preset.push_back(static_cast<std::byte>(digit(text_[at_]) * 16 + digit(text_[at_ + 1])));
            at_ += 2;
        }
        decode_limits limits;
        detail::reader in(preset, limits);
        if (!detail::skip(type, in) || !in.finish()) {
            failure why = in.take_failure("the default value");
            throw error(why.code(), fmt::format("schema text, character {}: {}", at_, why.message()));
        }
        return preset;
    }

    std::string_view text_;
    const schema_limits& limits_;
    std::size_t at_ = 0;
    std::size_t types_ = 0;
};
} // namespace

result<schema> schema::parse(std::string_view canonical_text, const schema_limits& limits) {
    if (canonical_text.size() > limits.max_text_bytes)
        return failure(errc::too_large,
                       fmt::format("a schema text of {} bytes, at most {} are accepted (max_text_bytes)",
                                   canonical_text.size(), limits.max_text_bytes));
    try {
        return schema(parser(canonical_text, limits).whole());
    } catch (const error& why) {
        return why.why();
    }
}

} // namespace ise
