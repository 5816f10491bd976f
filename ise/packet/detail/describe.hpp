#pragma once
#include <ise/core/buffer.hpp>
#include <ise/packet/type.hpp>

#include <initializer_list>
#include <span>
#include <string_view>
#include <vector>

/// Descriptions of types. The code of a packet type holds a table of its fields only; the rest is compiled once.
namespace ise::detail {

using describer = type_description (*)();

type_description describe_scalar(type_kind kind);

/// A type made of others: of its elements, its key and value, its alternatives.
type_description describe_parts(type_kind kind, std::initializer_list<describer> parts);

type_description describe_enumeration(std::string_view name, type_kind number, const std::vector<enumerator>& of);

struct described_field {
    std::string_view name;
    describer describe;
    void (*encode)(buffer& out, const void* value);
    const void* preset; ///< its value in a struct of which nothing was set
};
type_description describe_structure(std::string_view name, std::span<const described_field> fields);

/// Appends a field to the description of a struct; `preset`: its default, encoded.
void add_field(type_description& into, std::string_view name, type_description type, bytes_view preset);

} // namespace ise::detail
