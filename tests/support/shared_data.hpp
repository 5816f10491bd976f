#pragma once
#include <cstdlib>
#include <filesystem>
#include <optional>
#include <string>

namespace ise_test {

/// A file of the shared test data, where it is present: $ISE_SHARED_DATA, else ../shared/data beside the source root.
inline std::optional<std::filesystem::path> shared_data(const std::string& name) {
    std::filesystem::path folder;
    if (const char* given = std::getenv("ISE_SHARED_DATA")) folder = given;
    else
        folder =
            std::filesystem::path(__FILE__).parent_path().parent_path().parent_path().parent_path() / "shared" / "data";
    auto file = folder / name;
    std::error_code ignored;
    if (!std::filesystem::exists(file, ignored)) return std::nullopt;
    return file;
}

} // namespace ise_test
