// What tests of a host's faults share: a caller and a provider in the test's own process, and vessels to ill-treat.
#pragma once
#include "vessel.hpp"

#include <support/catch.hpp>
#include <support/program.hpp>
#include <support/real_parties.hpp>

#include <csignal>
#include <fstream>
#include <sstream>

namespace host_test {

using namespace std::chrono_literals;
using ise_test::Contains;

inline std::vector<std::string> vessel_at(const std::string& endpoint, const std::string& names = "-") {
    return {"host_vessel", names, endpoint};
}

inline std::vector<std::string> ise_call(const std::string& at, const std::string& service,
                                         const std::string& request) {
    return {"ise", "--wait", "--timeout", "60s", "call", at, service, request};
}

/// Any port of the loopback.
inline std::string loopback(const std::string& scheme) { return scheme + "://127.0.0.1:0"; }

/// Whether something has come to that port of the loopback that nobody has read yet.
inline bool bytes_wait_at(const std::string& endpoint) {
    auto port = std::stoul(endpoint.substr(endpoint.rfind(':') + 1));
    bool udp = endpoint.starts_with("udp:");
    std::ifstream table(udp ? "/proc/net/udp" : "/proc/net/tcp");
    std::string line;
    std::getline(table, line);
    while (std::getline(table, line)) {
        std::istringstream words(line);
        std::string number, local, remote, state, queues;
        words >> number >> local >> remote >> state >> queues;
        bool here = std::stoul(local.substr(local.find(':') + 1), nullptr, 16) == port;
        if (here && (udp || state == "01") && queues.substr(queues.find(':') + 1) != "00000000") return true;
    }
    return false;
}

/// Calls and subscribes, on the test's own thread.
class console {
public:
    std::shared_ptr<ise_test::started<ise::result<rest>>> call(const std::string& at, std::uint32_t milliseconds,
                                                               ise::duration time) {
        return ise_test::start(shore.on, ask(shore.at(at), milliseconds, time));
    }
    ise::result<rest>& answer(const std::shared_ptr<ise_test::started<ise::result<rest>>>& of) {
        until([&] { return of->done; });
        return of->get();
    }
    void follow(const std::string& at) { shore.scope.spawn("follows", listen(shore.at(at), *this)); }
    void until(const std::function<bool()>& done) { all.run_until(done); }

    ise_test::real_parties all;
    ise_test::party& shore = all.add("shore");
    std::uint64_t heard = 0, lost = 0;
    int restarts = 0;

private:
    static ise::task<ise::result<rest>> ask(ise::remote there, std::uint32_t milliseconds, ise::duration time) {
        rest wanted{milliseconds};
        auto got = co_await there.try_call(nap, wanted, time);
        co_return got;
    }
    static ise::task<> listen(ise::remote there, console& self) {
        auto packets = co_await there.subscribe(ticks, ise::subscribe_options::keep_last(64));
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) co_return;
            ++self.heard;
            if (auto lost = packet.lost_before()) self.lost += *lost;
            else ++self.restarts;
        }
    }
};

} // namespace host_test
