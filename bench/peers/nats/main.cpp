// NATS: a nats-server of its own beside the serving side, and the C client. Calls with many outstanding go through one
// inbox. The publisher stays at most a window ahead of its subscribers, since the server drops those that are slow.
#include "peers/peer.hpp"

#include <nats/nats.h>

#include <arpa/inet.h>
#include <signal.h>
#include <sys/prctl.h>
#include <sys/socket.h>
#include <unistd.h>

#include <atomic>
#include <condition_variable>
#include <cstring>
#include <mutex>
#include <stdexcept>
#include <vector>

namespace {

using namespace bench;

void check(natsStatus outcome, const char* what) {
    if (outcome != NATS_OK) throw std::runtime_error(std::string(what) + ": " + natsStatus_GetText(outcome));
}

// A port that was free a moment ago: nats-server can choose one, but tells it in its log only.
int free_port() {
    const int made = ::socket(AF_INET, SOCK_STREAM, 0);
    sockaddr_in at{};
    at.sin_family = AF_INET;
    at.sin_addr.s_addr = htonl(INADDR_LOOPBACK);
    socklen_t length = sizeof at;
    if (::bind(made, reinterpret_cast<sockaddr*>(&at), sizeof at) != 0 ||
        ::getsockname(made, reinterpret_cast<sockaddr*>(&at), &length) != 0)
        throw std::runtime_error("no free port");
    ::close(made);
    return ntohs(at.sin_port);
}

natsConnection* connect(const std::string& url, const options& asked) {
    const bool one_by_one = asked.work == "paced" || (asked.work == "call" && asked.outstanding == 1);
    int tries = 250; // the server starts
    natsOptions* how = nullptr;
    check(natsOptions_Create(&how), "natsOptions_Create");
    natsOptions_SetURL(how, url.c_str());
    natsOptions_SetSendAsap(how, one_by_one); // else its buffer gathers
    natsOptions_SetMaxPendingMsgs(how, 1'000'000);
    natsConnection* made = nullptr;
    natsStatus outcome = NATS_OK;
    while ((outcome = natsConnection_Connect(&made, how)) != NATS_OK && --tries > 0)
        std::this_thread::sleep_for(std::chrono::milliseconds(20));
    check(outcome, ("no nats-server at " + url).c_str());
    return made;
}

std::string start_server() {
    const int port = free_port();
    const auto text = std::to_string(port);
    const auto parent = ::getpid();
    const pid_t child = ::fork();
    if (child == 0) {
        ::prctl(PR_SET_PDEATHSIG, SIGKILL); // it ends with the serving side
        if (::getppid() != parent) ::_exit(1);
        ::execlp("nats-server", "nats-server", "-a", "127.0.0.1", "-p", text.c_str(), "-l", "/dev/null", nullptr);
        ::execl("/usr/sbin/nats-server", "nats-server", "-a", "127.0.0.1", "-p", text.c_str(), "-l", "/dev/null",
                nullptr);
        ::_exit(127);
    }
    if (child < 0) throw std::runtime_error("nats-server cannot be started");
    return "nats://127.0.0.1:" + text;
}

constexpr const char* calls = "bench.call";
constexpr const char* feed = "bench.feed";
constexpr const char* taken = "bench.taken"; // a subscriber's number, and how many it has taken
constexpr const char* here = "bench.here";   // a subscriber has come

std::size_t window_of(const options& asked) { return std::max<std::size_t>(8, (4u << 20) / asked.size_bytes); }

struct progress_made {
    std::mutex mutex;
    std::condition_variable moved;
    std::vector<std::uint64_t> taken;
    std::uint64_t generation = 0; // of measuring sides
};

void echo(natsConnection* over, natsSubscription*, natsMsg* got, void*) {
    natsConnection_Publish(over, natsMsg_GetReply(got), natsMsg_GetData(got), natsMsg_GetDataLength(got));
    natsMsg_Destroy(got);
}

void on_taken(natsConnection*, natsSubscription*, natsMsg* got, void* closure) {
    auto& all = *static_cast<progress_made*>(closure);
    unsigned long number = 0, count = 0;
    if (std::sscanf(std::string(natsMsg_GetData(got), static_cast<std::size_t>(natsMsg_GetDataLength(got))).c_str(),
                    "%lu %lu", &number, &count) == 2) {
        std::lock_guard guard(all.mutex);
        if (number < all.taken.size()) all.taken[number] = count;
        all.moved.notify_one();
    }
    natsMsg_Destroy(got);
}

void on_here(natsConnection*, natsSubscription*, natsMsg* got, void* closure) {
    auto& all = *static_cast<progress_made*>(closure);
    {
        std::lock_guard guard(all.mutex);
        ++all.generation;
        std::fill(all.taken.begin(), all.taken.end(), 0);
        all.moved.notify_one();
    }
    natsMsg_Destroy(got);
}

void publish(natsConnection* over, const options& asked, progress_made& all) {
    std::string packet(asked.size_bytes, 'x');
    const auto window = window_of(asked);
    for (std::uint64_t seen = 0;;) {
        {
            std::unique_lock guard(all.mutex);
            all.moved.wait(guard, [&] { return all.generation != seen; });
            seen = all.generation;
        }
        if (asked.work == "paced") {
            once_a_millisecond(packet, [&](const std::string& stamped) {
                check(natsConnection_Publish(over, feed, stamped.data(), static_cast<int>(stamped.size())), "publish");
                return true;
            });
        }
        for (std::uint64_t sent = 0;;) {
            std::uint64_t until = 0;
            {
                std::unique_lock guard(all.mutex);
                const auto least = [&] { return *std::min_element(all.taken.begin(), all.taken.end()); };
                all.moved.wait(guard, [&] { return all.generation != seen || least() + window > sent; });
                if (all.generation != seen) break;
                until = least() + window;
            }
            for (; sent < until; ++sent)
                check(natsConnection_Publish(over, feed, packet.data(), static_cast<int>(packet.size())), "publish");
        }
    }
}

void serve(const options& asked) {
    expect(asked, "nats", {"tcp"});
    if (asked.size_bytes > (1u << 20)) throw std::invalid_argument("nats takes payloads up to 1 MiB");
    const auto url = start_server();
    auto* over = connect(url, asked);
    progress_made all;
    all.taken.resize(asked.subscribers);
    natsSubscription* listening = nullptr;
    if (asked.work == "call") {
        check(natsConnection_Subscribe(&listening, over, calls, echo, nullptr), "subscribe");
    } else {
        check(natsConnection_Subscribe(&listening, over, taken, on_taken, &all), "subscribe");
        check(natsConnection_Subscribe(&listening, over, here, on_here, &all), "subscribe");
    }
    check(natsConnection_Flush(over), "flush");
    announce(url);
    if (asked.work == "call") ::pause();
    publish(over, asked, all);
}

struct taker {
    std::size_t number = 0, window = 0;
    std::atomic<std::uint64_t> count{0};
    pace* times = nullptr;
};

void on_packet(natsConnection* over, natsSubscription*, natsMsg* got, void* closure) {
    auto& self = *static_cast<taker*>(closure);
    const auto count = self.count.fetch_add(1, std::memory_order_relaxed) + 1;
    if (self.times) self.times->take(natsMsg_GetData(got));
    if (!self.times && count % (self.window / 4) == 0)
        natsConnection_PublishString(over, taken, (std::to_string(self.number) + " " + std::to_string(count)).c_str());
    natsMsg_Destroy(got);
}

struct caller {
    std::string packet, inbox;
    std::atomic<std::uint64_t> answered{0};
};

void on_reply(natsConnection* over, natsSubscription*, natsMsg* got, void* closure) {
    auto& self = *static_cast<caller*>(closure);
    self.answered.fetch_add(1, std::memory_order_relaxed);
    natsMsg_Destroy(got);
    natsConnection_PublishRequest(over, calls, self.inbox.c_str(), self.packet.data(),
                                  static_cast<int>(self.packet.size()));
}

outcome measure_calls(const options& asked) {
    auto* over = connect(asked.connect, asked);
    static caller self; // its callbacks outlive this
    self.packet.assign(asked.size_bytes, 'x');
    if (asked.outstanding == 1) {
        return one_by_one(asked, [&] {
            natsMsg* reply = nullptr;
            check(natsConnection_Request(&reply, over, calls, self.packet.data(), static_cast<int>(self.packet.size()),
                                         10'000),
                  "request");
            natsMsg_Destroy(reply);
        });
    }
    natsInbox* inbox = nullptr;
    check(natsInbox_Create(&inbox), "inbox");
    self.inbox = inbox;
    natsSubscription* listening = nullptr;
    check(natsConnection_Subscribe(&listening, over, inbox, on_reply, &self), "subscribe");
    for (std::size_t i = 0; i != asked.outstanding; ++i)
        check(
            natsConnection_PublishRequest(over, calls, inbox, self.packet.data(), static_cast<int>(self.packet.size())),
            "request");
    return rate_of(asked, [] { return self.answered.load(); });
}

outcome measure(const options& asked) {
    expect(asked, "nats", {"tcp"});
    if (asked.work == "call") return measure_calls(asked);
    pace times(asked);
    std::vector<taker*> all;
    for (std::size_t i = 0; i != asked.subscribers; ++i) {
        auto* one = new taker; // as long as the process
        one->number = i;
        one->window = window_of(asked);
        if (asked.work == "paced") one->times = &times;
        auto* over = connect(asked.connect, asked); // a connection each
        natsSubscription* listening = nullptr;
        check(natsConnection_Subscribe(&listening, over, feed, on_packet, one), "subscribe");
        check(natsSubscription_SetPendingLimits(listening, -1, -1), "limits");
        check(natsConnection_Flush(over), "flush");
        all.push_back(one);
        if (i + 1 == asked.subscribers) check(natsConnection_PublishString(over, here, ""), "publish");
    }
    auto out = rate_of(asked, [&] {
        std::uint64_t sum = 0;
        for (const auto* one : all) sum += one->count.load();
        return sum;
    });
    return asked.work == "paced" ? times.result() : out;
}

} // namespace

int main(int argc, char** argv) { return peer_main(argc, argv, "nats", serve, measure); }
