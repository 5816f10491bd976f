#pragma once
#include <ise/core/environment.hpp>
#include <ise/instantiation/machine.hpp>
#include <ise/instantiation/services.hpp>

#include <optional>
#include <string>
#include <vector>

namespace ise::instantiation {

/// What an instantiation server must know of an instance to go on with it after it was killed. Packets, kept as JSON:
/// fields are only ever appended.
struct saved_instance {
    start_request asked;
    std::string path;
    std::string mark;      ///< of its present process
    process_stamp process; ///< 0 with a mark: it was being started
    instance_state state = instance_state::stopped;
    std::string reason;
    wall_time since{};
    std::uint32_t restarts = 0;
    std::string program_version;         ///< of its present process
    std::optional<start_request> former; ///< before the last change
    std::uint64_t undo = 0;              ///< of that change
};

/// A process that several instances share.
struct saved_process {
    std::string name;
    std::string program;
    std::string mark;
    process_stamp process; ///< 0: it was being started
    std::string program_version;
};

struct saved_state {
    std::uint32_t version = 1;
    std::string boot; ///< processes of another boot are gone
    std::vector<saved_instance> instances;
    std::vector<saved_process> processes;
};

/// Of a state on disk: no larger one is written, and none is read.
inline constexpr std::size_t max_state_bytes = std::size_t{16} << 20;
/// Of the state when an instance is started or changed: the rest is for what becomes of all of them.
inline constexpr std::size_t max_accepted_bytes = max_state_bytes / 4 * 3;

/// The state of a file; an empty one if there is none yet. A malformed one is moved aside, and `problem` says so.
/// Throws errc::io_failed if the file cannot be read: the next attempt may succeed.
saved_state load_state(machine& host, const std::string& file, std::string& problem);
/// As it is written to the disk. errc::too_large beyond `max_bytes`.
result<std::string> text_of(const saved_state& state, std::size_t max_bytes);
result<void> save_state(machine& host, const std::string& file, const saved_state& state);

} // namespace ise::instantiation
