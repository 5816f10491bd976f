// environment-boundary: what an instantiation server does to its host is done here
#include <ise/instantiation/real_machine.hpp>

#include <ise/core/asio_compat.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/real/ownership.hpp>
#include <ise/core/waiter.hpp>
#include <ise/instantiation/cgroup.hpp>
#include <ise/instantiation/keeper.hpp>
#include <ise/instantiation/process_table.hpp>
#include <ise/instantiation/spawn.hpp>

#include <asio/buffer.hpp>
#include <asio/posix/stream_descriptor.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <map>
#include <mutex>
#include <sstream>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::instantiation {

/// What was started and has not ended yet.
struct real_machine::running {
    struct kept_entry {
        process_stamp keeper, leader; ///< one and the same where it has none
        std::string mark;
    };
    std::mutex mutex;
    std::map<std::int32_t, kept_entry> all; // by the keeper

    void add(kept_entry what) {
        std::lock_guard lock(mutex);
        auto number = what.keeper.pid;
        all[number] = std::move(what);
    }
    void remove(const process_stamp& keeper) {
        std::lock_guard lock(mutex);
        all.erase(keeper.pid);
    }
};

namespace {

using descriptor = asio::posix::stream_descriptor;

// The keeper does this; here it is for one that was killed, and for programs that have none.
void end_rest(const process_stamp& leader, const std::string& mark) {
    // A process that starts others while it is looked at may slip through once.
    for (int round = 0; round < 3; ++round) {
        auto rest = members_of(leader, mark);
        if (rest.empty()) return;
        for (const auto& one : rest) send_signal(one.stamp, SIGKILL);
    }
}

using kept_entry = real_machine::running::kept_entry;

class real_process final : public process, public std::enable_shared_from_this<real_process> {
public:
    real_process(loop& on, kept_entry who, file_handle watch, std::shared_ptr<real_machine::running> among,
                 machine::end_handler ended)
        : loop_(on), who_(std::move(who)), watch_(on.get_executor(), watch.release()), among_(std::move(among)),
          ended_(std::move(ended)) {
        among_->add(who_);
    }

    void watch() {
        watch_.async_wait(descriptor::wait_read, [me = weak_from_this()](std::error_code problem) {
            auto self = me.lock();
            if (!self || problem) return;
            // The reactor may report what concerned a descriptor of the same number before: it has ended only if it
            // says so.
            pollfd now{self->watch_.native_handle(), POLLIN, 0};
            if (::poll(&now, 1, 0) == 1) self->finish();
            else self->watch();
        });
    }
    const process_stamp& stamp() const noexcept override { return who_.leader; }
    void terminate() override { send_signal_to_group(who_.leader, SIGTERM); }
    void kill() override {
        send_signal_to_group(who_.leader, SIGKILL);
        if (is_kept()) send_signal(who_.keeper, SIGCONT); // it ends the rest, and then itself
        else end_rest(who_.leader, who_.mark);
    }
    void leave() {
        ended_ = nullptr;
        watch_.close();
    }

private:
    bool is_kept() const { return !(who_.keeper == who_.leader); }
    void finish() {
        loop::turn turn(loop_);
        // It is not reaped yet: its number is nobody else's.
        send_signal_to_group(who_.leader, SIGKILL);
        end_rest(who_.leader, who_.mark);
        auto end = reap(who_.keeper.pid);
        if (is_kept()) end = {}; // how the program ended is in the keeper's record
        among_->remove(who_.keeper);
        auto tell = std::exchange(ended_, nullptr);
        if (tell) tell(end);
    }

    loop& loop_;
    kept_entry who_;
    descriptor watch_;
    std::shared_ptr<real_machine::running> among_;
    machine::end_handler ended_;
};

/// What the instance holds of it.
class handle final : public process {
public:
    explicit handle(std::shared_ptr<real_process> of) : of_(std::move(of)) {}
    ~handle() override { of_->leave(); }
    const process_stamp& stamp() const noexcept override { return of_->stamp(); }
    void terminate() override { of_->terminate(); }
    void kill() override { of_->kill(); }

private:
    std::shared_ptr<real_process> of_;
};

std::unique_ptr<process> watched(loop& on, kept_entry who, file_handle watch,
                                 const std::shared_ptr<real_machine::running>& among, machine::end_handler ended) {
    auto made = std::make_shared<real_process>(on, std::move(who), std::move(watch), among, std::move(ended));
    made->watch();
    return std::make_unique<handle>(std::move(made));
}

constexpr auto max_start_time = std::chrono::seconds(5);

/// The program of a keeper, which may be a later life than `known`. A keeper without one may be about to start it: none
/// if it ends first, or does not start it in time.
process_stamp program_of(const process_stamp& keeper, const file_handle& watch, const process_stamp& known,
                         const std::string& mark) {
    auto until = std::chrono::steady_clock::now() + max_start_time;
    do {
        for (const auto& one : descendants_of(keeper.pid))
            if (one.parent == keeper.pid && one.group == one.stamp.pid && carries_mark(one.stamp.pid, mark))
                return one.stamp;
        pollfd ended{watch.get(), POLLIN, 0};
        if (known.pid != 0 || ::poll(&ended, 1, 1) == 1) break;
    } while (std::chrono::steady_clock::now() < until);
    return known;
}

} // namespace

