#pragma once
#include <string_view>
#include <system_error>

// The meaning of errors of the system, defined in linux/ and windows/. They are compared by number: Asio's own category
// does not compare with std::errc.
namespace ise::real {

bool is_address_taken(const std::error_code& why) noexcept;
bool is_out_of_descriptors(const std::error_code& why) noexcept;
bool is_out_of_memory(const std::error_code& why) noexcept;
/// How a person finds out more, as ` (...)`; empty: nothing is known of it.
std::string_view advice_on(const std::error_code& why) noexcept;

} // namespace ise::real
