#pragma once
#include <ise/core/bytes.hpp>
#include <ise/packet/enums.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ise {

/// What a type is on the wire (LAYOUT.md).
enum class type_kind : std::uint8_t {
    boolean,
    character,
    byte,
    i8,
    u8,
    i16,
    u16,
    i32,
    u32,
    i64,
    u64,
    f32,
    f64, // scalars
    string,
    vector,
    set,
    map,
    array,
    optional,
    variant,
    tuple, // made of other types
    time_span,
    instant,
    enumeration,
    structure,
    opaque // (duration, time point)
};

/// "u8", "vector", … as in a schema's text.
std::string_view name_of(type_kind kind) noexcept;
/// Whether it is a number, bool, char or byte.
constexpr bool is_scalar(type_kind kind) noexcept { return kind <= type_kind::f64; }
/// Encoded size of a scalar.
std::size_t size_of(type_kind scalar) noexcept;

struct type_member;

/// A description of one type at any depth: plain data, a tree. Shared and immutable inside a `schema`.
struct type_description {
    type_kind kind = type_kind::structure; ///< which of the fields below count
    type_kind number = type_kind::i64;     ///< of an enum, or of a duration (i64, or f64 where it counts fractions)
    std::string name;                      ///< of a struct or enum (for people), of an opaque type (identity)
    std::vector<type_member> members;      ///< fields, elements, alternatives; of a map: key, value
    std::vector<enumerator> enumerators;   ///< of an enum
    std::uint64_t length = 0;              ///< of an array
    std::int64_t period_num = 1;           ///< of a duration or time point, in seconds
    std::int64_t period_den = 1;           ///< the denominator of that
    std::uint32_t version = 0;             ///< of an opaque type

    // Computed by complete():
    std::uint64_t min_size = 0; ///< the fewest bytes that a value takes
    bool fixed_size = false;    ///< every value takes min_size bytes
    bool any_bytes = false;     ///< and any min_size bytes are a value

    /// Computes the sizes from the members', which are complete already.
    void complete() noexcept;

    // Compiled once: what a vector of a tree is made of costs every file of a user.
    type_description();
    type_description(const type_description&);                ///< a copy of its own
    type_description(type_description&&) noexcept;            ///< takes it over
    type_description& operator=(const type_description&);     ///< a copy of its own
    type_description& operator=(type_description&&) noexcept; ///< takes it over
    ~type_description();
};

/// A field, an element or an alternative.
struct type_member {
    std::string name;            ///< of a field
    type_description type;       ///< its type
    std::optional<bytes> preset; ///< a field's encoded default where it is not the type's natural one
};

} // namespace ise
