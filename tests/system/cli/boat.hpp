// A component for the command line to talk to, whose headers it does not have.
#pragma once
#include <ise/ise.hpp>
#include <ise/service/service_host.hpp>

#include <string>
#include <vector>

namespace cli_test {

using namespace std::chrono_literals;

struct fix {
    std::uint32_t number = 0;
    double latitude_deg = 0, longitude_deg = 0;
};
struct set_mode {
    std::string mode = "hold";
};
struct mode_set {
    bool accepted = false;
    std::string reason;
};
struct waypoint {
    std::string name;
    double latitude_deg = 0;
};
struct route {
    std::vector<waypoint> waypoints;
};
struct route_set {
    std::uint64_t count = 0;
};
struct from_number {
    std::uint32_t first = 100;
};
struct farewell {
    std::string reason = "done";
};
struct watch_begun {
    std::string officer;
    std::uint32_t from = 0;
};

inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::subscription<fix, from_number, ise::nothing, farewell> counted{"counted"};
inline constexpr ise::subscription<fix> silent{"silent"};
inline constexpr ise::subscription<fix, from_number, watch_begun> watched{"watched"};
inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};
inline constexpr ise::request_response<route, route_set> plan{"plan"};
inline constexpr ise::request_response<set_mode, mode_set> never{"never"};
inline constexpr ise::request_response<ise::nothing, ise::nothing> retire{"retire"};
inline constexpr ise::request_response<set_mode, mode_set> beeper{"beeper"};

/// Sails, and answers.
class boat : public ise::component {
public:
    /// Of what left by an unsubscribe packet that said "done".
    std::atomic<int> left{0};
    /// Who ever subscribed to `silent`.
    std::atomic<int> watching{0};
    /// Requests of `never` that are being served.
    std::atomic<int> stuck{0};

private:
    ise::task<> run() override {
        provide(helm, [](set_mode rq) -> ise::task<mode_set> {
            if (rq.mode == "sink") throw ise::error(ise::errc::refused, "boats float");
            if (rq.mode == "break") throw std::runtime_error("the rudder \x1b[31mfell off");
            co_return mode_set{rq.mode != "fly", rq.mode};
        });
        provide(plan, [](route rq) -> ise::task<route_set> { co_return route_set{rq.waypoints.size()}; });
        provide(never, [this](set_mode) -> ise::task<mode_set> {
            ++stuck;
            co_await sleep(1h);
            co_return mode_set{};
        });
        provide(retire, [this](ise::nothing) -> ise::task<ise::nothing> {
            withdraw(silent);
            co_return ise::nothing{};
        });
        require(beeper);
        ise::publication_callbacks<std::remove_const_t<decltype(silent)>> unseen;
        unseen.on_subscribe = [this](const ise::nothing&, const ise::subscriber_info&) {
            ++watching;
            return ise::nothing{};
        };
        auto quiet = publish(silent, unseen);
        ise::publication_callbacks<std::remove_const_t<decltype(counted)>> callbacks;
        callbacks.on_subscribe = [this](const from_number& rq, const ise::subscriber_info&) {
            number_ = rq.first;
            return ise::nothing{};
        };
        callbacks.on_unsubscribe = [this](const farewell& rq, const ise::subscriber_info&) {
            if (rq.reason == "done") ++left;
            return ise::nothing{};
        };
        auto from = publish(counted, callbacks);
        ise::publication_callbacks<std::remove_const_t<decltype(watched)>> answering;
        answering.on_subscribe = [](const from_number& rq, const ise::subscriber_info&) {
            return watch_begun{"Ana\xc2\x9b", rq.first};
        };
        auto seen = publish(watched, answering);
        auto fixes = publish(position);
        for (std::uint32_t number = 0;; ++number) {
            co_await sleep(2ms);
            fixes(fix{number, 28.15, -15.45});
            from(fix{number_++, 28.15, -15.45});
            seen(fix{number, 28.15, -15.45});
        }
    }
    std::uint32_t number_ = 0;
};

/// A node of this process on real sockets, without names.
class harbour {
public:
    harbour()
        : node(env, quiet()), ship(node.start<boat>("atirma/boat", listening())),
          at(ship.services().listening().front().text()) {}

    ise::real_environment env;
    ise::node node;
    boat& ship;
    std::string at;

private:
    static ise::node_options quiet() {
        ise::node_options options;
        options.use_names = false;
        options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug) : ise::log_sink();
        return options;
    }
    static ise::component_options listening() {
        ise::component_options options;
        options.listen = {ise::endpoint::parse("tcp://127.0.0.1:0").value()};
        return options;
    }
};

} // namespace cli_test
