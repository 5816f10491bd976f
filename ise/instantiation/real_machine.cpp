// environment-boundary: what an instantiation server does to its host is done here
#include <ise/instantiation/real_machine.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/real/ownership.hpp>
#include <ise/core/waiter.hpp>
#include <ise/instantiation/process_table.hpp>
#include <ise/instantiation/spawn.hpp>

#include <asio/buffer.hpp>
#include <asio/experimental/as_tuple.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <asio/use_awaitable.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <csignal>
#include <map>
#include <mutex>

#include <fcntl.h>
#include <poll.h>
#include <sys/stat.h>
#include <unistd.h>

namespace ise::instantiation {

/// What was started and has not ended yet.
struct real_machine::running {
    std::mutex mutex;
    std::map<std::int32_t, std::pair<process_stamp, std::string>> all; // with its mark

    void add(const process_stamp& who, const std::string& mark) {
        std::lock_guard lock(mutex);
        all[who.pid] = {who, mark};
    }
    void remove(const process_stamp& who) {
        std::lock_guard lock(mutex);
        all.erase(who.pid);
    }
};

namespace {

using descriptor = asio::posix::stream_descriptor;

void end_rest(const process_stamp& leader, const std::string& mark) {
    // A process that starts others while it is looked at may slip through once.
    for (int round = 0; round < 3; ++round) {
        auto rest = members_of(leader, mark);
        if (rest.empty()) return;
        for (const auto& one : rest) send_signal(one.stamp, SIGKILL);
    }
}

class real_process final : public process, public std::enable_shared_from_this<real_process> {
public:
    real_process(loop& on, process_stamp who, std::string mark, file_handle watch, std::shared_ptr<real_machine::running> among, machine::end_handler ended)
        : loop_(on), who_(who), mark_(std::move(mark)), watch_(on.get_executor(), watch.release()), among_(std::move(among)), ended_(std::move(ended)) {
        among_->add(who_, mark_);
    }

    void watch() {
        watch_.async_wait(descriptor::wait_read, [me = weak_from_this()](std::error_code problem) {
            auto self = me.lock();
            if (!self || problem) return;
            // The reactor may report what concerned a descriptor of the same number before: it has ended only if it says so.
            pollfd now{self->watch_.native_handle(), POLLIN, 0};
            if (::poll(&now, 1, 0) == 1) self->finish();
            else self->watch();
        });
    }
    const process_stamp& stamp() const noexcept override { return who_; }
    void terminate() override { send_signal_to_group(who_, SIGTERM); }
    void kill() override {
        send_signal_to_group(who_, SIGKILL);
        end_rest(who_, mark_);
    }
    void leave() {
        ended_ = nullptr;
        watch_.close();
    }

private:
    void finish() {
        loop::turn turn(loop_);
        // The leader is not reaped yet: its number is nobody else's.
        send_signal_to_group(who_, SIGKILL);
        end_rest(who_, mark_);
        auto end = reap(who_.pid);
        among_->remove(who_);
        auto tell = std::exchange(ended_, nullptr);
        if (tell) tell(end);
    }

