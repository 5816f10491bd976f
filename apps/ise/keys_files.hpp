#pragma once
#include <memory>
#include <string>

/// The files of `ise keys`. Each function throws `problem` that names the file and says what to do.
namespace ise::cli {

inline constexpr unsigned secret_mode = 0600, public_mode = 0644, folder_mode = 0700;

bool is_folder(const std::string& path);
bool is_there(const std::string& path);
/// A new folder for its owner only; one that is there may be used.
void make_folder(const std::string& path);
/// Locks a folder, after waiting for other processes. The lock lasts as long as the returned handle.
std::shared_ptr<const void> lock_folder(const std::string& path);

/// At most 1 MiB.
std::string read_public(const std::string& file);
/// The same of a private key: refuses one that other users of the machine can read or change.
std::string read_private(const std::string& file);

/// Refuses a file that is there. It is on the disk, whole, when this returns, or not there.
void write_new(const std::string& file, const std::string& text, unsigned mode);
/// In place of what is there, at once: a reader sees the old text or the new one.
void replace(const std::string& file, const std::string& text, unsigned mode);

} // namespace ise::cli
