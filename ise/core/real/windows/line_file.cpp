#include <ise/core/real/line_file.hpp>

#include <ise/core/real/windows/last_error.hpp>

#include <fmt/format.h>

namespace ise {

result<std::shared_ptr<line_file>> line_file::open(const std::string& path) {
    // Without the right to write elsewhere each write goes to the end.
    auto file = ::CreateFileA(path.c_str(), FILE_APPEND_DATA, FILE_SHARE_READ | FILE_SHARE_WRITE, nullptr, OPEN_ALWAYS,
                              FILE_ATTRIBUTE_NORMAL, nullptr);
    if (file == INVALID_HANDLE_VALUE) return real::last_failure(fmt::format("cannot write to {}", path));
    std::shared_ptr<line_file> made(new line_file(real::number_of(file), path));
    if (::GetFileType(file) != FILE_TYPE_DISK)
        return failure(errc::invalid_argument, fmt::format("{} is no file", path));
    return made;
}

line_file::~line_file() { ::CloseHandle(real::handle_of(descriptor_)); }

result<void> line_file::append(std::string_view line) {
    std::string whole(line);
    whole += '\n';
    DWORD written = 0;
    if (!::WriteFile(real::handle_of(descriptor_), whole.data(), static_cast<DWORD>(whole.size()), &written, nullptr))
        return real::last_failure(fmt::format("cannot write to {}", path_));
    if (written == whole.size()) return {};
    return io_failure(fmt::format("cannot write to {}", path_), std::make_error_code(std::errc::no_space_on_device));
}

} // namespace ise
