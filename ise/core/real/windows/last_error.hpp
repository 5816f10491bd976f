#pragma once
#include <ise/core/error.hpp>

#include <cstdint>
#include <string_view>
#include <system_error>

#include <windows.h>

namespace ise::real {

/// errc::io_failed with the reason that Windows gave last.
inline failure last_failure(std::string_view what) {
    return io_failure(what, std::error_code(static_cast<int>(::GetLastError()), std::system_category()));
}

/// Handles have 32 significant bits.
inline HANDLE handle_of(int number) noexcept { return reinterpret_cast<HANDLE>(static_cast<std::intptr_t>(number)); }
inline int number_of(HANDLE handle) noexcept { return static_cast<int>(reinterpret_cast<std::intptr_t>(handle)); }

} // namespace ise::real
