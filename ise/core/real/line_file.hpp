#pragma once
#include <ise/core/result.hpp>

#include <memory>
#include <string>
#include <string_view>

namespace ise {

/// A file to which lines are appended, by several processes at once if need be: each line is one write. Thread-safe.
class line_file {
public:
    /// Made with mode 0600 if it is not there. errc::io_failed, with the file; errc::invalid_argument: it is none.
    static result<std::shared_ptr<line_file>> open(const std::string& path);
    ~line_file();
    line_file(const line_file&) = delete;
    line_file& operator=(const line_file&) = delete;

    /// Appends it and an end of line. errc::io_failed.
    result<void> append(std::string_view line);

private:
    line_file(int descriptor, std::string path) : descriptor_(descriptor), path_(std::move(path)) {}

    const int descriptor_;
    const std::string path_;
};

} // namespace ise
