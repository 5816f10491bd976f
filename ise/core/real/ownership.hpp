#pragma once
#include <ise/core/result.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <string_view>

namespace ise {

/// Whether nobody but this process's user and root can put something else at `path`, as sshd's StrictModes asks: the
/// file or folder, each folder above it and each symbolic link on the way belong to one of the two, and others cannot
/// write there. Folders above it may be sticky ones that everybody writes to (/tmp); a group that is the user's own may
/// write. errc::unauthorized says what is wrong and what to do; errc::io_failed.
result<void> check_own_path(const std::string& path);

/// The same of a file that is about to be opened, or of the folder where it will be made while it is not there. A
/// failure begins with "cannot DOING FILE: ".
result<void> check_own_file(const std::string& file, std::string_view doing);

/// Whether a process of this user is the peer, as the system knows it (`verified_peer::user`).
bool is_own_user(std::optional<std::uint32_t> user) noexcept;

/// The user of this process by name, or by number where it has none.
std::string process_user();

} // namespace ise
