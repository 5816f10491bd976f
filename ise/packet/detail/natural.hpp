#pragma once
#include <ise/core/buffer.hpp>
#include <ise/packet/type.hpp>

#include <string_view>

namespace ise::detail {

/// How large a buffer may get, and by which limit's name.
struct size_limit {
    std::size_t most;
    std::string_view name;
    size_limit(std::size_t bytes, std::string_view of) : most(bytes), name(of) {}
};

/// Appends a type's natural value: zero, empty, absent, the first alternative; of a struct, its fields' presets.
/// Throws `too_large` where the buffer would grow beyond `limit` (an array's length may be hostile).
void append_natural(const type_description& type, buffer& out, const size_limit& limit);

/// A field's value where the sender has no such field.
void append_preset(const type_member& field, buffer& out, const size_limit& limit);

/// Whether an encoded default is the type's natural value: then the schema needs no word about it.
bool is_natural(const type_description& type, bytes_view preset);

} // namespace ise::detail
