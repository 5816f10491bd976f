// What an idle connection costs the process that accepted it, in user space.
#include "collector.hpp"
#include "programs.hpp"

#include <ise/service/service_host.hpp>

#include <fstream>
#include <malloc.h>
#include <unistd.h>

namespace bench {
namespace {

class memory_teller final : public ise::component {
    ise::task<> run() override {
        provide(memory, [this](ask_memory) -> memory_used {
            memory_used result;
            const auto heap = ::mallinfo2();
            result.heap_bytes = heap.uordblks + heap.hblkhd;
            std::uint64_t total_pages = 0, resident_pages = 0, shared_pages = 0;
            std::ifstream("/proc/self/statm") >> total_pages >> resident_pages >> shared_pages;
            result.resident_bytes =
                (resident_pages - shared_pages) * static_cast<std::uint64_t>(::sysconf(_SC_PAGESIZE));
            result.sessions = static_cast<std::uint32_t>(services().sessions().size());
            return result;
        });
        provide(echo<telemetry>, [](telemetry request) -> ise::task<telemetry> { co_return request; });
        co_return;
    }
};

// All measuring components run on one loop.
struct progress_made {
    bool begun = false;
    std::size_t connected = 0;
};

// Connects once and then only keeps its session: each such component has a connection of its own.
class idler final : public ise::component {
public:
    idler(std::size_t number, ise::endpoint server, std::shared_ptr<progress_made> all)
        : number_(number), server_(std::move(server)), all_(std::move(all)) {}

private:
    ise::task<> run() override {
        // Not all at once: the server bounds the handshakes that it does at a time.
        while (!all_->begun || number_ >= all_->connected + 64) co_await sleep(std::chrono::milliseconds(2));
        peer_ = at(server_);
        auto connected = co_await peer_.connect(std::chrono::minutes(1));
        connected.value();
        ++all_->connected;
    }

    std::size_t number_;
    ise::endpoint server_;
    std::shared_ptr<progress_made> all_;
    ise::remote peer_;
};

class accountant final : public ise::component {
public:
    accountant(const options& asked, ise::endpoint server, std::shared_ptr<progress_made> all, collector& into)
        : asked_(asked), server_(std::move(server)), all_(std::move(all)), into_(into) {}

private:
    ise::task<> run() override {
        try {
            auto peer = at(server_);
            auto before = co_await peer.call(memory, ask_memory(), generous);
            before = co_await peer.call(memory, ask_memory(), generous); // what the first one introduced does not count
            all_->begun = true;
            while (all_->connected < asked_.outstanding) co_await sleep(std::chrono::milliseconds(5));
            co_await sleep(std::chrono::milliseconds(500)); // the first heartbeats are over
            auto after = co_await peer.call(memory, ask_memory(), generous);
            outcome out;
            out.count = after.sessions - before.sessions;
            const auto each = [&](std::uint64_t then, std::uint64_t now) {
                return (static_cast<double>(now) - static_cast<double>(then)) / static_cast<double>(out.count);
            };
            out.bytes_each = each(before.heap_bytes, after.heap_bytes);
            out.resident_bytes_each = each(before.resident_bytes, after.resident_bytes);
            // One that is active among all that are idle.
            const auto times = span::after_warm_up(asked_);
            telemetry packet;
            for (auto at_ns = now_ns(); at_ns < times.end_ns;) {
                packet = co_await peer.call(echo<telemetry>, packet, generous);
                const auto answered = now_ns();
                if (at_ns >= times.begin_ns) out.latency.add(answered - at_ns);
                at_ns = answered;
            }
            into_.take(std::move(out));
        } catch (...) {
            into_.fail(std::current_exception());
        }
    }

    options asked_;
    ise::endpoint server_;
    std::shared_ptr<progress_made> all_;
    collector& into_;
};

} // namespace

std::unique_ptr<ise::component> make_memory_teller() { return std::make_unique<memory_teller>(); }

void start_idlers(ise::node& node, const options& asked, const ise::endpoint& server, collector& into) {
    auto all = std::make_shared<progress_made>();
    node.start<accountant>("bench/accountant", asking(), asked, server, all, into);
    for (std::size_t i = 0; i != asked.outstanding; ++i)
        node.start<idler>("bench/idler-" + std::to_string(i), asking("bench/accountant"), i, server, all);
}

} // namespace bench
