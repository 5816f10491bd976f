#include "collector.hpp"
#include "programs.hpp"

#include <algorithm>

namespace bench {
namespace {

// Packets on their way to one subscriber, at most.
std::uint32_t depth_for(std::size_t size_bytes) {
    // What a provider holds for one session is bounded: of the biggest packets few wait.
    const auto fitting = std::max<std::size_t>(1, (std::size_t{128} << 20) / size_bytes);
    return static_cast<std::uint32_t>(std::min(fitting, std::clamp<std::size_t>(1024 * 1024 / size_bytes, 32, 4096)));
}

template <class Packet>
class publisher final : public ise::component {
public:
    explicit publisher(const options& asked) : asked_(asked) {}

private:
    ise::task<> run() override {
        auto out = publish(feed<Packet>);
        auto packet = make_packet<Packet>(asked_.size_bytes);
        const bool hurry = in_a_hurry(asked_);
        for (;;) {
            if (out.subscribers() < asked_.subscribers) {
                co_await sleep(std::chrono::milliseconds(1));
            } else if (!hurry || !out.try_send(packet)) {
                co_await out.send(packet);
            }
        }
    }

    options asked_;
};

// What the subscribers of one measurement share; they run on one loop.
struct tally {
    std::uint64_t received = 0;
    std::size_t subscribed = 0;
};

template <class Packet>
class subscriber final : public ise::component {
public:
    subscriber(const options& asked, ise::endpoint server, std::shared_ptr<tally> all, collector& into)
        : asked_(asked), server_(std::move(server)), all_(std::move(all)), into_(into) {}

private:
    ise::task<> run() override {
        try {
            auto peer = at(server_);
            auto packets =
                co_await peer.subscribe(feed<Packet>, ise::subscribe_options::lossless(depth_for(asked_.size_bytes)));
            ++all_->subscribed;
            const bool hurry = in_a_hurry(asked_);
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) throw ise::error(packets.cause());
                ++all_->received;
                if (!hurry) continue;
                while (packets.try_next()) ++all_->received;
            }
        } catch (...) {
            into_.fail(std::current_exception()); // after the measurement it counts no more
        }
    }

    options asked_;
    ise::endpoint server_;
    std::shared_ptr<tally> all_;
    collector& into_;
};

class stopwatch final : public ise::component {
public:
    stopwatch(const options& asked, std::shared_ptr<tally> all, collector& into)
        : asked_(asked), all_(std::move(all)), into_(into) {}

private:
    ise::task<> run() override {
        while (all_->subscribed < asked_.subscribers) co_await sleep(std::chrono::milliseconds(1));
        const auto times = span::after_warm_up(asked_);
        while (now_ns() < times.begin_ns) co_await sleep(std::chrono::milliseconds(1));
        const auto began = now_ns();
        const auto before = all_->received;
        co_await sleep(std::chrono::nanoseconds(times.end_ns - times.begin_ns));
        outcome out;
        out.seconds = static_cast<double>(now_ns() - began) * 1e-9;
        out.count = all_->received - before;
        into_.take(std::move(out));
    }

    options asked_;
    std::shared_ptr<tally> all_;
    collector& into_;
};

template <class Packet>
class pacer final : public ise::component {
public:
    explicit pacer(const options& asked) : asked_(asked) {}

private:
    ise::task<> run() override {
        auto out = publish(feed<Packet>);
        auto packet = make_packet<Packet>(asked_.size_bytes);
        for (auto next = now();; next += std::chrono::milliseconds(1)) {
            co_await sleep_till(next);
            packet.stamp_ns = now_ns();
            out(packet);
        }
    }

    options asked_;
};

template <class Packet>
class pace_listener final : public ise::component {
public:
    pace_listener(const options& asked, ise::endpoint server, collector& into)
        : asked_(asked), server_(std::move(server)), into_(into) {}

private:
    ise::task<> run() override {
        try {
            auto peer = at(server_);
            auto packets = co_await peer.subscribe(feed<Packet>);
            outcome out;
            const auto times = span::after_warm_up(asked_);
            for (auto at_ns = now_ns(); at_ns < times.end_ns;) {
                auto packet = co_await packets.next();
                if (!packet) throw ise::error(packets.cause());
                at_ns = now_ns();
                if (at_ns >= times.begin_ns) out.latency.add(at_ns - packet->stamp_ns);
            }
            out.count = out.latency.samples();
            out.seconds = static_cast<double>(times.end_ns - times.begin_ns) * 1e-9;
            into_.take(std::move(out));
        } catch (...) {
            into_.fail(std::current_exception());
        }
    }

    options asked_;
    ise::endpoint server_;
    collector& into_;
};

template <class Packet>
void start_typed_subscribers(ise::node& node, const options& asked, const ise::endpoint& server, collector& into) {
    // One thread, as the floor has one; a connection each, as if they were of different components.
    auto all = std::make_shared<tally>();
    node.start<stopwatch>("bench/stopwatch", beside_server(asked), asked, all, into);
    for (std::size_t i = 0; i != asked.subscribers; ++i)
        node.start<subscriber<Packet>>("bench/subscriber-" + std::to_string(i), asking("bench/stopwatch"), asked,
                                       server, all, into);
}

} // namespace

std::unique_ptr<ise::component> make_publisher(const options& asked) {
    if (asked.size_bytes == telemetry_bytes) return std::make_unique<publisher<telemetry>>(asked);
    return std::make_unique<publisher<block>>(asked);
}

std::unique_ptr<ise::component> make_pacer(const options& asked) {
    if (asked.size_bytes == telemetry_bytes) return std::make_unique<pacer<telemetry>>(asked);
    return std::make_unique<pacer<block>>(asked);
}

void start_subscribers(ise::node& node, const options& asked, const ise::endpoint& server, collector& into) {
    if (asked.size_bytes == telemetry_bytes) {
        start_typed_subscribers<telemetry>(node, asked, server, into);
    } else {
        start_typed_subscribers<block>(node, asked, server, into);
    }
}

void start_listener_of_pacer(ise::node& node, const options& asked, const ise::endpoint& server, collector& into) {
    if (asked.size_bytes == telemetry_bytes) {
        node.start<pace_listener<telemetry>>("bench/listener", beside_server(asked), asked, server, into);
    } else {
        node.start<pace_listener<block>>("bench/listener", beside_server(asked), asked, server, into);
    }
}

} // namespace bench
