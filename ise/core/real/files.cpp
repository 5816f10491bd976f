#include <ise/core/real/environment.hpp>

#include <ise/core/real/ownership.hpp>

#include <fmt/format.h>

#include <cerrno>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <system_error>

namespace ise {

result<std::string> real_environment::read_file(const std::string& path, std::size_t max_bytes) {
    auto refuse = [&](std::string_view why) {
        return failure(errc::io_failed, fmt::format("cannot read {}: {}", path, why));
    };
    std::error_code ignored;
    if (std::filesystem::is_directory(path, ignored)) return refuse("it is a folder");
    std::ifstream file(path, std::ios::binary | std::ios::ate);
    if (!file) return refuse(std::error_code(errno, std::system_category()).message());
    auto size = static_cast<std::streamoff>(file.tellg());
    if (size < 0) return refuse("it is not a plain file");
    if (static_cast<std::uint64_t>(size) > max_bytes)
        return refuse(fmt::format("it has {} bytes, {} are allowed", size, max_bytes));
    std::string content(static_cast<std::size_t>(size), '\0');
    file.seekg(0);
    if (!file.read(content.data(), static_cast<std::streamsize>(size))) return refuse("it ended early");
    return content;
}

result<std::string> real_environment::read_trusted(const std::string& path, std::size_t max_bytes) {
    if (auto own = check_own_file(path, "read"); !own) return own.error();
    return read_file(path, max_bytes);
}

} // namespace ise
