#include <components/boat/enums.hpp>

namespace atirma {

template std::span<const enum_name<sailing_mode>> names_of() noexcept;
template std::span<const enum_name<link_id>> names_of() noexcept;
template std::span<const enum_name<tack>> names_of() noexcept;
template std::span<const enum_name<fix_quality>> names_of() noexcept;
template std::span<const enum_name<reset_cause>> names_of() noexcept;
template std::span<const enum_name<parameter_id>> names_of() noexcept;
template std::span<const enum_name<ack_code>> names_of() noexcept;

} // namespace atirma
