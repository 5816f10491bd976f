// How long an edit of the access policy takes to reach every one of 1,000 sessions (or as many as the argument says),
// over tcp in one process: from the moment at which the file is replaced until each session has been refused what is
// denied now, or granted it again. Calls that the policy always allows go on meanwhile, and none may fail.
#include "support/report.hpp"

#include <ise/ise.hpp>
#include <ise/service/service_host.hpp>

#include <sys/resource.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <string>

namespace {

using namespace std::chrono_literals;

struct ping {
    std::uint32_t number = 0;
};
constexpr ise::request_response<ping, ping> always{"always"};
constexpr ise::request_response<ping, ping> sometimes{"sometimes"};
constexpr ise::duration generous = 20s;

struct tally {
    std::atomic<bool> over = false;
    std::atomic<std::size_t> connected = 0, denied = 0;
    std::atomic<std::uint64_t> allowed_calls = 0, failed_calls = 0;
};

class server final : public ise::component {
    ise::task<> run() override {
        provide(always, [](ping request) { return request; });
        provide(sometimes, [](ping request) { return request; });
        co_return;
    }
};

class caller final : public ise::component {
public:
    caller(std::size_t number, ise::endpoint to, tally& all) : number_(number), to_(std::move(to)), all_(all) {}

private:
    ise::task<> run() override {
        while (number_ >= all_.connected + 64) co_await sleep(2ms); // handshakes at a time are bounded
        auto peer = at(to_);
        auto connected = co_await peer.connect(generous);
        connected.value();
        ++all_.connected;
        bool denied = false;
        while (!all_.over) {
            auto allowed = co_await peer.try_call(always, ping(), generous);
            ++(allowed ? all_.allowed_calls : all_.failed_calls);
            auto changed = co_await peer.try_call(sometimes, ping(), generous);
            if (denied != !changed) {
                denied = !changed;
                all_.denied += denied ? std::size_t{1} : std::size_t(-1);
            }
            co_await sleep(100ms);
        }
    }

    std::size_t number_;
    ise::endpoint to_;
    tally& all_;
};

void write_policy(const std::filesystem::path& file, const char* may_call) {
    auto next = file;
    next += ".next";
    std::ofstream(next) << "version = 1\n[[allow]]\nwho = \"nobody\"\nname = [\"bench/*\"]\ncall = [\"bench/server:"
                        << may_call << "\"]\n";
    std::filesystem::permissions(next, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
    std::filesystem::rename(next, file);
}

double seconds_until_denied(const tally& all, std::size_t wanted, std::int64_t since_ns) {
    while (all.denied != wanted) {
        if (bench::now_ns() - since_ns > 60'000'000'000) {
            std::fprintf(stderr, "bench_access_edit: after a minute %zu sessions are denied, not %zu\n",
                         all.denied.load(), wanted);
            std::exit(1);
        }
        ::usleep(1000);
    }
    return static_cast<double>(bench::now_ns() - since_ns) * 1e-9;
}

} // namespace

int main(int argc, char** argv) {
    const std::size_t sessions = argc > 1 ? std::strtoul(argv[1], nullptr, 10) : 1000;
    if (argc > 2 || sessions == 0) {
        std::fprintf(stderr, "usage: bench_access_edit [SESSIONS]\n");
        return 2;
    }
    rlimit descriptors{};
    if (::getrlimit(RLIMIT_NOFILE, &descriptors) == 0) {
        descriptors.rlim_cur = descriptors.rlim_max;
        ::setrlimit(RLIMIT_NOFILE, &descriptors);
    }
    const auto folder = std::filesystem::temp_directory_path() / ("bench-access-" + std::to_string(::getpid()));
    std::filesystem::create_directories(folder);
    const auto file = folder / "access.toml";
    write_policy(file, "*");

    tally all;
    {
        ise::node_options how;
        how.name = "bench";
        how.use_names = false;
        how.security.access_file = file.string();
        how.log = ise::log_to_stderr(ise::log_level::error);
        ise::real_environment world;
        ise::node node(world, std::move(how));
        ise::component_options serving;
        serving.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
        serving.registers = false;
        const auto to =
            node.launch("bench/server", std::make_unique<server>(), std::move(serving)).services().listening().front();
        ise::component_options asking;
        asking.listens = false;
        asking.registers = false;
        for (std::size_t i = 0; i != sessions; ++i) {
            auto mine = asking;
            if (i > 0) mine.together_with = "bench/caller-0";
            node.start<caller>("bench/caller-" + std::to_string(i), mine, i, to, all);
        }
        const auto began = bench::now_ns();
        while (all.connected != sessions && bench::now_ns() - began < 60'000'000'000) ::usleep(1000);
        std::printf("%zu of %zu sessions\n", all.connected.load(), sessions);
        for (int round = 0; round != 3; ++round) {
            auto edited = bench::now_ns();
            write_policy(file, "always");
            const double denied = seconds_until_denied(all, sessions, edited);
            edited = bench::now_ns();
            write_policy(file, "*");
            const double granted = seconds_until_denied(all, 0, edited);
            std::printf("denied at all after %.2f s, granted at all after %.2f s\n", denied, granted);
        }
        all.over = true;
        std::printf("%llu allowed calls meanwhile, %llu of them failed\n",
                    static_cast<unsigned long long>(all.allowed_calls.load()),
                    static_cast<unsigned long long>(all.failed_calls.load()));
    }
    std::filesystem::remove_all(folder);
    return all.failed_calls == 0 ? 0 : 1;
}
