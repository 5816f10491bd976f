#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/instantiation/launch_order.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace ise::instantiation {

/// Which process: a number alone is used again. Valid within one boot of the machine.
struct process_stamp {
    std::int32_t pid = 0; ///< 0: none
    std::uint64_t start_ticks = 0;

    bool operator==(const process_stamp&) const = default;
};

/// How a process ended.
struct process_end {
    bool known = false; ///< false: there is no record of it
    bool by_signal = false;
    int number = 0;     ///< exit code or signal
    std::string reason; ///< what became of it, where that says more than exit code or signal

    bool well() const noexcept { return known && !by_signal && number == 0; }
    /// "exit code 3", "signal 9 (Killed)"
    std::string text() const;
};

/// A process that is watched, at the head of a process group of its own. Destroying it leaves the process alone and
/// calls nobody any more.
class process {
public:
    virtual ~process() = default;
    virtual const process_stamp& stamp() const noexcept = 0;
    /// SIGTERM, or SIGKILL, to its whole group.
    virtual void terminate() = 0;
    virtual void kill() = 0;
};

/// A program that lies in a folder.
struct program_file {
    std::string name;
    std::string version;   ///< `machine::version_of` it
    std::string objection; ///< why it must not be run: others than this user could replace it

    bool operator==(const program_file&) const = default;
};

/// What an instantiation server does to its host: starts programs, watches them, keeps files. Real, or of a virtual
/// world. Used on one loop; outlives the server and its processes.
class machine {
public:
    virtual ~machine() = default;

    /// Called once, on the loop, when the process has ended and nothing of its group or mark is left.
    using end_handler = std::function<void(process_end)>;

    /// Starts a program. errc::io_failed says why it cannot.
    virtual result<std::unique_ptr<process>> launch(loop& on, const launch_order& what, end_handler ended) = 0;
    /// Watches a process that an instantiation server before this one had started: the one that was started under the
    /// mark. `who` is what was known of it. errc::no_such_name if it is gone; what it left behind has been ended then.
    virtual result<std::unique_ptr<process>> adopt(loop& on, process_stamp who, const std::string& mark,
                                                   end_handler ended) = 0;
    /// Whether the process `pid` is one that was started under the mark.
    virtual bool carries(std::int32_t pid, const std::string& mark) const = 0;
    virtual bool alive(std::int32_t pid) const = 0;
    /// Another after each start of the machine.
    virtual std::string boot() const = 0;

    /// The programs in a folder: plain executable files, by name. errc::unauthorized: others than this user could put
    /// programs into it; errc::io_failed.
    virtual result<std::vector<program_file>> programs(const std::string& folder) const = 0;
    /// Which program lies there: another text after it was built again. By its build id where it has one, else by size
    /// and time. Empty: there is none.
    virtual std::string version_of(const std::string& program) const = 0;
    /// What a program answers to `--describe`, at most `max_bytes`. errc::io_failed, errc::timed_out, errc::too_large.
    /// Cancellation: terminal; the program is ended.
    virtual task<result<std::string>> ask(loop& on, std::string program, std::size_t max_bytes, duration limit) = 0;

    /// errc::io_failed; errc::no_such_name if there is no such file.
    virtual result<std::string> read_file(const std::string& path, std::size_t max_bytes) const = 0;
    /// All of the content or, after a crash at any moment, all of the former one.
    virtual result<void> replace_file(const std::string& path, const std::string& content) = 0;
    /// The same, and room for as much is kept for the next time, so that a full disk does not stop it. The file may end
    /// in spaces.
    virtual result<void> replace_reserved(const std::string& path, const std::string& content) = 0;
    /// In place of what may be there. errc::io_failed.
    virtual result<void> rename(const std::string& from, const std::string& to) = 0;
    /// Bytes of a file; 0 if there is none.
    virtual std::uint64_t size_of(const std::string& path) const = 0;
    /// At most `max_bytes` from an offset on; empty at its end.
    virtual std::string read_part(const std::string& path, std::uint64_t offset, std::size_t max_bytes) const = 0;
    virtual void remove(const std::string& path) = 0;
};

} // namespace ise::instantiation
