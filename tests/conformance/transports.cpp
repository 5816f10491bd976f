#include "transports.hpp"

#include <support/authority.hpp>

#include <fmt/format.h>

#include <filesystem>
#include <fstream>
#include <string>

#include <unistd.h>

namespace conformance {
namespace {

using namespace std::chrono_literals;

// Credentials that are good for all of them, made once.
const std::filesystem::path& certificates() {
    static ise_test::authority trusted;
    static auto folder = trusted.issue("host");
    return folder;
}

// A shared key beside them.
const std::string& key_file() {
    static const auto file = [] {
        auto made = certificates().parent_path() / "shared.key";
        std::ofstream(made) << std::string(64, 'k');
        std::filesystem::permissions(made, std::filesystem::perms::owner_read | std::filesystem::perms::owner_write);
        return made.string();
    }();
    return file;
}

// By a file, which is that of the local socket, too: the relay passes on what goes over that.
std::string file_name(const char* scheme, const char* who) {
    return fmt::format("{}://{}/ise-conformance-{}-{}.sock", scheme, std::filesystem::temp_directory_path().string(),
                       ::getpid(), who);
}

std::string local_name(const char* who) { return fmt::format("local://@ise-conformance-{}-{}", ::getpid(), who); }

} // namespace

column of_streams(std::string at, std::string relay_at) {
    column made;
    made.at = std::move(at);
    made.relay_at = std::move(relay_at);
    return made;
}

column of_datagrams(std::string at, std::string relay_at) {
    column made = of_streams(std::move(at), std::move(relay_at));
    made.datagrams = true;
    made.lossless = false;
    made.calls_are_repeated = true;
    made.big_message = (1 << 20) - 1024;
    made.message_limit = 1 << 20; // of the transport
    return made;
}

bool real_world::run_until(const std::function<bool()>& done) {
    const auto end = env_.now() + 2min;
    while (!done()) {
        if (env_.now() >= end) return false;
        context_.run_one_for(1s);
    }
    return true;
}

tcp::tcp() : real_world(of_streams("tcp://127.0.0.1:0", "tcp://127.0.0.1:0")) {}
tcp6::tcp6() : real_world(of_streams("tcp://[::1]:0", "tcp://[::1]:0")) {}
tls::tls() : real_world(of_streams("tls://127.0.0.1:0", "tcp://127.0.0.1:0")) {
    credentials.tls_folder = certificates().string();
}
local::local() : real_world(of_streams(local_name("boat"), local_name("relay"))) {}
sealed_tcp::sealed_tcp() : real_world(of_streams("tcp://127.0.0.1:0", "tcp://127.0.0.1:0")) {
    credentials.key_file = key_file();
}
sealed_local::sealed_local() : real_world(of_streams(local_name("sealed-boat"), local_name("sealed-relay"))) {
    credentials.key_file = key_file();
}
shm::shm() : real_world(of_streams(file_name("shm", "boat"), file_name("local", "relay"))) {}
sealed_shm::sealed_shm() : real_world(of_streams(file_name("shm", "sealed-boat"), file_name("local", "sealed-relay"))) {
    credentials.key_file = key_file();
}
in_process::in_process() : real_world(of_streams("inproc://conformance", "")) {
    has.calls_beside_big = 1;
} // it is handed over at once, as it is
udp::udp() : real_world(of_datagrams("udp://127.0.0.1:0", "udp://127.0.0.1:0")) {}
udp6::udp6() : real_world(of_datagrams("udp://[::1]:0", "udp://[::1]:0")) {}

sealed_udp::sealed_udp() : real_world(of_datagrams("udp://127.0.0.1:0", "udp://127.0.0.1:0")) {
    credentials.key_file = key_file();
}

certified_udp::certified_udp() : real_world(of_datagrams("udp+tls://127.0.0.1:0", "udp://127.0.0.1:0")) {
    credentials.tls_folder = certificates().string();
}

virtual_world::virtual_world(column what, const weather& now) : world(std::move(what)), sea_(now.seed) {
    has.heartbeat_ns = 5'000'000'000; // lost packets are late ones there
    auto& between = sea_.net().between("boat", "shore");
    between.latency = 30ms;
    between.loss = now.loss;
    between.duplicate = between.reorder = now.disorder;
    between.bandwidth_bytes_per_second = now.bytes_per_second;
    between.datagram_queue = 5s; // what a slow one stores
}
virtual_tcp::virtual_tcp(const weather& now)
    : virtual_world(of_streams("tcp://10.0.0.1:7400", "tcp://10.0.0.1:7500"), now) {}
virtual_tls::virtual_tls(const weather& now)
    : virtual_world(of_streams("tls://10.0.0.1:7400", "tcp://10.0.0.1:7500"), now) {
    give_certificates();
}
virtual_certified_udp::virtual_certified_udp(const weather& now)
    : virtual_world(of_datagrams("udp+tls://10.0.0.1:7400", "udp://10.0.0.1:7500"), now) {
    give_certificates();
}
void virtual_world::give_certificates() {
    for (const char* host : {"boat", "shore"})
        for (const char* file : {"ca.pem", "certificate.pem", "key.pem"})
            sea_.host(host).write_file(std::string("tls/") + file, ise_test::read_all(certificates() / file));
    credentials.tls_folder = "tls";
}
virtual_udp::virtual_udp(const weather& now)
    : virtual_world(of_datagrams("udp://10.0.0.1:7400", "udp://10.0.0.1:7500"), now) {}

virtual_sealed_udp::virtual_sealed_udp(const weather& now)
    : virtual_world(of_datagrams("udp://10.0.0.1:7400", "udp://10.0.0.1:7500"), now) {
    for (const char* host : {"boat", "shore"}) sea_.host(host).write_file("key", std::string(64, 'k'));
    credentials.key_file = "key";
}

std::vector<weather> all_weathers() {
    std::vector<weather> made;
    for (std::uint64_t seed : {1, 2, 3}) {
        made.push_back({"clean", seed, 0, 0, 0});
        made.push_back({"rough", seed, 0.15, 0.2, 0});
        made.push_back({"slow", seed, 0, 0, 2000});
    }
    return made;
}

} // namespace conformance
