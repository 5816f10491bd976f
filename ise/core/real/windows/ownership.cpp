#include <ise/core/real/environment.hpp>
#include <ise/core/real/ownership.hpp>

#include <fmt/format.h>

#include <array>

#include <windows.h>

#include <lmcons.h>

namespace ise {
namespace {

// Refused rather than trusted unseen.
failure not_checked(const std::string& path) {
    return {errc::unauthorized,
            fmt::format("{} cannot be used: on Windows ISE cannot check yet which users may read or change it", path)};
}

} // namespace

result<void> check_own_path(const std::string& path) { return not_checked(path); }

result<void> check_own_file(const std::string& file, std::string_view doing) {
    return failure(errc::unauthorized, fmt::format("cannot {} {}: {}", doing, file, not_checked(file).message()));
}

result<std::string> real_environment::read_secret(const std::string& path, std::size_t) { return not_checked(path); }

bool is_own_user(std::optional<std::uint32_t>) noexcept { return false; } // local sockets alone know their users

std::string process_user() {
    std::array<char, UNLEN + 1> name{};
    auto size = static_cast<DWORD>(name.size());
    return ::GetUserNameA(name.data(), &size) ? std::string(name.data()) : std::string();
}

} // namespace ise
