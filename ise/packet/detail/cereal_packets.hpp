#pragma once
#include <ise/packet/bounded.hpp>
#include <ise/packet/concept.hpp>

#include <cereal/cereal.hpp>
#include <cereal/types/array.hpp>
#include <cereal/types/chrono.hpp>
#include <cereal/types/common.hpp>
#include <cereal/types/map.hpp>
#include <cereal/types/optional.hpp>
#include <cereal/types/set.hpp>
#include <cereal/types/string.hpp>
#include <cereal/types/tuple.hpp>
#include <cereal/types/unordered_map.hpp>
#include <cereal/types/unordered_set.hpp>
#include <cereal/types/utility.hpp>
#include <cereal/types/variant.hpp>
#include <cereal/types/vector.hpp>

#include <array>
#include <cstdint>
#include <string_view>
#include <type_traits>
#include <utility>

/// Packets on any cereal archive: a plain struct is the list of its fields with their names, as a `serialize` written
/// by hand would give it, and cereal's own functions serve what the fields are made of.
namespace ise::detail {

// cereal wants names that end with a zero.
template <class T, std::size_t I>
inline constexpr auto zero_ended_name = [] {
    constexpr std::string_view name = field_names<T>[I];
    std::array<char, name.size() + 1> text{};
    for (std::size_t i = 0; i < name.size(); ++i) text[i] = name[i];
    return text;
}();

template <class Archive, class T, std::size_t... I>
void serialize_fields([[maybe_unused]] Archive& archive, T& value, std::index_sequence<I...>) {
    apply_fields(
        value, [&archive](auto&... fields) { (archive(cereal::make_nvp(zero_ended_name<T, I>.data(), fields)), ...); });
}

} // namespace ise::detail

namespace ise {

/// As its number. To load one outside of the range throws errc::invalid_argument with the range.
template <class Archive, class T, auto Minimum, auto Maximum, unit_text Unit>
T CEREAL_SAVE_MINIMAL_FUNCTION_NAME(const Archive&, const bounded<T, Minimum, Maximum, Unit>& value) {
    return value.value();
}
template <class Archive, class T, auto Minimum, auto Maximum, unit_text Unit>
void CEREAL_LOAD_MINIMAL_FUNCTION_NAME(const Archive&, bounded<T, Minimum, Maximum, Unit>& value,
                                       const std::type_identity_t<T>& number) {
    value = number;
}

} // namespace ise

namespace cereal {

/// Functions that an author placed here (or beside the type, for this archive only) win over reflection.
template <class Archive, class T>
concept has_functions_for_ise_packet = requires(Archive& archive, const T& fixed) {
    CEREAL_SAVE_FUNCTION_NAME(archive, fixed);
}
|| requires(Archive& archive, T& value) { CEREAL_LOAD_FUNCTION_NAME(archive, value); }
|| requires(Archive& archive, T& value) { CEREAL_SERIALIZE_FUNCTION_NAME(archive, value, std::uint32_t{}); }
|| requires(Archive& archive, const T& fixed) { CEREAL_SAVE_FUNCTION_NAME(archive, fixed, std::uint32_t{}); }
|| requires(Archive& archive, T& value) { CEREAL_LOAD_FUNCTION_NAME(archive, value, std::uint32_t{}); }
|| requires(const Archive& archive, const T& fixed) { CEREAL_SAVE_MINIMAL_FUNCTION_NAME(archive, fixed); };

template <class Archive, ise::detail::reflected T>
requires(ise::packet<T> &&
         !has_functions_for_ise_packet<Archive, T>) void CEREAL_SERIALIZE_FUNCTION_NAME(Archive& archive, T& value) {
    ise::detail::serialize_fields(archive, value, std::make_index_sequence<ise::field_count<T>>());
}

} // namespace cereal
