#include "collector.hpp"
#include "programs.hpp"

#include <ise/asio.hpp>

#include <stdexcept>

namespace bench {
namespace {

template <class Packet>
class echo_server final : public ise::component {
public:
    echo_server(bool plain, std::size_t services) : plain_(plain), services_(services) {}

private:
    ise::task<> run() override {
        for (std::size_t i = 0; i != services_; ++i) {
            const ise::request_response<Packet, Packet> service(echo_name(i));
            if (plain_) {
                provide(service, [](Packet request) -> Packet { return request; });
            } else {
                provide(service, [](Packet request) -> ise::task<Packet> { co_return request; });
            }
        }
        co_return;
    }

    bool plain_;
    std::size_t services_;
};

template <class Packet>
class caller final : public ise::component {
public:
    caller(const options& asked, ise::endpoint server, collector& into)
        : asked_(asked), server_(std::move(server)), into_(into) {}

private:
    ise::task<> run() override {
        try {
            peer_ = at(server_);
            auto connected = co_await peer_.connect(generous);
            connected.value();
            if (asked_.outstanding == 1) {
                co_await one_by_one();
            } else {
                co_await many();
            }
        } catch (...) {
            into_.fail(std::current_exception());
        }
    }

    ise::task<> one_by_one() {
        outcome out;
        const auto times = span::after_warm_up(asked_);
        auto packet = make_packet<Packet>(asked_.size_bytes);
        std::size_t next = 0;
        for (auto before = now_ns(); before < times.end_ns;) {
            const ise::request_response<Packet, Packet> service(echo_name(next));
            if (++next == asked_.services) next = 0;
            packet = co_await peer_.call(service, std::move(packet), generous);
            const auto after = now_ns();
            if (before >= times.begin_ns) {
                out.latency.add(after - before);
                out.seconds += static_cast<double>(after - before) * 1e-9;
            }
            before = after;
        }
        out.count = out.latency.samples();
        into_.take(std::move(out));
    }

    ise::task<> many() {
        for (std::size_t i = 0; i != asked_.outstanding; ++i) {
            ++running_;
            if (in_a_hurry(asked_)) {
                call_again(make_packet<Packet>(asked_.size_bytes));
            } else {
                spawn("caller", call_repeatedly());
            }
        }
        co_await sleep(to_duration(asked_.warmup_seconds));
        const auto began = now_ns();
        const auto before = answered_;
        co_await sleep(to_duration(asked_.seconds));
        outcome out;
        out.seconds = static_cast<double>(now_ns() - began) * 1e-9;
        out.count = answered_ - before;
        done_ = true;
        while (running_ != 0) co_await sleep(std::chrono::milliseconds(1));
        if (failed_) throw ise::error(*failed_);
        into_.take(std::move(out));
    }

    ise::task<> call_repeatedly() {
        auto packet = make_packet<Packet>(asked_.size_bytes);
        while (!done_) {
            auto reply = co_await peer_.try_call(echo<Packet>, std::move(packet), generous);
            took(reply);
            if (!reply) break;
            packet = std::move(*reply);
        }
        --running_;
    }

    void call_again(Packet packet) {
        peer_.try_call(echo<Packet>, std::move(packet), generous, [this](ise::result<Packet> reply) {
            took(reply);
            if (reply && !done_) {
                call_again(std::move(*reply));
            } else {
                --running_;
            }
        });
    }

    void took(const ise::result<Packet>& reply) {
        if (reply) {
            ++answered_;
        } else {
            failed_ = reply.error();
        }
    }

    static ise::duration to_duration(double seconds) {
        return std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(seconds));
    }

    options asked_;
    ise::endpoint server_;
    ise::remote peer_;
    collector& into_;
    std::uint64_t answered_ = 0;
    std::size_t running_ = 0;
    bool done_ = false;
    std::optional<ise::failure> failed_;
};

} // namespace

std::unique_ptr<ise::component> make_call_server(const options& asked) {
    if (asked.size_bytes == telemetry_bytes)
        return std::make_unique<echo_server<telemetry>>(in_a_hurry(asked), asked.services);
    return std::make_unique<echo_server<block>>(in_a_hurry(asked), asked.services);
}

void start_callers(ise::node& node, const options& asked, const ise::endpoint& server, collector& into) {
    if (asked.size_bytes == telemetry_bytes) {
        node.start<caller<telemetry>>("bench/caller", beside_server(asked), asked, server, into);
    } else {
        node.start<caller<block>>("bench/caller", beside_server(asked), asked, server, into);
    }
}

} // namespace bench