real_machine::real_machine() : running_(std::make_shared<running>()), cgroup_prefix_(usable_cgroup()) {}

real_machine::~real_machine() {
    if (lock_ >= 0) ::close(lock_);
}

result<void> real_machine::take_folder(const std::string& folder) {
    auto refuse = [&] {
        return io_failure(fmt::format("cannot use the folder {}", folder),
                          std::error_code(errno, std::system_category()));
    };
    for (auto at = folder.find('/', 1);; at = folder.find('/', at + 1)) {
        auto part = folder.substr(0, at);
        if (::mkdir(part.c_str(), 0700) != 0 && errno != EEXIST) return refuse();
        if (at == std::string::npos) break;
    }
    auto own = check_own_path(folder);
    if (!own) return own;
    file_handle lock(::open((folder + "/lock").c_str(), O_RDWR | O_CREAT | O_CLOEXEC | O_NOFOLLOW, 0600));
    if (!lock) return refuse();
    struct flock whole {};
    whole.l_type = F_WRLCK;
    if (::fcntl(lock.get(), F_OFD_SETLK, &whole) != 0) {
        if (errno != EAGAIN && errno != EACCES) return refuse();
        return failure(
            errc::address_in_use,
            fmt::format("another instantiation server uses the folder {}: stop it, or choose another with --state",
                        folder));
    }
    lock_ = lock.release();
    return {};
}

void real_machine::end_all(duration grace) {
    std::map<std::int32_t, kept_entry> left;
    {
        std::lock_guard lock(running_->mutex);
        left = std::exchange(running_->all, {});
    }
    for (const auto& [pid, who] : left) send_signal_to_group(who.leader, SIGTERM);
    auto until = std::chrono::steady_clock::now() + grace;
    auto wait_for = [](const process_stamp& which, std::chrono::steady_clock::duration most) {
        auto watch = open_process(which);
        if (!watch) return;
        auto wait = std::chrono::duration_cast<std::chrono::milliseconds>(most).count();
        pollfd ended{watch.get(), POLLIN, 0};
        ::poll(&ended, 1, static_cast<int>(std::clamp<long long>(wait, 0, 3'600'000)));
    };
    for (const auto& [pid, who] : left) wait_for(who.keeper, until - std::chrono::steady_clock::now());
    for (const auto& [pid, who] : left) {
        send_signal_to_group(who.leader, SIGKILL);
        if (!(who.keeper == who.leader)) wait_for(who.keeper, std::chrono::seconds(2)); // it ends what is left
        send_signal(who.keeper, SIGKILL);
        end_rest(who.leader, who.mark);
        reap(pid, true);
    }
}

result<std::unique_ptr<process>> real_machine::launch(loop& on, const launch_order& what, end_handler ended) {
    int ends[2] = {-1, -1};
    if (::pipe2(ends, O_CLOEXEC) != 0)
        return io_failure("cannot make a pipe", std::error_code(errno, std::system_category()));
    file_handle reading(ends[0]), writing(ends[1]);
    launch_order order;
    order.program = "/proc/self/exe"; // this very program, also after its file was replaced
    order.words = keeper_words(what, cgroup_prefix_);
    order.variables = what.variables;
    order.variables.emplace_back(keeper_variable, what.mark);
    auto pid = spawn(order, writing.get());
    if (!pid) return pid.error();
    writing = file_handle();
    auto outcome = line_of_keeper(reading.get(), max_start_time);
    kept_entry who;
    who.mark = what.mark;
    auto keeper = look_up(*pid); // not reaped: the number is its own, whatever it does
    if (keeper) who.keeper = keeper->stamp;
    std::istringstream words(outcome);
    std::string first;
    bool started = words >> first >> who.leader.pid >> who.leader.start_ticks && first == "started";
    auto watch = started ? open_process(who.keeper) : file_handle();
    if (watch) return watched(on, std::move(who), std::move(watch), running_, std::move(ended));
    send_signal(who.keeper, SIGKILL);
    reap(*pid, true);
    if (started)
        return failure(errc::io_failed, fmt::format("cannot watch process {} of {}: the kernel gives no handle of it",
                                                    *pid, what.program));
    return failure(errc::io_failed,
                   outcome.empty()
                       ? fmt::format("cannot start {}: its keeper did not start it within 5 s", what.program)
                       : outcome);
}

