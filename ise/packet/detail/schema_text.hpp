#pragma once
#include <ise/packet/type.hpp>

#include <string>

namespace ise::detail {

enum class text_style {
    full,        ///< what travels: with the names of structs and enums, and the presets
    fingerprint, ///< what is hashed: without both
    pretty,      ///< for people: with names, without presets, a field a line
};

std::string text_of(const type_description& type, text_style style);

} // namespace ise::detail
