#include <ise/core/real/own_file.hpp>

#include <ise/core/real/windows/last_error.hpp>

#include <fmt/format.h>

#include <filesystem>

namespace ise {
namespace {

result<void> write_new(const std::string& path, std::string_view content) {
    auto file = ::CreateFileA(path.c_str(), GENERIC_WRITE, 0, nullptr, CREATE_ALWAYS, FILE_ATTRIBUTE_NORMAL, nullptr);
    if (file == INVALID_HANDLE_VALUE) return real::last_failure(fmt::format("cannot write {}", path));
    DWORD written = 0;
    const bool done = ::WriteFile(file, content.data(), static_cast<DWORD>(content.size()), &written, nullptr) &&
                      written == content.size() && ::FlushFileBuffers(file);
    result<void> outcome;
    if (!done) outcome = real::last_failure(fmt::format("cannot write {}", path));
    ::CloseHandle(file);
    return outcome;
}

} // namespace

std::string folder_of(const std::string& path) {
    auto folder = std::filesystem::path(path).parent_path().string();
    return folder.empty() ? "." : folder;
}

result<void> make_own_folders(const std::string& folder) {
    std::error_code problem;
    std::filesystem::create_directories(folder, problem);
    if (problem) return io_failure(fmt::format("cannot make the folder {}", folder), problem);
    return {};
}

std::error_code sync_folder_of(const std::string&) { return {}; } // files are moved with MOVEFILE_WRITE_THROUGH

result<void> replace_own_file(const std::string& path, std::string_view content) {
    auto replacement = path + ".new";
    ::DeleteFileA(replacement.c_str()); // of a process that was killed meanwhile
    if (auto written = write_new(replacement, content); !written) return written;
    if (!::MoveFileExA(replacement.c_str(), path.c_str(), MOVEFILE_REPLACE_EXISTING | MOVEFILE_WRITE_THROUGH))
        return real::last_failure(fmt::format("cannot write {}", path));
    return {};
}

} // namespace ise