result<std::unique_ptr<process>> real_machine::adopt(loop& on, process_stamp who, const std::string& mark,
                                                     end_handler ended) {
    auto keeper = find_keeper(mark);
    auto watch = keeper ? open_process(keeper->stamp) : file_handle();
    auto leader = watch ? program_of(keeper->stamp, watch, who, mark) : process_stamp{};
    if (leader.pid == 0) {
        if (keeper) send_signal(keeper->stamp, SIGKILL); // what it starts now could not be ended
        end_rest(open_process(who) ? process_stamp{} : who, mark);
        return failure(errc::no_such_name, "it does not run any more");
    }
    kept_entry found;
    found.keeper = keeper->stamp;
    found.leader = leader;
    found.mark = mark;
    return watched(on, std::move(found), std::move(watch), running_, std::move(ended));
}

bool real_machine::carries(std::int32_t pid, const std::string& mark) const { return carries_mark(pid, mark); }

bool real_machine::alive(std::int32_t pid) const {
    auto result = look_up(pid);
    return result && !result->ended;
}

task<result<std::string>> real_machine::ask(loop& on, std::string program, std::size_t max_bytes, duration limit) {
    auto complain = [&](errc code, std::string why) {
        return failure(code, fmt::format("{} --describe: {}", program, why));
    };
    int ends[2] = {-1, -1};
    if (::pipe2(ends, O_CLOEXEC) != 0)
        co_return io_failure("cannot make a pipe", std::error_code(errno, std::system_category()));
    file_handle writing(ends[1]);
    descriptor reading(on.get_executor(), ends[0]);
    launch_order order;
    order.program = program;
    order.words = {"--describe"};
    order.mark = fmt::format("describe-{:016x}", on.env().random());
    order.variables = {{"PATH", "/usr/bin:/bin"}, {mark_variable, order.mark}};
    auto pid = spawn(order, writing.get());
    writing = file_handle();
    if (!pid) co_return pid.error();
    auto outcome = look_up(*pid);
    auto who = outcome ? outcome->stamp : process_stamp{*pid, 0};
    process_end end;
    bool over = false;
    waiter<> ended(on);
    auto watch = open_process(who);
    if (!watch) co_return complain(errc::io_failed, "it cannot be watched");
    kept_entry alone;
    alone.keeper = alone.leader = who;
    alone.mark = order.mark;
    auto watching = watched(on, std::move(alone), std::move(watch), running_, [&](process_end how) {
        end = how;
        over = true;
        ended.resume();
    });
    struct ending { // whichever way this coroutine ends
        process& what;
        running& among;
        const bool& over;
        ~ending() {
            if (!over) {
                what.kill();
                reap(what.stamp().pid, true); // killed: it does not take long
            }
            among.remove(what.stamp());
        }
    } guard{*watching, *running_, over};
    bool late = false;
    timer deadline(on, [&] {
        late = true;
        watching->kill();
        std::error_code ignored;
        reading.close(ignored);
    });
    deadline.arm(saturating_add(on.now(), limit));

    std::string text;
    std::array<char, 4096> piece;
    for (;;) {
        auto [problem, count] = co_await reading.async_read_some(asio::buffer(piece), compat::as_tuple);
        text.append(piece.data(), count);
        if (problem || text.size() > max_bytes) break;
    }
    if (text.size() > max_bytes)
        co_return complain(errc::too_large, fmt::format("it says more than {} bytes", max_bytes));
    while (!over) co_await ended.wait();
    if (late) co_return complain(errc::timed_out, "it did not end in time");
    if (!end.well()) co_return complain(errc::io_failed, "it ended with " + end.text());
    co_return text;
}

} // namespace ise::instantiation
