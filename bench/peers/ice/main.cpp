// Ice: two-way calls, asynchronous with many outstanding; publications by batched oneways to the subscribers' objects
// (`paced`: one by one), flushed at 64 KiB.
#include "peers/peer.hpp"

#include <Ice/Ice.h>

#include "Work.h"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <vector>

namespace {

using namespace bench;

class server final : public Work::Server {
public:
    explicit server(std::size_t wanted) : wanted_(wanted) {}

    Work::Packet echo(Work::Packet one, const Ice::Current&) override { return one; }
    void subscribe(std::shared_ptr<Work::SinkPrx> whom, const Ice::Current&) override {
        std::lock_guard guard(mutex_);
        sinks_.push_back(std::move(whom));
        if (sinks_.size() == wanted_) complete_.notify_one();
    }
    std::vector<std::shared_ptr<Work::SinkPrx>> subscribers() {
        std::unique_lock guard(mutex_);
        complete_.wait(guard, [this] { return sinks_.size() >= wanted_; });
        return std::exchange(sinks_, {});
    }

private:
    std::size_t wanted_;
    std::mutex mutex_;
    std::condition_variable complete_;
    std::vector<std::shared_ptr<Work::SinkPrx>> sinks_;
};

class sink final : public Work::Sink {
public:
    explicit sink(pace* times) : times_(times) {}
    void take(Work::Packet one, const Ice::Current&) override {
        taken.fetch_add(1, std::memory_order_relaxed);
        if (times_) times_->take(one.data());
    }
    std::atomic<std::uint64_t> taken{0};

private:
    pace* times_;
};

std::shared_ptr<Ice::Communicator> communicator() {
    Ice::InitializationData how;
    how.properties = Ice::createProperties();
    how.properties->setProperty("Ice.MessageSizeMax", "131072"); // KiB
    how.properties->setProperty("Ice.Warn.Connections", "0");
    return Ice::initialize(how);
}

void publish(const options& asked, const std::vector<std::shared_ptr<Work::SinkPrx>>& sinks) {
    Work::Packet packet(asked.size_bytes);
    if (asked.work == "paced") {
        auto oneway = sinks.front()->ice_oneway();
        once_a_millisecond(std::string(asked.size_bytes, 'x'), [&](const std::string& stamped) {
            __builtin_memcpy(packet.data(), stamped.data(), stamped.size());
            oneway->take(packet);
            return true;
        });
        return;
    }
    std::vector<std::shared_ptr<Work::SinkPrx>> batched;
    for (const auto& one : sinks) batched.push_back(one->ice_batchOneway());
    const auto in_a_batch = std::max<std::size_t>(1, 65536 / asked.size_bytes);
    for (std::uint64_t sent = 1;; ++sent) {
        for (auto& one : batched) one->take(packet);
        if (sent % in_a_batch == 0) {
            for (auto& one : batched) one->ice_flushBatchRequests();
        }
        if (sent % 65536 == 0) sinks.front()->ice_ping();
    }
}

void serve(const options& asked) {
    expect(asked, "ice", {"tcp"});
    auto ice = communicator();
    auto adapter = ice->createObjectAdapterWithEndpoints("work", "tcp -h 127.0.0.1");
    auto made = std::make_shared<server>(asked.subscribers);
    auto proxy = adapter->add(made, Ice::stringToIdentity("server"));
    adapter->activate();
    auto where = proxy->ice_toString();
    for (auto& one : where) {
        if (one == ' ') one = '%'; // an address has no blank
    }
    announce(where);
    for (;;) {
        auto sinks = made->subscribers();
        try {
            publish(asked, sinks);
        } catch (const Ice::Exception&) { // they left
        }
    }
}

outcome measure(const options& asked) {
    expect(asked, "ice", {"tcp"});
    auto ice = communicator();
    auto where = asked.connect;
    for (auto& one : where) {
        if (one == '%') one = ' ';
    }
    auto peer = Ice::uncheckedCast<Work::ServerPrx>(ice->stringToProxy(where));
    Work::Packet packet(asked.size_bytes);
    if (asked.work == "call" && asked.outstanding == 1) {
        return one_by_one(asked, [&] { peer->echo(packet); });
    }
    std::atomic<std::uint64_t> answered{0};
    if (asked.work == "call") {
        std::function<void(Work::Packet)> again = [&](Work::Packet) {
            answered.fetch_add(1, std::memory_order_relaxed);
            peer->echoAsync(packet, again);
        };
        for (std::size_t i = 0; i != asked.outstanding; ++i) peer->echoAsync(packet, again);
        auto out = rate_of(asked, [&] { return answered.load(); });
        print(asked, out);
        std::fflush(stdout);
        std::_Exit(0); // the calls go on
    }
    pace times(asked);
    auto adapter = ice->createObjectAdapterWithEndpoints("sinks", "tcp -h 127.0.0.1");
    adapter->activate();
    std::vector<std::shared_ptr<sink>> sinks;
    for (std::size_t i = 0; i != asked.subscribers; ++i) {
        sinks.push_back(std::make_shared<sink>(asked.work == "paced" ? &times : nullptr));
        auto proxy = adapter->add(sinks.back(), Ice::stringToIdentity("sink" + std::to_string(i)));
        // A connection each, as if they were of different programs.
        peer->subscribe(Ice::uncheckedCast<Work::SinkPrx>(proxy->ice_connectionId(std::to_string(i))));
    }
    if (asked.work == "paced") {
        std::this_thread::sleep_for(std::chrono::duration<double>(asked.warmup_seconds + asked.seconds + 0.05));
        return times.result();
    }
    return rate_of(asked, [&] {
        std::uint64_t sum = 0;
        for (const auto& one : sinks) sum += one->taken.load();
        return sum;
    });
}

} // namespace

int main(int argc, char** argv) { return peer_main(argc, argv, "ice", serve, measure); }