    loop& loop_;
    process_stamp who_;
    std::string mark_;
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

std::unique_ptr<process> watched(loop& on, process_stamp who, const std::string& mark, file_handle watch, const std::shared_ptr<real_machine::running>& among,
                                 machine::end_handler ended) {
    auto made = std::make_shared<real_process>(on, who, mark, std::move(watch), among, std::move(ended));
    made->watch();
    return std::make_unique<handle>(std::move(made));
}

} // namespace

real_machine::real_machine() : running_(std::make_shared<running>()) {}

real_machine::~real_machine() {
    if (lock_ >= 0) ::close(lock_);
}

result<void> real_machine::take_folder(const std::string& folder) {
    auto refuse = [&] { return io_failure(fmt::format("cannot use the folder {}", folder), std::error_code(errno, std::system_category())); };
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
        return failure(errc::address_in_use, fmt::format("another instantiation server uses the folder {}: stop it, or choose another with --state", folder));
    }
    lock_ = lock.release();
    return {};
}

void real_machine::end_all(duration grace) {
    std::map<std::int32_t, std::pair<process_stamp, std::string>> left;
    {
        std::lock_guard lock(running_->mutex);
        left = std::exchange(running_->all, {});
    }
    for (const auto& [pid, who] : left) send_signal_to_group(who.first, SIGTERM);
    auto until = std::chrono::steady_clock::now() + grace;
    for (const auto& [pid, who] : left) {
        if (auto watch = open_process(who.first)) {
            auto wait = std::chrono::duration_cast<std::chrono::milliseconds>(until - std::chrono::steady_clock::now()).count();
            pollfd ended{watch.get(), POLLIN, 0};
            ::poll(&ended, 1, static_cast<int>(std::clamp<long long>(wait, 0, 3'600'000)));
        }
        send_signal_to_group(who.first, SIGKILL);
        end_rest(who.first, who.second);
        reap(pid, true);
    }
}

result<std::unique_ptr<process>> real_machine::launch(loop& on, const launch_order& what, end_handler ended) {
    auto order = what;
    order.variables.emplace_back(mark_variable, what.mark);
    auto pid = spawn(order);
    if (!pid) return pid.error();
    // Not reaped: the number is its own, whatever it does.
    auto told = look_up(*pid);
    file_handle watch = told ? open_process(told->stamp) : file_handle();
    if (!watch) {
        if (*pid > 1) ::kill(-*pid, SIGKILL);
        reap(*pid, true);
        return failure(errc::io_failed, fmt::format("cannot watch process {} of {}: the kernel gives no handle of it", *pid, what.program));
    }
    return watched(on, told->stamp, what.mark, std::move(watch), running_, std::move(ended));
}

result<std::unique_ptr<process>> real_machine::adopt(loop& on, process_stamp who, const std::string& mark, end_handler ended) {
    if (who.pid == 0) { // it was started, and the server killed before it could write down what it had got
        for (const auto& one : members_of({}, mark))
            if (one.group == one.stamp.pid) {
                who = one.stamp;
                break;
            }
    }
    auto watch = open_process(who);
    auto told = look_up(who.pid);
    if (!watch || !told || told->ended || !carries_mark(who.pid, mark)) {
        end_rest(watch ? process_stamp{} : who, mark);
        return failure(errc::no_such_name, "it does not run any more");
    }
    return watched(on, who, mark, std::move(watch), running_, std::move(ended));
}

bool real_machine::carries(std::int32_t pid, const std::string& mark) const { return carries_mark(pid, mark); }

bool real_machine::alive(std::int32_t pid) const {
    auto told = look_up(pid);
    return told && !told->ended;
}

task<result<std::string>> real_machine::ask(loop& on, std::string program, std::size_t max_bytes, duration limit) {
    auto complain = [&](errc code, std::string why) { return failure(code, fmt::format("{} --describe: {}", program, why)); };
    int ends[2] = {-1, -1};
    if (::pipe2(ends, O_CLOEXEC) != 0) co_return io_failure("cannot make a pipe", std::error_code(errno, std::system_category()));
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
    auto told = look_up(*pid);
    auto who = told ? told->stamp : process_stamp{*pid, 0};
    process_end end;
    bool over = false;
    waiter<> ended(on, [&ended] { ended.resume(); });
    auto watch = open_process(who);
    if (!watch) co_return complain(errc::io_failed, "it cannot be watched");
    auto watching = watched(on, who, order.mark, std::move(watch), running_, [&](process_end how) {
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
        auto [problem, count] = co_await reading.async_read_some(asio::buffer(piece), asio::experimental::as_tuple(asio::use_awaitable));
        text.append(piece.data(), count);
        if (problem || text.size() > max_bytes) break;
    }
    if (text.size() > max_bytes) co_return complain(errc::too_large, fmt::format("it says more than {} bytes", max_bytes));
    while (!over) co_await ended.wait();
    if (late) co_return complain(errc::timed_out, "it did not end in time");
    if (!end.well()) co_return complain(errc::io_failed, "it ended with " + end.text());
    co_return text;
}

} // namespace ise::instantiation
