#include <ise/bag/protobuf.hpp>

#include <ise/core/little_endian.hpp>
#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <cstring>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#ifndef __SIZEOF_INT128__
    #include <boost/multiprecision/cpp_int.hpp>
#endif

namespace ise::bag {
namespace {

// google/protobuf/descriptor.proto
enum class field_type : std::uint8_t {
    f64 = 1,
    f32 = 2,
    u64 = 4,
    boolean = 8,
    text = 9,
    message = 11,
    blob = 12,
    u32 = 13,
    enumeration = 14,
    s32 = 17,
    s64 = 18,
};
enum class wire : std::uint8_t { varint = 0, fixed64 = 1, block = 2, fixed32 = 5 };
enum class presence : std::uint8_t { implicit, optional, repeated, oneof };
enum class shape : std::uint8_t { fields, variant, wrapper, instant, time_span };

#ifdef __SIZEOF_INT128__
__extension__ using wide = __int128;
#else // a processor of 32 bits
using wide = boost::multiprecision::int128_t;
#endif

constexpr std::size_t max_messages = 16384; // of one schema
// Structs without fields take no bytes in a packet, so that its size does not bound their number.
constexpr std::size_t max_empty_values = 65536; // of one packet, and one more for each byte that is converted
constexpr std::size_t max_runs = 65536;         // of one message: fields of one number that follow one another

// Counts the values without bytes of one packet.
class empty_values {
public:
    explicit empty_values(std::size_t bytes) : left_(max_empty_values + bytes), most_(left_) {}
    void count(const type_description& type) {
        if (type.min_size > 0) return;
        if (left_ == 0)
            throw error(errc::too_large,
                        fmt::format("the packet has more than {} values without bytes (max_empty_values)", most_));
        --left_;
    }

private:
    std::size_t left_, most_;
};

// --- writing protobuf ------------------------------------------------------------------------------------------------

void put_varint(buffer& to, std::uint64_t value) {
    while (value >= 0x80) {
        to.append(static_cast<std::uint8_t>(value | 0x80));
        value >>= 7;
    }
    to.append(static_cast<std::uint8_t>(value));
}

void put_tag(buffer& to, std::uint32_t field, wire type) {
    put_varint(to, std::uint64_t{field} << 3 | static_cast<std::uint8_t>(type));
}

void put_number(buffer& to, std::uint32_t field, std::uint64_t value) {
    put_tag(to, field, wire::varint);
    put_varint(to, value);
}

void put_block(buffer& to, std::uint32_t field, bytes_view content) {
    put_tag(to, field, wire::block);
    put_varint(to, content.size());
    to.append(content);
}

void put_text(buffer& to, std::uint32_t field, std::string_view text) { put_block(to, field, as_bytes(text)); }

// A field whose content is appended by `fill`.
template <class Fill>
void put_nested(buffer& to, std::uint32_t field, Fill fill) {
    put_tag(to, field, wire::block);
    auto from = to.size();
    fill();
    auto size = to.size() - from;
    std::size_t length_bytes = 1;
    for (auto left = size; left >= 0x80; left >>= 7) ++length_bytes;
    to.grow(length_bytes);
    std::memmove(to.data() + from + length_bytes, to.data() + from, size);
    auto* at = to.data() + from;
    for (auto left = size;; left >>= 7) {
        *at++ = static_cast<std::byte>((left & 0x7f) | (left >= 0x80 ? 0x80 : 0));
        if (left < 0x80) break;
    }
}

std::uint64_t zigzag(std::int64_t value) noexcept {
    return static_cast<std::uint64_t>(value) << 1 ^ static_cast<std::uint64_t>(value >> 63);
}
std::int64_t unzigzag(std::uint64_t value) noexcept {
    return static_cast<std::int64_t>(value >> 1 ^ (~(value & 1) + 1));
}

// --- the plan --------------------------------------------------------------------------------------------------------

struct message_plan;

struct field_plan {
    std::string name;
    std::uint32_t number = 1;
    presence how = presence::implicit;
    field_type type = field_type::message;
    std::string type_name;                   // of a message or an enum
    const type_description* of = nullptr;    // of one value: of an element where it is repeated
    const type_description* whole = nullptr; // of the field
    const message_plan* message = nullptr;
    bool packs() const noexcept {
        return type != field_type::text && type != field_type::blob && type != field_type::message;
    }
};

struct message_plan {
    shape form = shape::fields;
    std::string name; // within its root
    std::string full_name;
    bool map_entry = false;
    const type_description* of = nullptr;
    std::vector<field_plan> fields;
};

struct enum_plan {
    std::string name; // of the message around it
    const type_description* of = nullptr;
};

// What proto3 takes as a name.
std::string identifier(std::string_view name) {
    std::string made;
    for (char letter : name) {
        auto c = static_cast<unsigned char>(letter);
        if ((c >= '0' && c <= '9') || (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || c == '_')
            made += static_cast<char>(c);
        else made += fmt::format("x{:02x}", c);
    }
    if (made.empty() || (made[0] >= '0' && made[0] <= '9')) made.insert(made.begin(), '_');
    return made;
}

std::string unused(std::string name, std::set<std::string>& taken) {
    auto first = name;
    for (int n = 2; !taken.insert(name).second; ++n) name = fmt::format("{}_{}", first, n);
    return name;
}

// Equal for types that have the same message.
void describe(const type_description& type, std::string& to) {
    to += fmt::format("{}.{}.{}.{}.{}.{}({}:{}", static_cast<int>(type.kind), static_cast<int>(type.number),
                      type.length, type.period_num, type.period_den, type.version, type.name.size(), type.name);
    for (const auto& one : type.enumerators) to += fmt::format("{}={},", one.name, one.value);
    for (const auto& one : type.members) {
        to += fmt::format("{}:{}", one.name.size(), one.name);
        describe(one.type, to);
    }
    to += ')';
}

bool is_list(type_kind kind) noexcept {
    return kind == type_kind::vector || kind == type_kind::set || kind == type_kind::array;
}

bool is_blob(const type_description& type) noexcept {
    if (type.kind != type_kind::vector && type.kind != type_kind::array) return false;
    auto of = type.members[0].type.kind;
    return of == type_kind::byte || of == type_kind::u8 || of == type_kind::character;
}

// Whether one field without `repeated` has it.
bool is_single(const type_description& type) noexcept {
    if (is_blob(type)) return true;
    return !is_list(type.kind) && type.kind != type_kind::map && type.kind != type_kind::optional;
}

bool is_proto_enum(const type_description& type) noexcept {
    return type.number != type_kind::u32 && type.number != type_kind::i64 && type.number != type_kind::u64;
}

class planner {
public:
    planner(std::vector<std::unique_ptr<message_plan>>& messages, std::vector<enum_plan>& enums, std::string root)
        : messages_(messages), enums_(enums), root_(std::move(root)) {}

    bool uses_instant = false, uses_time_span = false;

    const message_plan* root(const type_description& type) {
        auto& made = add(root_, type);
        made.full_name = "ise." + root_;
        if (is_single(type) && type.kind == type_kind::structure) fill_fields(made, type);
        else if (type.kind == type_kind::tuple) fill_fields(made, type);
        else if (type.kind == type_kind::variant) fill_variant(made, type);
        else fill_wrapper(made, type);
        return &made;
    }

private:
    message_plan& add(std::string name, const type_description& of) {
        if (messages_.size() >= max_messages)
            throw error(errc::too_large, fmt::format("a schema has more than {} types of messages", max_messages));
        messages_.push_back(std::make_unique<message_plan>());
        auto& made = *messages_.back();
        made.name = std::move(name);
        made.full_name = fmt::format("ise.{}.{}", root_, made.name);
        made.of = &of;
        return made;
    }

    void fill_fields(message_plan& made, const type_description& type) {
        std::set<std::string> taken;
        std::uint32_t number = 0;
        for (const auto& member : type.members) {
            auto name = type.kind == type_kind::tuple ? fmt::format("item_{}", number) : identifier(member.name);
            auto field = field_of(member.type, name);
            field.name = unused(name, taken);
            field.number = ++number;
            made.fields.push_back(std::move(field));
        }
    }
    void fill_variant(message_plan& made, const type_description& type) {
        made.form = shape::variant;
        std::uint32_t number = 0;
        std::set<std::string> taken;
        for (const auto& member : type.members) {
            auto name = member.type.name.empty() ? fmt::format("alternative_{}", number) : identifier(member.type.name);
            auto field = value_of(member.type, name);
            field.how = presence::oneof;
            field.name = unused(name, taken);
            field.number = ++number;
            made.fields.push_back(std::move(field));
        }
    }
    void fill_wrapper(message_plan& made, const type_description& type) {
        made.form = shape::wrapper;
        auto field = field_of(type, "value");
        field.name = "value";
        made.fields.push_back(std::move(field));
    }

    field_plan field_of(const type_description& type, const std::string& name) {
        field_plan made;
        if (is_single(type)) {
            made = value_of(type, name);
        } else if (is_list(type.kind)) {
            made = value_of(type.members[0].type, name);
            made.how = presence::repeated;
        } else if (type.kind == type_kind::optional) {
            made = value_of(type.members[0].type, name);
            made.how = presence::optional;
        } else { // a map
            made.of = &type;
            made.type = field_type::message;
            made.how = presence::repeated;
            auto& entry = add(unused(identifier(name) + "_entry", names_), type);
            entry.fields.push_back(field_or_wrapped(type.members[0].type, "key", 1));
            entry.fields.push_back(field_or_wrapped(type.members[1].type, "value", 2));
            auto key = entry.fields[0].type;
            // A map's entry has no wrapper of its own name: what protobuf calls a map needs a plain key.
            entry.map_entry = key != field_type::message && key != field_type::enumeration && key != field_type::f32 &&
                              key != field_type::f64 && key != field_type::blob;
            made.message = &entry;
            made.type_name = entry.full_name;
        }
        made.whole = &type;
        return made;
    }
    field_plan field_or_wrapped(const type_description& type, const std::string& name, std::uint32_t number) {
        auto made = value_of(type, name);
        made.name = name;
        made.number = number;
        return made;
    }

    field_plan value_of(const type_description& type, const std::string& name) {
        field_plan made;
        made.of = made.whole = &type;
        if (!is_single(type)) {
            auto& wrapper = add(unused(identifier(name) + "_value", names_), type);
            fill_wrapper(wrapper, type);
            made.message = &wrapper;
            made.type_name = wrapper.full_name;
            return made;
        }
        switch (type.kind) {
            case type_kind::boolean: made.type = field_type::boolean; break;
            case type_kind::character:
            case type_kind::byte:
            case type_kind::u8:
            case type_kind::u16:
            case type_kind::u32: made.type = field_type::u32; break;
            case type_kind::i8:
            case type_kind::i16:
            case type_kind::i32: made.type = field_type::s32; break;
            case type_kind::i64: made.type = field_type::s64; break;
            case type_kind::u64: made.type = field_type::u64; break;
            case type_kind::f32: made.type = field_type::f32; break;
            case type_kind::f64: made.type = field_type::f64; break;
            case type_kind::string: made.type = field_type::text; break;
            case type_kind::opaque: made.type = field_type::blob; break;
            case type_kind::vector:
            case type_kind::array:
                made.type = type.members[0].type.kind == type_kind::character ? field_type::text : field_type::blob;
                break;
            case type_kind::enumeration:
                if (!is_proto_enum(type)) {
                    made.type = type.number == type_kind::i64   ? field_type::s64
                                : type.number == type_kind::u64 ? field_type::u64
                                                                : field_type::u32;
                    break;
                }
                made.type = field_type::enumeration;
                made.type_name = enum_of(type, name);
                break;
            case type_kind::time_span:
                if (type.number == type_kind::f64) {
                    made.type = field_type::f64;
                    break;
                }
                uses_time_span = true;
                made.type_name = "google.protobuf.Duration";
                made.message = &time_span_;
                break;
            case type_kind::instant:
                if (type.number == type_kind::f64) {
                    made.type = field_type::f64;
                    break;
                }
                uses_instant = true;
                made.type_name = "google.protobuf.Timestamp";
                made.message = &instant_;
                break;
            case type_kind::structure:
            case type_kind::tuple:
            case type_kind::variant: {
                made.message = message_of(type, name);
                made.type_name = made.message->full_name;
                break;
            }
            case type_kind::set:
            case type_kind::map:
            case type_kind::optional: break; // not single
        }
        return made;
    }

    const message_plan* message_of(const type_description& type, const std::string& field) {
        std::string key;
        describe(type, key);
        if (auto known = known_.find(key); known != known_.end()) return known->second;
        auto& made = add(unused(identifier(type.name.empty() ? field + "_type" : type.name), names_), type);
        known_[key] = &made;
        if (type.kind == type_kind::variant) fill_variant(made, type);
        else fill_fields(made, type);
        return &made;
    }

    std::string enum_of(const type_description& type, const std::string& field) {
        std::string key;
        describe(type, key);
        auto& known = known_enums_[key];
        if (known.empty()) {
            known = unused(identifier(type.name.empty() ? field + "_enum" : type.name), names_);
            enums_.push_back({known, &type});
        }
        return fmt::format("ise.{}.{}.value", root_, known);
    }

    static inline const message_plan instant_{shape::instant, {}, {}, false, nullptr, {}};
    static inline const message_plan time_span_{shape::time_span, {}, {}, false, nullptr, {}};

    std::vector<std::unique_ptr<message_plan>>& messages_;
    std::vector<enum_plan>& enums_;
    std::string root_;
    std::set<std::string> names_;
    std::map<std::string, const message_plan*> known_;
    std::map<std::string, std::string> known_enums_;
};

// --- descriptors -----------------------------------------------------------------------------------------------------

void put_field(buffer& to, const field_plan& field, std::optional<std::uint32_t> oneof) {
    put_nested(to, 2, [&] {
        put_text(to, 1, field.name);
        put_number(to, 3, field.number);
        put_number(to, 4, field.how == presence::repeated ? 3 : 1); // label
        put_number(to, 5, static_cast<std::uint8_t>(field.type));
        if (!field.type_name.empty()) put_text(to, 6, "." + field.type_name);
        if (oneof) put_number(to, 9, *oneof);
        put_text(to, 10, field.name); // in JSON as in ISE's
        if (field.how == presence::optional) put_number(to, 17, 1);
    });
}

void put_message_content(buffer& to, const message_plan& message) {
    put_text(to, 1, message.name);
    std::vector<std::string> oneofs;
    if (message.form == shape::variant && !message.fields.empty()) oneofs.push_back("value");
    for (const auto& field : message.fields) {
        std::optional<std::uint32_t> oneof;
        if (field.how == presence::oneof) oneof = 0;
        if (field.how == presence::optional) {
            oneof = static_cast<std::uint32_t>(oneofs.size());
            oneofs.push_back("_" + field.name);
        }
        put_field(to, field, oneof);
    }
    if (message.map_entry) put_nested(to, 7, [&] { put_number(to, 7, 1); });
    std::set<std::string> taken;
    for (const auto& field : message.fields) taken.insert(field.name);
    for (const auto& name : oneofs) put_nested(to, 8, [&] { put_text(to, 1, unused(name, taken)); });
}

// An enum within a message, so that its enumerators collide with nothing.
void put_enum(buffer& to, const enum_plan& one) {
    put_nested(to, 3, [&] {
        put_text(to, 1, one.name);
        put_nested(to, 4, [&] {
            put_text(to, 1, "value");
            std::set<std::string> taken;
            std::set<std::int64_t> values;
            bool alias = false;
            auto put_value = [&](const std::string& name, std::int64_t value) {
                alias |= !values.insert(value).second;
                put_nested(to, 2, [&] {
                    put_text(to, 1, name);
                    put_number(to, 2, static_cast<std::uint64_t>(value));
                });
            };
            const auto& all = one.of->enumerators;
            // The first of proto3 is zero.
            bool zero = false;
            for (const auto& e : all)
                if (e.value == 0) put_value(unused(identifier(e.name), taken), 0), zero = true;
            if (!zero) {
                for (const auto& e : all) taken.insert(identifier(e.name));
                put_value(unused("no_enumerator", taken), 0);
                taken.clear();
                taken.insert("no_enumerator");
            }
            for (const auto& e : all)
                if (e.value != 0 && e.value >= std::numeric_limits<std::int32_t>::min() &&
                    e.value <= std::numeric_limits<std::int32_t>::max())
                    put_value(unused(identifier(e.name), taken), e.value);
            if (alias) put_nested(to, 3, [&] { put_number(to, 2, 1); });
        });
    });
}

void put_well_known(buffer& to, const char* file, const char* name) {
    put_nested(to, 1, [&] {
        put_text(to, 1, file);
        put_text(to, 2, "google.protobuf");
        put_nested(to, 4, [&] {
            put_text(to, 1, name);
            auto put = [&](const char* field, std::uint32_t number, std::uint32_t type) {
                put_nested(to, 2, [&] {
                    put_text(to, 1, field);
                    put_number(to, 3, number);
                    put_number(to, 4, 1);
                    put_number(to, 5, type);
                    put_text(to, 10, field);
                });
            };
            put("seconds", 1, 3); // int64
            put("nanos", 2, 5);   // int32
        });
        put_text(to, 12, "proto3");
    });
}

// --- packet to message -----------------------------------------------------------------------------------------------

class packet_bytes {
public:
    explicit packet_bytes(bytes_view all) : left_(all) {}
    bytes_view take(std::uint64_t count) {
        if (count > left_.size()) throw error(errc::malformed, "the packet ends within a value");
        auto got = left_.first(static_cast<std::size_t>(count));
        left_ = left_.subspan(got.size());
        return got;
    }
    template <class T>
    T number() {
        return detail::load_little<T>(take(sizeof(T)).data());
    }
    bool empty() const noexcept { return left_.empty(); }
    std::size_t left() const noexcept { return left_.size(); }

private:
    bytes_view left_;
};

std::int64_t signed_number(packet_bytes& in, type_kind kind) {
    switch (kind) {
        case type_kind::i8: return in.number<std::int8_t>();
        case type_kind::i16: return in.number<std::int16_t>();
        case type_kind::i32: return in.number<std::int32_t>();
        default: return in.number<std::int64_t>();
    }
}

std::uint64_t unsigned_number(packet_bytes& in, type_kind kind) {
    switch (kind) {
        case type_kind::u16: return in.number<std::uint16_t>();
        case type_kind::u32: return in.number<std::uint32_t>();
        case type_kind::u64: return in.number<std::uint64_t>();
        default: return in.number<std::uint8_t>();
    }
}

bool is_signed(type_kind kind) noexcept {
    return kind == type_kind::i8 || kind == type_kind::i16 || kind == type_kind::i32 || kind == type_kind::i64;
}

void append_utf8(buffer& to, std::string_view text) {
    if (detail::is_utf8(text)) return to.append(as_bytes(text));
    for (std::size_t at = 0; at < text.size();) {
        std::size_t good = 0;
        for (std::size_t n = 1; n <= 4 && at + n <= text.size() && good == 0; ++n)
            if (detail::is_utf8(text.substr(at, n))) good = n;
        to.append(as_bytes(good ? text.substr(at, good) : std::string_view("\xef\xbf\xbd")));
        at += std::max<std::size_t>(good, 1);
    }
}

// Whole seconds and nanoseconds of ticks, rounded towards the past; nothing beyond 64 bits.
void put_time(buffer& to, const type_description& type, std::int64_t ticks, bool span) {
    wide scaled = wide{ticks} * type.period_num;
    wide den = std::max<std::int64_t>(type.period_den, 1);
    wide seconds = scaled / den, rest = scaled % den;
    if (rest < 0) --seconds, rest += den;
    auto nanos = static_cast<std::int64_t>(rest * 1'000'000'000 / den);
    if (span && seconds < 0 && nanos > 0) ++seconds, nanos -= 1'000'000'000; // of one sign
    seconds =
        std::clamp<wide>(seconds, std::numeric_limits<std::int64_t>::min(), std::numeric_limits<std::int64_t>::max());
    if (seconds != 0) put_number(to, 1, static_cast<std::uint64_t>(static_cast<std::int64_t>(seconds)));
    if (nanos != 0) put_number(to, 2, static_cast<std::uint64_t>(nanos));
}

// The raw bytes of a blob or a text.
bytes_view block_of(const type_description& type, packet_bytes& in) {
    if (type.kind == type_kind::array) {
        auto raw = in.take(type.length);
        if (type.members[0].type.kind == type_kind::character)
            while (!raw.empty() && raw.back() == std::byte{}) raw = raw.first(raw.size() - 1);
        return raw;
    }
    return in.take(in.number<std::uint32_t>());
}

class message_maker {
public:
    message_maker(buffer& to, bytes_view packet, std::size_t most)
        : to_(to), in_(packet), most_(most), from_(to.size()), empty_(packet.size()) {}

    void message(const message_plan& plan) {
        if (plan.form != shape::variant) {
            for (const auto& one : plan.fields) field(one);
            return;
        }
        std::size_t which = plan.fields.size() > 255 ? in_.number<std::uint16_t>() : in_.number<std::uint8_t>();
        if (which >= plan.fields.size())
            throw error(errc::malformed, fmt::format("a variant has the unknown alternative {}", which));
        field(plan.fields[which]);
    }
    void finish() {
        if (!in_.empty()) throw error(errc::malformed, "the packet has bytes after its last value");
        check_room(0);
    }
    void own_bytes(bytes_view packet) {
        check_room(packet.size());
        put_block(to_, own_bytes_field, packet);
    }

private:
    void check_room(std::size_t more) const {
        auto made = to_.size() - from_;
        if (made > most_ || more > most_ - made)
            throw error(errc::too_large, fmt::format("the message has more than {} bytes (max_message_bytes)", most_));
    }

    void field(const field_plan& of) {
        const auto& whole = *of.whole;
        switch (of.how) {
            case presence::implicit:
            case presence::oneof: return value(of, true, of.how == presence::oneof);
            case presence::optional: {
                auto there = in_.number<std::uint8_t>();
                if (there > 1)
                    throw error(errc::malformed, fmt::format("the optional '{}' is neither there nor absent", of.name));
                if (there) value(of, true, true);
                return;
            }
            case presence::repeated: {
                auto count = whole.kind == type_kind::array ? whole.length : in_.number<std::uint32_t>();
                const auto& element = whole.kind == type_kind::map ? whole : whole.members[0].type;
                auto least = whole.kind == type_kind::map
                                 ? whole.members[0].type.min_size + whole.members[1].type.min_size
                                 : element.min_size;
                if (least > 0 && count > in_.left() / least)
                    throw error(errc::malformed,
                                fmt::format("'{}' has more elements than the packet has bytes", of.name));
                if (count == 0) return;
                if (of.packs())
                    return put_nested(to_, of.number, [&] {
                        while (count-- > 0) value(of, false, true);
                    });
                if (whole.kind == type_kind::map)
                    while (count-- > 0) put_nested(to_, of.number, [&] { message(*of.message); });
                else
                    while (count-- > 0) value(of, true, true);
                return;
            }
        }
    }

    // One value; without its tag if `tag` is false. With `keep` false a zero is left out.
    void value(const field_plan& of, bool tag, bool keep) {
        const auto& type = *of.of;
        empty_.count(type);
        check_room(0);
        auto kind =
            type.kind == type_kind::enumeration || type.kind == type_kind::time_span || type.kind == type_kind::instant
                ? type.number
                : type.kind;
        auto varint = [&](std::uint64_t number) {
            if (number == 0 && !keep) return;
            if (tag) put_tag(to_, of.number, wire::varint);
            put_varint(to_, number);
        };
        switch (of.type) {
            case field_type::boolean: return varint(in_.number<std::uint8_t>() ? 1 : 0);
            case field_type::u32:
            case field_type::u64: return varint(unsigned_number(in_, kind));
            case field_type::s32:
            case field_type::s64: return varint(zigzag(signed_number(in_, kind)));
            case field_type::enumeration:
                return varint(is_signed(kind) ? static_cast<std::uint64_t>(signed_number(in_, kind))
                                              : unsigned_number(in_, kind));
            case field_type::f32: {
                auto bits = in_.number<std::uint32_t>();
                if (bits == 0 && !keep) return;
                if (tag) put_tag(to_, of.number, wire::fixed32);
                return to_.append(bits);
            }
            case field_type::f64: {
                auto bits = in_.number<std::uint64_t>();
                if (type.kind == type_kind::time_span || type.kind == type_kind::instant) // in seconds
                    bits = std::bit_cast<std::uint64_t>(std::bit_cast<double>(bits) *
                                                        static_cast<double>(type.period_num) /
                                                        static_cast<double>(type.period_den));
                if (bits == 0 && !keep) return;
                if (tag) put_tag(to_, of.number, wire::fixed64);
                return to_.append(bits);
            }
            case field_type::text: {
                auto raw = type.kind == type_kind::string ? in_.take(in_.number<std::uint32_t>()) : block_of(type, in_);
                if (raw.empty() && !keep) return;
                check_room(raw.size());
                return put_nested(to_, of.number, [&] { append_utf8(to_, as_text(raw)); });
            }
            case field_type::blob: {
                auto raw = type.kind == type_kind::opaque ? in_.take(in_.number<std::uint32_t>()) : block_of(type, in_);
                if (raw.empty() && !keep) return;
                check_room(raw.size());
                return put_block(to_, of.number, raw);
            }
            case field_type::message:
                return put_nested(to_, of.number, [&] {
                    if (of.message->form == shape::instant || of.message->form == shape::time_span)
                        put_time(to_, type, in_.number<std::int64_t>(), of.message->form == shape::time_span);
                    else message(*of.message);
                });
        }
    }

    buffer& to_;
    packet_bytes in_;
    std::size_t most_, from_;
    empty_values empty_;
};

// --- message to packet -----------------------------------------------------------------------------------------------

class message_bytes {
public:
    explicit message_bytes(bytes_view all) : left_(all) {}
    bool empty() const noexcept { return left_.empty(); }
    const std::byte* here() const noexcept { return left_.data(); }
    std::uint64_t varint() {
        std::uint64_t value = 0;
        for (unsigned shift = 0; shift < 70; shift += 7) {
            if (left_.empty()) throw error(errc::malformed, "the message ends within a number");
            auto one = static_cast<std::uint64_t>(left_[0]);
            left_ = left_.subspan(1);
            if (shift == 63 && one > 1) break;
            value |= (one & 0x7f) << shift;
            if (one < 0x80) return value;
        }
        throw error(errc::malformed, "a number has more than 64 bits");
    }
    bytes_view take(std::uint64_t count) {
        if (count > left_.size()) throw error(errc::malformed, "the message ends within a field");
        auto got = left_.first(static_cast<std::size_t>(count));
        left_ = left_.subspan(got.size());
        return got;
    }

    struct field {
        std::uint32_t number = 0;
        wire type{};
        std::uint64_t value = 0; // of a number
        bytes_view block;
    };
    field next() {
        field made;
        auto tag = varint();
        if (tag >> 3 == 0 || tag >> 3 > own_bytes_field)
            throw error(errc::malformed, "a field has an impossible number");
        made.number = static_cast<std::uint32_t>(tag >> 3);
        made.type = static_cast<wire>(tag & 7);
        switch (made.type) {
            case wire::varint: made.value = varint(); break;
            case wire::fixed64: made.value = detail::load_little<std::uint64_t>(take(8).data()); break;
            case wire::fixed32: made.value = detail::load_little<std::uint32_t>(take(4).data()); break;
            case wire::block: made.block = take(varint()); break;
            default: throw error(errc::malformed, fmt::format("the field {} is a group, or damaged", made.number));
        }
        return made;
    }

private:
    bytes_view left_;
};

class packet_maker {
public:
    packet_maker(buffer& to, bytes_view whole, std::size_t most) : to_(to), most_(most), empty_(whole.size()) {}

    // A message that is absent has all of its fields absent.
    void message(const message_plan& plan, bytes_view content) {
        auto got = runs_of(plan, content);
        if (plan.form == shape::variant) {
            if (plan.fields.empty()) throw error(errc::malformed, "a variant without alternatives");
            std::size_t which = got.empty() ? 0 : got.back().place; // the last one counts
            if (plan.fields.size() > 255) put(static_cast<std::uint16_t>(which));
            else put(static_cast<std::uint8_t>(which));
            return last(plan.fields[which], std::span(got).last(got.empty() ? 0 : 1));
        }
        // Fields are in order where a program wrote them.
        std::ranges::stable_sort(got, {}, &run::place);
        std::span<const run> left = got;
        for (std::size_t place = 0; place < plan.fields.size(); ++place) {
            std::size_t count = 0;
            while (count < left.size() && left[count].place == place) ++count;
            field(plan.fields[place], left.first(count));
            left = left.subspan(count);
        }
    }

private:
    // Fields of one number that follow one another in a message: few, however many fields there are.
    struct run {
        std::size_t place = 0; // of the field in its plan
        bytes_view fields;
    };

    static std::vector<run> runs_of(const message_plan& plan, bytes_view content) {
        std::vector<run> made;
        const std::byte* end = nullptr; // of the last run
        for (message_bytes in(content); !in.empty();) {
            const auto* begin = in.here();
            auto one = in.next();
            if (one.number > plan.fields.size()) continue;
            const std::size_t place = one.number - 1;
            if (begin == end && made.back().place == place) {
                made.back().fields = bytes_view(made.back().fields.data(), in.here());
            } else {
                if (made.size() == max_runs)
                    throw error(errc::too_large, fmt::format("the fields of a message change more than {} times "
                                                             "(max_runs)",
                                                             max_runs));
                made.push_back({place, bytes_view(begin, in.here())});
            }
            end = in.here();
        }
        return made;
    }

    [[noreturn]] static void wrong(const field_plan& of, std::string_view what) {
        throw error(errc::malformed, fmt::format("the field '{}' {}", of.name, what));
    }
    std::byte* room(std::size_t count) {
        if (count > most_ - std::min(most_, to_.size()))
            throw error(errc::too_large, fmt::format("the packet has more than {} bytes (max_packet_bytes)", most_));
        return to_.grow(count);
    }
    template <class T>
    void put(T value) {
        detail::store_little(room(sizeof(T)), value);
    }
    void put(bytes_view raw) {
        if (!raw.empty()) std::memcpy(room(raw.size()), raw.data(), raw.size());
    }

    // Of a field that comes several times the last counts.
    void last(const field_plan& of, std::span<const run> got) {
        message_bytes::field one;
        if (!got.empty())
            for (message_bytes in(got.back().fields); !in.empty();) one = in.next();
        value(of, got.empty() ? nullptr : &one);
    }

    void field(const field_plan& of, std::span<const run> got) {
        const auto& whole = *of.whole;
        if (of.how == presence::optional) {
            put(static_cast<std::uint8_t>(got.empty() ? 0 : 1));
            if (!got.empty()) last(of, got);
            return;
        }
        if (of.how != presence::repeated) return last(of, got);
        std::size_t count_at = to_.size();
        std::uint64_t count = 0;
        if (whole.kind != type_kind::array) put(std::uint32_t{0});
        for (const auto& part : got)
            for (message_bytes in(part.fields); !in.empty();) count += elements(of, in.next());
        if (whole.kind == type_kind::array) {
            if (count == 0)
                for (; count < whole.length; ++count) value(of, nullptr);
            if (count != whole.length) wrong(of, fmt::format("has {} elements instead of {}", count, whole.length));
        } else if (count > std::numeric_limits<std::uint32_t>::max()) {
            wrong(of, "has too many elements");
        } else {
            to_.patch_u32(count_at, static_cast<std::uint32_t>(count));
        }
    }

    // The elements in one field, which may hold many numbers.
    std::uint64_t elements(const field_plan& of, const message_bytes::field& one) {
        if (!of.packs() || one.type != wire::block) {
            value(of, &one);
            return 1;
        }
        std::uint64_t count = 0;
        for (message_bytes in(one.block); !in.empty(); ++count) {
            message_bytes::field each;
            if (of.type == field_type::f64)
                each.type = wire::fixed64, each.value = detail::load_little<std::uint64_t>(in.take(8).data());
            else if (of.type == field_type::f32)
                each.type = wire::fixed32, each.value = detail::load_little<std::uint32_t>(in.take(4).data());
            else each.value = in.varint();
            value(of, &each);
        }
        return count;
    }

    template <class T>
    void put_ranged(const field_plan& of, auto value) {
        if (!std::in_range<T>(value)) wrong(of, fmt::format("has the value {}, which does not fit", value));
        put(static_cast<T>(value));
    }
    void put_signed(const field_plan& of, type_kind kind, std::int64_t value) {
        switch (kind) {
            case type_kind::i8: return put_ranged<std::int8_t>(of, value);
            case type_kind::i16: return put_ranged<std::int16_t>(of, value);
            case type_kind::i32: return put_ranged<std::int32_t>(of, value);
            case type_kind::i64: return put(value);
            case type_kind::u16: return put_ranged<std::uint16_t>(of, value);
            default: return put_ranged<std::uint8_t>(of, value);
        }
    }
    void put_unsigned(const field_plan& of, type_kind kind, std::uint64_t value) {
        switch (kind) {
            case type_kind::u16: return put_ranged<std::uint16_t>(of, value);
            case type_kind::u32: return put_ranged<std::uint32_t>(of, value);
            case type_kind::u64: return put(value);
            default: return put_ranged<std::uint8_t>(of, value);
        }
    }

    // Nothing: it is absent.
    void value(const field_plan& of, const message_bytes::field* got) {
        const auto& type = *of.of;
        empty_.count(type);
        auto kind = type.kind == type_kind::enumeration ? type.number : type.kind;
        auto expect = [&](wire wanted) {
            if (got && got->type != wanted) wrong(of, "has another type than the schema says");
        };
        auto number = got ? got->value : 0;
        auto block = got ? got->block : bytes_view();
        switch (of.type) {
            case field_type::boolean: expect(wire::varint); return put(static_cast<std::uint8_t>(number ? 1 : 0));
            case field_type::u32:
            case field_type::u64: expect(wire::varint); return put_unsigned(of, kind, number);
            case field_type::s32:
            case field_type::s64: expect(wire::varint); return put_signed(of, kind, unzigzag(number));
            case field_type::enumeration:
                expect(wire::varint);
                return put_signed(of, kind, static_cast<std::int64_t>(number));
            case field_type::f32: expect(wire::fixed32); return put(static_cast<std::uint32_t>(number));
            case field_type::f64:
                expect(wire::fixed64);
                if (type.kind == type_kind::time_span || type.kind == type_kind::instant)
                    return put(std::bit_cast<double>(number) * static_cast<double>(type.period_den) /
                               static_cast<double>(type.period_num));
                return put(number);
            case field_type::text:
            case field_type::blob:
                expect(wire::block);
                if (type.kind == type_kind::array) {
                    if (block.size() > type.length ||
                        (got && of.type == field_type::blob && block.size() != type.length))
                        wrong(of, fmt::format("has {} bytes instead of {}", block.size(), type.length));
                    put(block);
                    auto rest = static_cast<std::size_t>(type.length) - block.size();
                    if (rest > 0) std::memset(room(rest), 0, rest);
                    return;
                }
                if (block.size() > std::numeric_limits<std::uint32_t>::max()) wrong(of, "is too long");
                put(static_cast<std::uint32_t>(block.size()));
                return put(block);
            case field_type::message:
                expect(wire::block);
                if (of.message->form == shape::instant || of.message->form == shape::time_span) return time(of, block);
                return message(*of.message, block);
        }
    }

    void time(const field_plan& of, bytes_view content) {
        std::int64_t seconds = 0, nanos = 0;
        for (message_bytes in(content); !in.empty();) {
            auto one = in.next();
            if (one.type != wire::varint) continue;
            if (one.number == 1) seconds = static_cast<std::int64_t>(one.value);
            if (one.number == 2) nanos = static_cast<std::int64_t>(one.value);
        }
        if (nanos <= -1'000'000'000 || nanos >= 1'000'000'000) wrong(of, "has nanoseconds beyond a second");
        const auto& type = *of.of;
        // To the next tick: a period that is no whole number of nanoseconds was rounded.
        wide den = wide{1'000'000'000} * std::max<std::int64_t>(type.period_num, 1);
        wide billions = wide{seconds} * 1'000'000'000 + nanos;
        constexpr wide most = (wide{1} << 126) - 1;
        if (billions > most / type.period_den || billions < -(most / type.period_den)) wrong(of, "is beyond 64 bits");
        wide scaled = billions * type.period_den + den / 2;
        wide ticks = scaled / den - (scaled % den < 0 ? 1 : 0);
        if (ticks > std::numeric_limits<std::int64_t>::max() || ticks < std::numeric_limits<std::int64_t>::min())
            wrong(of, "is beyond 64 bits");
        put(static_cast<std::int64_t>(ticks));
    }

    buffer& to_;
    std::size_t most_;
    empty_values empty_;
};

} // namespace

struct protobuf_type::state {
    schema of;
    std::string name;
    bytes descriptors;
    std::vector<std::unique_ptr<message_plan>> messages; // the first is the root
    std::vector<enum_plan> enums;
};

protobuf_type::protobuf_type(schema of) : state_(std::make_unique<state>()) {
    auto& self = *state_;
    self.of = std::move(of);
    auto root = identifier(self.of.name().empty() ? "packet" : self.of.name());
    self.name = "ise." + root;
    planner plan(self.messages, self.enums, root);
    plan.root(self.of.type());
    buffer out;
    if (plan.uses_instant) put_well_known(out, "google/protobuf/timestamp.proto", "Timestamp");
    if (plan.uses_time_span) put_well_known(out, "google/protobuf/duration.proto", "Duration");
    put_nested(out, 1, [&] {
        put_text(out, 1, fmt::format("ise/{}.proto", root));
        put_text(out, 2, "ise");
        if (plan.uses_instant) put_text(out, 3, "google/protobuf/timestamp.proto");
        if (plan.uses_time_span) put_text(out, 3, "google/protobuf/duration.proto");
        put_nested(out, 4, [&] {
            put_message_content(out, *self.messages[0]);
            for (std::size_t i = 1; i < self.messages.size(); ++i)
                put_nested(out, 3, [&] { put_message_content(out, *self.messages[i]); });
            for (const auto& one : self.enums) put_enum(out, one);
        });
        put_text(out, 12, "proto3");
    });
    self.descriptors = out.to_bytes();
}
protobuf_type::~protobuf_type() = default;
protobuf_type::protobuf_type(protobuf_type&&) noexcept = default;
protobuf_type& protobuf_type::operator=(protobuf_type&&) noexcept = default;

const schema& protobuf_type::of() const noexcept { return state_->of; }
const std::string& protobuf_type::name() const noexcept { return state_->name; }
const bytes& protobuf_type::descriptors() const noexcept { return state_->descriptors; }

result<void> protobuf_type::encode(bytes_view packet, buffer& to, bool own_bytes, const protobuf_limits& limits) const {
    auto from = to.size();
    try {
        message_maker made(to, packet, limits.max_message_bytes);
        made.message(*state_->messages[0]);
        made.finish();
        if (own_bytes) made.own_bytes(packet);
        return {};
    } catch (const error& thrown) {
        to.truncate(from);
        return failure(thrown.code(), fmt::format("{}: {}", state_->name, thrown.what()));
    }
}

result<bytes> protobuf_type::decode(bytes_view message, const protobuf_limits& limits) const {
    try {
        std::optional<bytes_view> own;
        for (message_bytes in(message); !in.empty();) {
            auto one = in.next();
            if (one.number == own_bytes_field && one.type == wire::block) own = one.block;
        }
        if (own && own->size() > limits.max_packet_bytes)
            throw error(errc::too_large,
                        fmt::format("the packet has more than {} bytes (max_packet_bytes)", limits.max_packet_bytes));
        if (own) return bytes(own->begin(), own->end());
    } catch (const error& thrown) {
        return failure(thrown.code(), fmt::format("{}: {}", state_->name, thrown.what()));
    }
    return decode_fields(message, limits);
}

result<bytes> protobuf_type::decode_fields(bytes_view message, const protobuf_limits& limits) const {
    try {
        buffer out;
        packet_maker(out, message, limits.max_packet_bytes).message(*state_->messages[0], message);
        return out.to_bytes();
    } catch (const error& thrown) {
        return failure(thrown.code(), fmt::format("{}: {}", state_->name, thrown.what()));
    }
}

} // namespace ise::bag
