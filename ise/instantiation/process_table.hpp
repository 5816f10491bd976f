#pragma once
#include <ise/instantiation/machine.hpp>
#include <ise/naming/services.hpp>

#include <functional>
#include <optional>

namespace ise::instantiation {

/// The variable that carries the mark of an instance, through all that it starts.
inline constexpr const char* mark_variable = naming::launch_mark_variable;
/// The variable that carries it to the keeper of the instance.
inline constexpr const char* keeper_variable = "ISE_KEEPER";

/// A descriptor that is closed with its owner.
class file_handle {
public:
    explicit file_handle(int number = -1) noexcept : number_(number) {}
    ~file_handle();
    file_handle(file_handle&& other) noexcept : number_(std::exchange(other.number_, -1)) {}
    file_handle& operator=(file_handle&& other) noexcept {
        std::swap(number_, other.number_);
        return *this;
    }
    int get() const noexcept { return number_; }
    int release() noexcept { return std::exchange(number_, -1); }
    explicit operator bool() const noexcept { return number_ >= 0; }

private:
    int number_;
};

/// A line of /proc, as far as it matters here.
struct process_entry {
    process_stamp stamp;
    std::int32_t parent = 0;
    std::int32_t group = 0;
    bool ended = false; ///< waits for its parent
    std::uint32_t threads = 0;
    std::uint64_t resident_bytes = 0; ///< with what it shares with others
};

/// What a small file has, at most so many bytes; empty if it cannot be read.
std::string content_of_file(const std::string& path, std::size_t most);

std::optional<process_entry> look_up(std::int32_t pid);
bool carries_mark(std::int32_t pid, const std::string& mark, const char* variable = mark_variable);
/// All processes below one, the nearest first. While they start others some may be missing.
std::vector<process_entry> descendants_of(std::int32_t pid);
/// Gives them one by one as they are found, until `visit` gives false.
void visit_descendants(std::int32_t pid, const std::function<bool(const process_entry&)>& visit);
/// The keeper of an instance; none if there is none.
std::optional<process_entry> find_keeper(const std::string& mark);
/// What runs of an instance: of its group, or carrying its mark, the oldest first.
std::vector<process_entry> members_of(const process_stamp& leader, const std::string& mark);
/// Threads of all processes of a user.
std::uint64_t threads_of_user(std::uint32_t user);
/// A handle of exactly that process; none if it is gone.
file_handle open_process(const process_stamp& who);
/// Never to another process than that one.
void send_signal(const process_stamp& who, int number);
/// To a group whose leader is that process: nothing once the leader's number may be another's.
void send_signal_to_group(const process_stamp& leader, int number);
/// How a child ended, and lets the system forget it; `known` is false where it is none of ours, or has not ended yet
/// and is not to be waited for.
process_end reap(std::int32_t pid, bool wait = false);
/// How it ended, as `waitpid` tells.
process_end end_of_status(int status);

} // namespace ise::instantiation
