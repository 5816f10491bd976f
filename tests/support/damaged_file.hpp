#pragma once
#include <ise/database/database.hpp>

#include <cstddef>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include <unistd.h>

namespace damaged_file {

/// A folder for one test's files.
struct folder {
    explicit folder(const std::string& name)
        : path(std::filesystem::temp_directory_path() / ("ise-" + name + "-" + std::to_string(::getpid()))) {
        std::filesystem::remove_all(path);
        std::filesystem::create_directories(path);
    }
    ~folder() { std::filesystem::remove_all(path); }
    folder(const folder&) = delete;
    folder& operator=(const folder&) = delete;
    std::string file() const { return (path / "store.db").string(); }
    /// Where damaged files were moved to.
    std::vector<std::string> set_aside() const {
        std::vector<std::string> made;
        for (const auto& entry : std::filesystem::directory_iterator(path)) {
            auto name = entry.path().string();
            if (name.starts_with(file() + ".damaged-") && !name.ends_with("-wal") && !name.ends_with("-shm"))
                made.push_back(name);
        }
        return made;
    }
    std::filesystem::path path;
};

inline void write_garbage(const std::string& file) {
    std::ofstream(file, std::ios::binary) << std::string(20'000, 'g');
}

/// Overwrites each page of a database that nobody has open and that holds `content`.
inline void overwrite_pages_with(const std::string& file, std::string_view content) {
    constexpr std::size_t page = 4096;
    std::ifstream in(file, std::ios::binary);
    std::string all((std::istreambuf_iterator<char>(in)), std::istreambuf_iterator<char>());
    std::fstream out(file, std::ios::in | std::ios::out | std::ios::binary);
    bool found = false;
    for (auto at = all.find(content); at != all.npos; at = all.find(content, at + 1), found = true) {
        out.seekp(static_cast<std::streamoff>(at / page * page));
        out << std::string(page, 'x');
    }
    if (!found) throw std::runtime_error("no page holds that");
}
inline void overwrite_pages_with(const std::string& file, const std::vector<std::byte>& content) {
    overwrite_pages_with(file, std::string_view(reinterpret_cast<const char*>(content.data()), content.size()));
}

/// What a component logs, as lines.
struct log_lines {
    ise::log_sink sink() {
        return [this](const ise::log_record& record) {
            if (record.level == ise::log_level::error) errors += ise::format_line(record);
        };
    }
    std::string errors;
};

} // namespace damaged_file
