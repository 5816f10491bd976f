// A name server with many names: the nodes that hold them (`serve names`), and the one who asks for them.
#include "collector.hpp"
#include "programs.hpp"

#include <ise/asio.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/naming/services.hpp>
#include <ise/service/service_host.hpp>

#include <cinttypes>
#include <cstdio>

namespace bench {
namespace {

constexpr std::size_t asked_at_once = 64;
constexpr std::uint32_t page = 1000;
constexpr auto look_again = std::chrono::milliseconds(10);

// Of equal length, so that they are listed in the order of their numbers.
std::string name_of(std::size_t number) {
    char digits[16];
    std::snprintf(digits, sizeof digits, "%07zu", number);
    return std::string("bench/named/") + digits;
}

// One of many: it provides its services and does nothing else.
class named final : public ise::component {
public:
    explicit named(std::size_t services) : services_(services) {}

private:
    ise::task<> run() override {
        for (std::size_t i = 0; i != services_; ++i) {
            const ise::request_response<ask_memory, memory_used> service(echo_name(i));
            provide(service, [](ask_memory) { return memory_used(); });
        }
        co_return;
    }

    std::size_t services_;
};

class asker final : public ise::component {
public:
    asker(ise::endpoint server, std::size_t names) : server_(std::move(server)), names_(names) {}

    /// Completes when the server has listed every name, and gives the time. A page is asked for again until it is
    /// whole, so that looking costs the server little.
    ise::task<std::int64_t> until_whole() {
        auto peer = at(server_);
        std::size_t seen = 0;
        ise::naming::list_request wanted;
        wanted.prefix = "bench/named";
        wanted.limit = page;
        while (seen != names_) {
            auto listed = co_await peer.try_call(ise::naming::list, wanted, generous);
            const auto before = seen;
            if (listed) {
                const auto due = std::min<std::size_t>(page, names_ - seen);
                const bool whole =
                    listed->names.size() >= due && listed->names[due - 1].path == name_of(seen + due - 1);
                if (whole) {
                    seen += due;
                    wanted.after = listed->names[due - 1].path;
                }
            }
            if (seen == before) co_await sleep(look_again);
        }
        co_return now_ns();
    }

    ise::task<double> resolves_per_s(double seconds) {
        auto peer = at(server_);
        for (std::size_t i = 0; i != asked_at_once; ++i) resolve_again(peer, i * 131);
        const auto began = now_ns();
        co_await sleep(std::chrono::nanoseconds(static_cast<std::int64_t>(seconds * 1e9)));
        const auto rate = static_cast<double>(resolved_) / (static_cast<double>(now_ns() - began) * 1e-9);
        done_ = true;
        while (running_ != 0) co_await sleep(std::chrono::milliseconds(1));
        if (failed_) throw ise::error(*failed_);
        co_return rate;
    }

private:
    ise::task<> run() override { co_return; }

    void resolve_again(const ise::remote& peer, std::size_t number) {
        ++running_;
        ise::naming::resolve_request wanted;
        wanted.path = name_of(number % names_);
        peer.try_call(ise::naming::resolve, std::move(wanted), generous,
                      [this, peer, number](ise::result<ise::naming::resolve_response> found) {
                          --running_;
                          if (!found) failed_ = found.error();
                          else ++resolved_;
                          if (found && !done_) resolve_again(peer, number + 7919);
                      });
    }

    ise::endpoint server_;
    std::size_t names_;
    std::uint64_t resolved_ = 0;
    std::size_t running_ = 0;
    bool done_ = false;
    std::optional<ise::failure> failed_;
};

} // namespace

void serve_names(const options& asked) {
    ise::real_environment env;
    auto how_the_node = node_options();
    how_the_node.use_names = true;
    how_the_node.name_servers = ise::parse_name_servers(asked.connect).value();
    ise::node crowd(env, how_the_node);
    for (std::size_t i = asked.first; i != asked.first + asked.outstanding; ++i) {
        ise::component_options how;
        how.listen = {ise::endpoint::parse("inproc://bench-named-" + std::to_string(i)).value()};
        if (i != asked.first) how.together_with = name_of(asked.first);
        crowd.start<named>(name_of(i), std::move(how), asked.services);
    }
    announce("started");
    while (std::getchar() != EOF) {}
    crowd.stop(); // which withdraws them
    crowd.wait();
}

void measure_names(const options& asked) {
    ise::real_environment env;
    ise::node node(env, node_options());
    const auto where = ise::endpoint::parse(asked.connect).value();
    auto& one = node.start<asker>("bench/asker", asking(), where, asked.outstanding);
    std::printf("{\"work\":\"names\",\"names\":%zu,", asked.outstanding);
    if (asked.seconds > 0) std::printf("\"resolves_per_s\":%.0f}\n", one.wait(one.resolves_per_s(asked.seconds)));
    else std::printf("\"whole_at_ns\":%" PRId64 "}\n", one.wait(one.until_whole()));
    std::fflush(stdout);
    node.stop();
    node.wait();
}

} // namespace bench
