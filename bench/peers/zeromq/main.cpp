// ZeroMQ: DEALER and ROUTER for calls, PUB that drops nothing (ZMQ_XPUB_NODROP) and SUB for publications.
#include "peers/peer.hpp"

#include <zmq.h>

#include <cstring>
#include <memory>
#include <stdexcept>
#include <unistd.h>
#include <vector>

namespace {

using namespace bench;

[[noreturn]] void fail(const char* what) {
    throw std::runtime_error(std::string(what) + ": " + zmq_strerror(zmq_errno()));
}
void check(int outcome, const char* what) {
    if (outcome < 0) fail(what);
}

void* context() {
    static void* one = zmq_ctx_new();
    return one;
}

void* make(int kind) {
    void* made = zmq_socket(context(), kind);
    if (!made) fail("zmq_socket");
    const int many = 100'000; // messages; the default of 1000 makes its threads wait for each other
    check(zmq_setsockopt(made, ZMQ_SNDHWM, &many, sizeof many), "ZMQ_SNDHWM");
    check(zmq_setsockopt(made, ZMQ_RCVHWM, &many, sizeof many), "ZMQ_RCVHWM");
    return made;
}

void bind_and_tell(void* socket, const options& asked) {
    const auto local = "ipc://@ise-bench-zeromq-" + std::to_string(::getpid());
    check(zmq_bind(socket, asked.transport == "local" ? local.c_str() : "tcp://127.0.0.1:*"), "zmq_bind");
    char where[256];
    std::size_t length = sizeof where;
    check(zmq_getsockopt(socket, ZMQ_LAST_ENDPOINT, where, &length), "ZMQ_LAST_ENDPOINT");
    announce(where);
}

void send(void* socket, const std::string& packet) {
    check(zmq_send(socket, packet.data(), packet.size(), 0), "zmq_send");
}

void serve_calls(const options& asked) {
    void* socket = make(ZMQ_ROUTER);
    bind_and_tell(socket, asked);
    for (;;) {
        zmq_msg_t part;
        zmq_msg_init(&part);
        check(zmq_msg_recv(&part, socket, 0), "zmq_msg_recv");
        check(zmq_msg_send(&part, socket, zmq_msg_more(&part) ? ZMQ_SNDMORE : 0), "zmq_msg_send"); // who, then what
    }
}

void serve_publication(const options& asked) {
    void* socket = make(ZMQ_XPUB);
    const int yes = 1;
    check(zmq_setsockopt(socket, ZMQ_XPUB_NODROP, &yes, sizeof yes), "ZMQ_XPUB_NODROP");
    check(zmq_setsockopt(socket, ZMQ_XPUB_VERBOSER, &yes, sizeof yes), "ZMQ_XPUB_VERBOSER");
    bind_and_tell(socket, asked);
    std::string packet(asked.size_bytes, 'x');
    std::size_t subscribers = 0;
    const auto hear = [&](int flags) {
        char change[8] = {};
        if (zmq_recv(socket, change, sizeof change, flags) < 0) return false;
        subscribers = change[0] == 1 ? subscribers + 1 : subscribers - 1;
        return true;
    };
    for (;;) {
        while (subscribers < asked.subscribers) hear(0);
        if (asked.work == "paced") {
            once_a_millisecond(packet, [&](const std::string& stamped) {
                while (hear(ZMQ_DONTWAIT)) continue;
                if (subscribers != 0) send(socket, stamped);
                return subscribers != 0;
            });
            continue;
        }
        while (subscribers == asked.subscribers) {
            for (int i = 0; i != 64; ++i) {
                // A publisher that waits for a subscriber must hear when that one leaves.
                while (zmq_send(socket, packet.data(), packet.size(), ZMQ_DONTWAIT) < 0) {
                    if (zmq_errno() != EAGAIN) fail("zmq_send");
                    zmq_pollitem_t wait{socket, 0, ZMQ_POLLIN | ZMQ_POLLOUT, 0};
                    zmq_poll(&wait, 1, 1);
                    if (wait.revents & ZMQ_POLLIN) break;
                }
            }
            while (hear(ZMQ_DONTWAIT)) continue;
        }
    }
}

outcome measure_calls(const options& asked) {
    void* socket = make(ZMQ_DEALER);
    check(zmq_connect(socket, asked.connect.c_str()), "zmq_connect");
    std::string packet(asked.size_bytes, 'x');
    const auto receive = [&](int flags) { return zmq_recv(socket, packet.data(), packet.size(), flags) >= 0; };
    if (asked.outstanding == 1) {
        return one_by_one(asked, [&] {
            send(socket, packet);
            receive(0);
        });
    }
    for (std::size_t i = 0; i != asked.outstanding; ++i) send(socket, packet);
    return rate_by(asked, [&] {
        std::uint64_t got = 0;
        for (receive(0), ++got; got != 256 && receive(ZMQ_DONTWAIT);) ++got;
        for (std::uint64_t i = 0; i != got; ++i) send(socket, packet);
        return got;
    });
}

outcome measure_publication(const options& asked) {
    std::vector<zmq_pollitem_t> all;
    for (std::size_t i = 0; i != asked.subscribers; ++i) {
        void* socket = make(ZMQ_SUB);
        check(zmq_setsockopt(socket, ZMQ_SUBSCRIBE, "", 0), "ZMQ_SUBSCRIBE");
        check(zmq_connect(socket, asked.connect.c_str()), "zmq_connect");
        all.push_back({socket, 0, ZMQ_POLLIN, 0});
    }
    std::string packet(asked.size_bytes, 'x');
    const auto receive = [&](void* from, int flags) {
        return zmq_recv(from, packet.data(), packet.size(), flags) >= 0;
    };
    if (asked.work == "paced") {
        pace times(asked);
        while (!times.over()) {
            receive(all.front().socket, 0);
            times.take(packet.data());
        }
        return times.result();
    }
    return rate_by(asked, [&] {
        std::uint64_t got = 0;
        check(zmq_poll(all.data(), static_cast<int>(all.size()), -1), "zmq_poll");
        for (auto& one : all) {
            for (int i = 0; i != 1000 && receive(one.socket, ZMQ_DONTWAIT); ++i) ++got;
        }
        return got;
    });
}

} // namespace

int main(int argc, char** argv) {
    return peer_main(
        argc, argv, "zeromq",
        [](const options& asked) {
            expect(asked, "zeromq", {"tcp", "local"});
            if (asked.work == "call") serve_calls(asked);
            else serve_publication(asked);
        },
        [](const options& asked) {
            expect(asked, "zeromq", {"tcp", "local"});
            return asked.work == "call" ? measure_calls(asked) : measure_publication(asked);
        });
}
