// omniORB: two-way calls; `oneway` to the subscribers' own objects for publications. With many calls outstanding there
// is a thread for each, since it has no asynchronous calls.
#include "peers/peer.hpp"

#include "work.hh"

#include <atomic>
#include <condition_variable>
#include <mutex>
#include <stdexcept>
#include <utility>
#include <vector>

namespace {

using namespace bench;

class server final : public POA_Work::Server, public PortableServer::RefCountServantBase {
public:
    explicit server(std::size_t wanted) : wanted_(wanted) {}

    Work::Packet* echo(const Work::Packet& one) override { return new Work::Packet(one); }
    void subscribe(Work::Sink_ptr whom) override {
        std::lock_guard guard(mutex_);
        sinks_.push_back(Work::Sink::_duplicate(whom));
        if (sinks_.size() == wanted_) complete_.notify_one();
    }

    /// Waits for all subscribers, and gives them away.
    std::vector<Work::Sink_var> subscribers() {
        std::unique_lock guard(mutex_);
        complete_.wait(guard, [this] { return sinks_.size() >= wanted_; });
        return std::exchange(sinks_, {});
    }

private:
    std::size_t wanted_;
    std::mutex mutex_;
    std::condition_variable complete_;
    std::vector<Work::Sink_var> sinks_;
};

class sink final : public POA_Work::Sink, public PortableServer::RefCountServantBase {
public:
    explicit sink(pace* times) : times_(times) {}
    void take(const Work::Packet& one) override {
        taken.fetch_add(1, std::memory_order_relaxed);
        if (times_) times_->take(one.get_buffer());
    }
    void reached() override {}
    std::atomic<std::uint64_t> taken{0};

private:
    pace* times_;
};

struct orb {
    explicit orb(bool listens) {
        const char* listening[][2] = {{"endPoint", "giop:tcp:127.0.0.1:"},
                                      {"oneCallPerConnection", "0"},
                                      {"maxGIOPConnectionPerServer", "1"},
                                      {"giopMaxMsgSize", "134217728"},
                                      {nullptr, nullptr}};
        const char* asking[][2] = {{"endPoint", "giop:tcp:127.0.0.1:"},
                                   {"maxGIOPConnectionPerServer", "64"},
                                   {"giopMaxMsgSize", "134217728"},
                                   {nullptr, nullptr}};
        int count = 0;
        own = CORBA::ORB_init(count, nullptr, "omniORB4", listens ? listening : asking);
        CORBA::Object_var found = own->resolve_initial_references("RootPOA");
        poa = PortableServer::POA::_narrow(found);
        PortableServer::POAManager_var manager = poa->the_POAManager();
        manager->activate();
    }
    CORBA::ORB_var own;
    PortableServer::POA_var poa;
};

Work::Packet packet_of(const options& asked) {
    Work::Packet made(static_cast<CORBA::ULong>(asked.size_bytes));
    made.length(static_cast<CORBA::ULong>(asked.size_bytes));
    return made;
}

void publish(const options& asked, std::vector<Work::Sink_var> sinks) {
    auto packet = packet_of(asked);
    if (asked.work == "paced") {
        return once_a_millisecond(std::string(asked.size_bytes, 'x'), [&](const std::string& stamped) {
            __builtin_memcpy(packet.get_buffer(), stamped.data(), stamped.size());
            sinks.front()->take(packet);
            return true;
        });
    }
    for (std::uint64_t sent = 1;; ++sent) {
        for (auto& one : sinks) one->take(packet);
        if (sent % 4096 == 0) sinks.front()->reached(); // a subscriber that went is an exception here
    }
}

void serve(const options& asked) {
    expect(asked, "omniorb", {"tcp"});
    orb its(true);
    server made(asked.subscribers);
    PortableServer::ObjectId_var id = its.poa->activate_object(&made);
    Work::Server_var reference = made._this();
    CORBA::String_var where = its.own->object_to_string(reference);
    announce(static_cast<const char*>(where));
    for (;;) {
        auto sinks = made.subscribers();
        try {
            publish(asked, std::move(sinks));
        } catch (const CORBA::Exception&) { // they left
        }
    }
}

outcome measure(const options& asked) {
    expect(asked, "omniorb", {"tcp"});
    orb its(false);
    CORBA::Object_var found = its.own->string_to_object(asked.connect.c_str());
    Work::Server_var peer = Work::Server::_narrow(found);
    const auto packet = packet_of(asked);
    if (asked.work == "call" && asked.outstanding == 1) {
        return one_by_one(asked, [&] { Work::Packet_var reply = peer->echo(packet); });
    }
    std::atomic<std::uint64_t> answered{0};
    if (asked.work == "call") {
        for (std::size_t i = 0; i != asked.outstanding; ++i) {
            std::thread([&answered, &packet, peer = Work::Server::_duplicate(peer)] {
                for (;;) {
                    Work::Packet_var reply = peer->echo(packet);
                    answered.fetch_add(1, std::memory_order_relaxed);
                }
            }).detach();
        }
        auto out = rate_of(asked, [&] { return answered.load(); });
        print(asked, out);
        std::_Exit(0); // the threads go on calling
    }
    pace times(asked);
    std::vector<sink*> sinks;
    for (std::size_t i = 0; i != asked.subscribers; ++i) {
        auto* made = new sink(asked.work == "paced" ? &times : nullptr); // as long as the process
        PortableServer::ObjectId_var id = its.poa->activate_object(made);
        Work::Sink_var reference = made->_this();
        peer->subscribe(reference);
        sinks.push_back(made);
    }
    if (asked.work == "paced") {
        std::this_thread::sleep_for(std::chrono::duration<double>(asked.warmup_seconds + asked.seconds + 0.05));
        return times.result();
    }
    return rate_of(asked, [&] {
        std::uint64_t sum = 0;
        for (const auto* one : sinks) sum += one->taken.load();
        return sum;
    });
}

} // namespace

int main(int argc, char** argv) {
    return peer_main(argc, argv, "omniorb", serve, [](const options& asked) {
        try {
            return measure(asked);
        } catch (const CORBA::Exception& failed) {
            throw std::runtime_error(std::string("CORBA exception ") + failed._name());
        }
    });
}
