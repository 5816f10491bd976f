#include <ise/ise.hpp>

#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <support/catch.hpp>
#include <support/local_sockets.hpp>

#include <future>

#include <unistd.h>

namespace local_pair_test {

namespace {

using namespace std::chrono_literals;

struct fix {
    double latitude_deg = 0, longitude_deg = 0;
    float speed_kn = 0;
};
struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted = false;
    std::string reason;
};

inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};

class boat : public ise::component {
    ise::task<> run() override {
        provide(helm, [](set_mode rq) -> ise::task<mode_set> { co_return mode_set{rq.mode != "fly", "boats sail"}; });
        auto fixes = publish(position);
        for (;;) {
            co_await sleep(10ms);
            fixes(fix{28.15, -15.45, 2.1f});
        }
    }
};

ise::node_options quiet() {
    ise::node_options options;
    options.use_names = false;
    if (!std::getenv("ISE_TEST_LOG")) options.log = {};
    else options.log = ise::log_to_stderr(ise::log_level::debug);
    return options;
}

} // namespace

TEST_CASE("a component calls and subscribes to another over each transport") {
    auto where = GENERATE(
        from_range(ise_test::usable_here({"tcp://127.0.0.1:0", "tcp://[::1]:0", "udp://127.0.0.1:0", "udp://[::1]:0",
                                          "udp://localhost:0", "local://@ise-test-pair-" + std::to_string(::getpid()),
                                          "shm://@ise-test-pair-" + std::to_string(::getpid()), "inproc://pair"})));
    CAPTURE(where);
    ise::real_environment env;
    ise::node node(env, quiet());
    ise::component_options options;
    options.listen = {ise::endpoint::parse(where).value()};
    auto& provider = node.start<boat>("atirma/boat", options);
    auto at = provider.services().listening().front();
    if (where.find("localhost") != std::string::npos) at.host = "localhost"; // a name that the requester looks up

    std::promise<std::string> heard;
    auto answer = heard.get_future();
    node.start("atirma/console", [&](ise::component& self) -> ise::task<> {
        auto boat = self.at(at);
        set_mode hold{"hold"};
        auto reply = co_await boat.call(helm, hold, 30s);
        set_mode fly{"fly"};
        auto no = co_await boat.call(helm, fly, 30s);
        auto fixes = co_await boat.subscribe(position);
        auto first = co_await fixes.next();
        auto second = co_await fixes.next();
        heard.set_value(fmt::format("{} {} {:.2f} {:.2f} {}", reply.accepted, no.accepted, first->latitude_deg,
                                    second->longitude_deg, second.lost_before().value()));
    });
    REQUIRE(answer.wait_for(60s) == std::future_status::ready);
    CHECK(answer.get() == "true false 28.15 -15.45 0");
    node.stop();
    node.wait();
    for (const auto& report : node.reports()) CHECK(report.still_running.empty());
}

TEST_CASE("the short form builds the request from its fields") {
    ise::real_environment env;
    ise::node node(env, quiet());
    auto& provider = node.start<boat>("atirma/boat");
    auto at = provider.services().listening().front();
    auto& asker = node.start("atirma/console", [](ise::component& self) -> ise::task<> { co_await self.sleep(1h); });
    auto ask = [](ise::component& self, ise::endpoint where) -> ise::task<bool> {
        auto boat = self.at(where);
        auto reply = co_await boat.call(helm, "hold");
        co_return reply.accepted;
    };
    CHECK(asker.wait(ask(asker, at)));
}

} // namespace local_pair_test
