#pragma once
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/raw_peer.hpp>

#include <algorithm>

namespace hostile_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise::wire::frame_type;
using ise_test::Contains;

/// Both ways to the boat, one after the other: the test case runs for each.
inline std::string either() { return GENERATE(as<std::string>(), "tcp", "udp"); }

/// A provider, a peer in good order, and the place where hostile ones come from, all over `protocol`.
struct harbour {
    explicit harbour(const std::string& protocol, ise::service_options options = {}, ise::serve_options serving = {})
        : datagrams(protocol == "udp"), channel(protocol + "://boat:7400"), boat(all.add("boat", options)) {
        // Answers after a while; "long" only when its deadline ends it.
        boat.provide(
            helm,
            [this](set_mode asked) -> ise::task<mode_set> {
                max_at_once = std::max(max_at_once, ++at_once);
                struct leaving {
                    int& count;
                    ~leaving() { --count; }
                } guard{at_once};
                ise::duration length = asked.mode == "long" ? ise::duration(24h) : ise::duration(10ms);
                co_await ise::sleep_for(boat.on, length);
                mode_set done{true, asked.mode};
                co_return done;
            },
            serving);
        boat.provide(echo, [](blob given) { return given; });
        boat.listen(protocol + "://0.0.0.0:7400");
    }

    static ise::task<ise::result<mode_set>> try_helm(ise::remote there, ise::duration time) {
        set_mode hold{"hold"};
        auto got = co_await there.try_call(helm, hold, time);
        co_return got;
    }
    /// What everybody else expects of the boat, whoever is there too: an answer within this much virtual time.
    void others_do_not_notice(ise::duration within = 1s) {
        auto got = all.run(shore, try_helm(there, within));
        INFO((got ? std::string() : got.error().message()));
        CHECK(got);
    }
    bool warned(const std::string& of) const {
        return std::ranges::any_of(boat.warnings,
                                   [&](const std::string& line) { return line.find(of) != std::string::npos; });
    }
    std::string all_warnings() const {
        std::string text;
        for (const auto& line : boat.warnings) text += line + "\n";
        return text;
    }
    /// The session of a hostile peer that said it is called "raw".
    ise::session* of_raw() const {
        for (const auto& [at, held] : boat.services->sessions())
            if (at->peer().path == "raw") return at;
        return nullptr;
    }

    const bool datagrams;
    const std::string channel;
    int at_once = 0, max_at_once = 0;
    sim_parties all;
    party& boat;
    party& shore = all.add("shore");
    ise::sim::process& sea = all.world.host("sea").start_process("sea");
    ise::remote there = shore.at(channel);
};

} // namespace hostile_test
