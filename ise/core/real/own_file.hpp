#pragma once
#include <ise/core/result.hpp>

#include <string>
#include <string_view>
#include <system_error>

namespace ise {

/// The folder that a path lies in; "." where it names none.
std::string folder_of(const std::string& path);

/// Makes a folder that only this user can use, and those above it; fine if they are there. errc::io_failed.
result<void> make_own_folders(const std::string& folder);

/// Waits until what was created, renamed or removed in the folder of `path` is on the disk. Returns the system's error;
/// some file systems cannot do it.
std::error_code sync_folder_of(const std::string& path);

/// Replaces a file of this user's by one of mode 0600 with that content: after a crash there is the former one or the
/// new one, whole. What lies beside it as `path` + ".new" is removed and not written through. errc::io_failed: what was
/// there stays, unless the last step failed, which makes the new one last.
result<void> replace_own_file(const std::string& path, std::string_view content);

} // namespace ise
