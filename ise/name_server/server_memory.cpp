// environment-boundary: the real state file of a name server; tests give it a memory of their own
#include <ise/name_server/server_memory.hpp>

#include <ise/core/real/own_file.hpp>
#include <ise/core/real/ownership.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <array>
#include <cerrno>
#include <system_error>

#include <unistd.h>

namespace ise {
namespace {

constexpr std::size_t max_state_bytes = 4096;

// What is in the file, as JSON: fields are only ever appended.
struct saved_memory {
    std::uint32_t version = 1;
    std::array<std::uint64_t, 2> secret{};
    std::uint64_t epochs_below = 0;
};

std::string last_problem() { return std::error_code(errno, std::system_category()).message(); }

} // namespace

result<std::optional<registry_memory>> state_file::load() {
    std::optional<registry_memory> found;
    if (::access(path_.c_str(), F_OK) != 0 && errno == ENOENT) return found;
    if (auto folder = check_own_path(folder_of(path_)); !folder) return folder.error();
    auto text = env_.read_secret(path_, max_state_bytes);
    if (!text) return text.error();
    try {
        auto saved = from_json<saved_memory>(*text);
        found.emplace();
        found->secret = saved.secret;
        found->epochs_below = saved.epochs_below;
        found->of_former = true;
    } catch (const error& unfit) {
        return failure(errc::malformed,
                       fmt::format("{} is not a state of a name server: {}; remove it, or choose another file", path_,
                                   unfit.what()));
    }
    return found;
}

result<void> state_file::probe() {
    auto there = load();
    if (!there) return there.error();
    auto folder = folder_of(path_);
    if (auto made = make_own_folders(folder); !made) return made;
    if (auto fit = check_own_path(folder); !fit) return fit;
    if (::access(folder.c_str(), W_OK) != 0)
        return failure(errc::io_failed, fmt::format("cannot write {}: {}", path_, last_problem()));
    return {};
}

result<void> state_file::keep(const registry_memory& what) {
    auto folder = folder_of(path_);
    if (auto made = make_own_folders(folder); !made) return made;
    if (auto fit = check_own_path(folder); !fit) return fit;
    saved_memory saved;
    saved.secret = what.secret;
    saved.epochs_below = what.epochs_below;
    return replace_own_file(path_, to_json(saved, json_style::pretty) + "\n");
}

} // namespace ise
