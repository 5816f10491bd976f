#include "pool.hpp"

#include <apps/progress_line.hpp>

#include <fmt/format.h>

#include <sys/mman.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <csignal>
#include <cstdio>
#include <cstring>
#include <map>
#include <memory>
#include <thread>
#include <vector>

namespace seeds {
namespace {

using clock = std::chrono::steady_clock;

// A seed takes a second or so; one that takes this long does not come to its end.
constexpr auto max_seed = std::chrono::minutes(5);
constexpr int max_failures = 20; // then no further seed begins

// What a worker tells its parent, in memory that they share.
struct slot {
    std::atomic<std::uint64_t> playing{0}; ///< the seed, plus one
    std::atomic<std::uint64_t> played{0};
};
struct shared_state {
    std::atomic<std::uint64_t> next{0};
    std::atomic<std::uint64_t> passed{0}, failed{0}, steps{0}, virtual_ms{0}, max_memory{0};
    std::array<slot, 256> slots;
};
static_assert(std::atomic<std::uint64_t>::is_always_lock_free);

struct unmap {
    void operator()(shared_state* at) const {
        at->~shared_state();
        ::munmap(at, sizeof(shared_state));
    }
};

std::unique_ptr<shared_state, unmap> share() {
    void* at = ::mmap(nullptr, sizeof(shared_state), PROT_READ | PROT_WRITE, MAP_SHARED | MAP_ANONYMOUS, -1, 0);
    if (at == MAP_FAILED) throw std::runtime_error("no memory to share with the workers");
    return std::unique_ptr<shared_state, unmap>(new (at) shared_state);
}

void tell(std::uint64_t seed, const std::string& violation, const std::string& newest) {
    auto text = fmt::format("seed {}: {}\n{}  replay: ise_seeds --seed {} --verbose\n", seed, violation, newest, seed);
    [[maybe_unused]] auto written = ::write(STDOUT_FILENO, text.data(), text.size());
}

// Tallies go to the parent as lines through a pipe at the worker's end.
void write_tallies(int to, const std::map<std::string, std::uint64_t>& all) {
    std::string text;
    for (const auto& [what, times] : all) text += fmt::format("{}\t{}\n", times, what);
    for (std::size_t at = 0; at < text.size();) {
        auto wrote = ::write(to, text.data() + at, text.size() - at);
        if (wrote <= 0) return;
        at += static_cast<std::size_t>(wrote);
    }
}

void work(const pool_options& options, shared_state& all, slot& mine, clock::time_point until, int tallies_to) {
    std::map<std::string, std::uint64_t> tallies;
    std::ptrdiff_t left = 0;
    int seeds = 0;
    for (;;) {
        if (all.failed >= max_failures || (options.seconds > 0 && clock::now() > until)) break;
        auto at = all.next++;
        if (at >= options.seeds) break;
        auto seed = options.from + at;
        mine.playing = seed + 1;
        auto result = play(seed, options.run);
        if (++seeds > 20) left += result.memory_left; // by then what is made once has been made
        if (result.passed && left > (256 << 10)) {
            result.passed = false;
            result.violation = fmt::format("memory grows: {} bytes since the 20th seed of this process", left);
        }
        for (const auto& [what, times] : result.tallies) tallies[what] += times;
        all.steps += result.steps;
        all.virtual_ms += static_cast<std::uint64_t>(result.virtual_seconds * 1000);
        for (auto most = all.max_memory.load();
             result.max_memory > most && !all.max_memory.compare_exchange_weak(most, result.max_memory);) {}
        ++(result.passed ? all.passed : all.failed);
        if (!result.passed) tell(seed, result.violation, result.newest);
        ++mine.played;
        if (options.seeds == 1) fmt::print("seed {}: trace hash {:016x}, {} steps\n", seed, result.hash, result.steps);
    }
    mine.playing = 0;
    std::fflush(stdout);
    write_tallies(tallies_to, tallies);
}

struct worker {
    ::pid_t process = 0;
    std::uint64_t played = 0;
    clock::time_point heard;
};

void read_tallies(int from, std::map<std::string, std::uint64_t>& into) {
    std::unique_ptr<std::FILE, int (*)(std::FILE*)> lines(::fdopen(from, "r"), &std::fclose);
    std::array<char, 1024> line;
    while (std::fgets(line.data(), line.size(), lines.get())) {
        auto* tab = std::strchr(line.data(), '\t');
        if (!tab) continue;
        std::string what(tab + 1);
        if (!what.empty()) what.pop_back();
        into[what] += std::strtoull(line.data(), nullptr, 10);
    }
}

} // namespace

bool play_all(const pool_options& options) {
    auto began = clock::now();
    auto until = began + std::chrono::duration_cast<clock::duration>(std::chrono::duration<double>(options.seconds));
    auto all = share();
    std::array<int, 2> tallies_pipe{};
    if (::pipe(tallies_pipe.data()) != 0) throw std::runtime_error("no pipe to the workers");
    auto jobs = static_cast<unsigned>(std::min<std::uint64_t>({options.jobs, options.seeds, all->slots.size()}));
    std::vector<worker> workers(jobs);
    auto start = [&](std::size_t at) {
        std::fflush(stdout);
        auto process = ::fork();
        if (process < 0) throw std::runtime_error("a worker cannot be started");
        if (process == 0) {
            work(options, *all, all->slots[at], until, tallies_pipe[1]);
            ::_exit(0);
        }
        workers[at].process = process;
        workers[at].heard = clock::now();
    };
    progress_line progress;
    std::map<std::string, std::uint64_t> tallies;
    std::thread reader([&] { read_tallies(tallies_pipe[0], tallies); });
    for (std::size_t at = 0; at < jobs; ++at) start(at);
    for (std::size_t running = jobs; running > 0;) {
        for (std::size_t at = 0; at < jobs; ++at) {
            auto& one = workers[at];
            if (one.process <= 1) continue;
            auto& mine = all->slots[at];
            int status = 0;
            if (::waitpid(one.process, &status, WNOHANG) == one.process) {
                one.process = 0;
                --running;
                bool orderly = WIFEXITED(status) && WEXITSTATUS(status) == 0;
                if (orderly) continue;
                ++all->failed;
                if (mine.playing)
                    tell(mine.playing - 1,
                         WIFSIGNALED(status) ? fmt::format("the process died of signal {}", WTERMSIG(status))
                                             : "the process ended",
                         "");
                start(at); // goes on behind it
                ++running;
            } else if (mine.played != one.played) {
                one.played = mine.played;
                one.heard = clock::now();
            } else if (clock::now() - one.heard > max_seed) {
                tell(mine.playing - 1, "does not come to its end", "");
                ::kill(one.process, SIGKILL);
                one.heard = clock::now();
            }
        }
        auto played = all->passed + all->failed;
        auto part = static_cast<double>(played) / static_cast<double>(options.seeds);
        if (options.seconds > 0)
            part = std::max(part, std::chrono::duration<double>(clock::now() - began).count() / options.seconds);
        if (options.seeds > 1)
            progress.show(part, fmt::format("{} of {} seeds{}", played, options.seeds,
                                            all->failed > 0 ? fmt::format(", {} FAILED", all->failed.load()) : ""));
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    }
    progress.clear();
    ::close(tallies_pipe[1]);
    reader.join();

    auto seconds = std::chrono::duration<double>(clock::now() - began).count();
    for (const auto& [what, times] : tallies) fmt::print("{:>12} {}\n", times, what);
    fmt::print(
        "{} seeds passed, {} failed in {:.1f} s: {} steps, {:.1f} virtual hours, at most {} KiB in use at once\n",
        all->passed.load(), all->failed.load(), seconds, all->steps.load(),
        static_cast<double>(all->virtual_ms.load()) / 3.6e6, all->max_memory.load() / 1024);
    bool enough = all->passed > 0 && (all->passed >= options.seeds || options.seconds > 0);
    return all->failed == 0 && enough;
}

} // namespace seeds
