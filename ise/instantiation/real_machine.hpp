#pragma once
#include <ise/instantiation/machine.hpp>

#include <memory>
#include <string>

namespace ise::instantiation {

/// Where `replace_reserved` keeps the room.
inline std::string spare_of(const std::string& path) { return path + ".spare"; }

/// The host that this process runs on. Each program has a keeper (keeper.hpp), which is this process's program too: its
/// `main` calls `keep_if_asked` first. Keepers are started by Boost.Process, watched through pidfds; there is no
/// handler of SIGCHLD.
class real_machine final : public machine {
public:
    real_machine();
    ~real_machine() override;

    /// Makes the folder if need be and keeps other instantiation servers out of it as long as this process lives.
    /// errc::address_in_use if one is in it; errc::unauthorized if others than this user could change what is in it;
    /// errc::io_failed.
    result<void> take_folder(const std::string& folder);
    /// Ends what was started and still runs: SIGTERM, and SIGKILL after `grace`. Blocks so long; for the end of a
    /// program, when no loop runs any more.
    void end_all(duration grace);

    result<std::unique_ptr<process>> launch(loop& on, const launch_order& what, end_handler ended) override;
    result<std::unique_ptr<process>> adopt(loop& on, process_stamp who, const std::string& mark,
                                           end_handler ended) override;
    bool carries(std::int32_t pid, const std::string& mark) const override;
    bool alive(std::int32_t pid) const override;
    std::string boot() const override;
    result<std::vector<program_file>> programs(const std::string& folder) const override;
    std::string version_of(const std::string& program) const override;
    task<result<std::string>> ask(loop& on, std::string program, std::size_t max_bytes, duration limit) override;
    result<std::string> read_file(const std::string& path, std::size_t max_bytes) const override;
    result<void> replace_file(const std::string& path, const std::string& content) override;
    result<void> replace_reserved(const std::string& path, const std::string& content) override;
    result<void> rename(const std::string& from, const std::string& to) override;
    std::uint64_t size_of(const std::string& path) const override;
    std::string read_part(const std::string& path, std::uint64_t offset, std::size_t max_bytes) const override;
    void remove(const std::string& path) override;

    struct running; ///< for the parts of this machine

private:
    std::shared_ptr<running> running_;
    std::string cgroup_prefix_; // of the control groups of instances; empty: none can be made
    int lock_ = -1;
};

} // namespace ise::instantiation
