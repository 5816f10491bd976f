#pragma once
#include <ise/packet/detail/wire_archive.hpp>
#include <ise/packet/type.hpp>

namespace ise::detail {

/// Steps over one value of a type known at run time, checking it as a typed decoder would. False: `in` says why.
bool skip(const type_description& type, reader& in);

/// The number of elements of a string, vector, set, map or opaque value, checked.
bool take_count_of(const type_description& type, reader& in, std::size_t& count);
/// The flag of an optional.
bool take_flag(reader& in, bool& flag);
/// The index of a variant's alternative.
bool take_alternative(const type_description& type, reader& in, std::size_t& index);

} // namespace ise::detail
