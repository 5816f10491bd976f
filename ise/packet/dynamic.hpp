#pragma once
#include <ise/packet/adapt.hpp>
#include <ise/packet/json.hpp>

#include <concepts>
#include <limits>
#include <string>
#include <string_view>

namespace ise {

/// One value inside a packet whose type is known at run time only. Borrows from its dynamic_packet.
class field_view {
public:
    /// The type of this value.
    const type_description& type() const noexcept { return *type_; }
    /// The kind of the value.
    type_kind kind() const noexcept { return type_->kind; }
    /// The bytes of this value alone.
    bytes_view raw() const noexcept { return raw_; }

    /// Throw `type_mismatch` with the path if the value has another kind or does not fit.
    bool as_bool() const;
    std::int64_t as_int() const;   ///< integers, enums, chars, ticks of durations and time points
    std::uint64_t as_uint() const; ///< the same, unless negative
    double as_double() const;      ///< numbers of all kinds; durations and time points in seconds
    std::string as_string() const; ///< strings, characters, an enumerator's name; else the value's JSON
    bool is_null() const;          ///< an optional without value
    std::size_t size() const;      ///< elements of a container, bytes of a string, fields of a struct

    /// As bool, an integer, a floating point number or a std::string; throws `type_mismatch` if it does not fit.
    template <class T>
    T as() const {
        if constexpr (std::same_as<T, bool>) return as_bool();
        else if constexpr (std::floating_point<T>) return static_cast<T>(as_double());
        else if constexpr (std::same_as<T, std::string>) return as_string();
        else {
            static_assert(std::integral<T>, "ise: a field is read as bool, integer, floating point or std::string");
            if constexpr (std::is_signed_v<T>)
                return static_cast<T>(ranged(as_int(), std::numeric_limits<T>::min(), std::numeric_limits<T>::max()));
            else return static_cast<T>(ranged(as_uint(), std::numeric_limits<T>::max()));
        }
    }
    /// The value as one line of JSON.
    std::string to_json() const;

private:
    friend class dynamic_packet;
    field_view(const type_description& type, bytes_view raw, std::string path)
        : type_(&type), raw_(raw), path_(std::move(path)) {}
    [[noreturn]] void wrong(std::string_view wanted) const;
    std::int64_t ranged(std::int64_t value, std::int64_t low, std::int64_t high) const;
    std::uint64_t ranged(std::uint64_t value, std::uint64_t high) const;

    const type_description* type_;
    bytes_view raw_;
    std::string path_;
};

/// A packet with its schema, for programs that know the type only at run time. A value: copies are independent.
class dynamic_packet {
public:
    /// Checks all bytes; throws `malformed` with the field.
    dynamic_packet(schema of, bytes encoded, const decode_limits& limits = {});
    /// Throws as `ise::from_json`.
    static dynamic_packet from_json(schema of, std::string_view json, const json_limits& limits = {});

    /// Its schema.
    const schema& type() const noexcept { return schema_; }
    /// Its encoded bytes; borrowed.
    bytes_view encoded() const noexcept { return encoded_; }

    /// Reads by a path: `waypoints[3].latitude_deg`; tuple elements are fields `0`, `1`, …; a map is indexed by its
    /// position, or by a string key as a field; the path passes through optionals and variants. Throws
    /// `invalid_argument` if there is no such value, with the part of the path that exists. The view lives as long as
    /// the packet.
    field_view field(std::string_view path) const;

    /// The packet as JSON, as `ise::to_json`.
    std::string to_json(json_style style = json_style::compact) const { return ise::to_json(schema_, encoded_, style); }

    /// The typed packet, adapted to its own version of the type; throws `type_mismatch` with the diff.
    template <class T>
    T as() const {
        const schema& wanted = schema_of<T>();
        if (wanted.fingerprint() == schema_.fingerprint()) return decode<T>(encoded_);
        return decode<T>(adapt(schema_, wanted, encoded_));
    }

private:
    schema schema_;
    bytes encoded_;
};

/// A typed packet as a dynamic one.
template <class T>
requires packet<T> dynamic_packet to_dynamic(const T& value) { return dynamic_packet(schema_of<T>(), encode(value)); }

} // namespace ise
