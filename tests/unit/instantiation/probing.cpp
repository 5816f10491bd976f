// Health probes, in the virtual world.
#include "virtual_machine.hpp"

#include <unit/name_server/system.hpp>

#include <ise/component/component_type.hpp>
#include <ise/instantiation/instantiation_server.hpp>
#include <ise/instantiation/probe.hpp>
#include <ise/instantiation/services.hpp>

#include <asio/buffer.hpp>

#include <array>

namespace probing_test {

using namespace instantiation_test;
using namespace std::chrono_literals;
using ise_test::Contains;
namespace host_services = ise::instantiation::services;

namespace {

/// What the port of a component does, which the test changes.
struct port_behaviour {
    bool listens = true;
    std::string answer = "HTTP/1.1 200 OK\r\n\r\n"; ///< empty: it stays silent
    std::string asked;                              ///< the last request
};

class porter final : public ise::component {
public:
    explicit porter(port_behaviour& how) : how_(how) {}

private:
    ise::task<> run() override {
        auto at = ise::endpoint::parse("tcp://127.0.0.1:8080").value();
        std::vector<std::unique_ptr<ise::stream>> open;
        for (;;) {
            auto listening = env().listen(on(), at);
            while (how_.listens && listening) {
                auto [problem, line] = co_await (*listening)->accept();
                if (problem) break;
                if (!how_.listens) break;
                spawn("line", serve(std::move(line)));
            }
            listening = ise::failure(ise::errc::io_failed, "closed");
            while (!how_.listens) co_await sleep(100ms);
        }
    }
    ise::task<> serve(std::unique_ptr<ise::stream> line) {
        std::array<char, 1000> piece;
        auto got = co_await line->read_some(asio::buffer(piece));
        if (got.bytes > 0) how_.asked.assign(piece.data(), got.bytes);
        if (how_.answer.empty()) co_await sleep(1h);
        asio::const_buffer answer(how_.answer.data(), how_.answer.size());
        line->try_write(std::span(&answer, 1));
        co_await sleep(1s);
    }
    port_behaviour& how_;
};

class probed_harbour {
public:
    probed_harbour() : system(true, 1), host(system.world, "shore") {
        auto& porters = host.installed["porters"];
        std::vector<ise::component_type> types;
        types.emplace_back("porter", "for the test", "sea/porter");
        std::vector<std::string> pages{"tcp://127.0.0.1:8080"};
        types.back().parameters.add("page", pages, "where it listens").kind(ise::parameter_kind::endpoint);
        porters.description = ise::describe_types("porters", "1", types);
        porters.run = [this](ise::sim::process& env, const std::vector<std::string>&) {
            auto made = std::make_shared<names_test::program>(env);
            made->node.start<porter>("sea/porter", ise::component_options(), port);
            return made;
        };
        system.start("shore", "instantiation", [this](ise::node& node) {
            server_options options;
            options.programs_folder = "/programs";
            options.state_folder = "/state";
            options.name_servers = {
                ise::endpoint::parse("tcp://" + system.world.host("ns").address() + ":7400").value()};
            node.start<instantiation_server>(path_of_host("shore"), ise::component_options(), host, options);
        });
        REQUIRE(system.world.run_until([&] { return system.holds("ise/host/shore"); }, 30s));
    }

    template <class Contract>
    typename Contract::response_type call(const Contract& service, typename Contract::request_type request) {
        using response = typename Contract::response_type;
        auto outcome = std::make_shared<std::optional<ise::result<response>>>();
        system.start("shore", "client", [&](ise::node& node) {
            node.start("", [outcome, request, &service](ise::component& self) -> ise::task<> {
                auto its = self.at("ise/host/shore");
                auto copy = request;
                auto got = co_await its.try_call(service, std::move(copy), 5min);
                outcome->emplace(std::move(got));
            });
        });
        REQUIRE(system.world.run_until([&] { return outcome->has_value(); }, 1h));
        return std::move(**outcome).value();
    }
    start_response start(const std::string& probe, restart_policy policy) {
        start_request request;
        request.type = "porter";
        request.terms.policy = policy;
        request.terms.probe = probe;
        request.terms.probe_every = 2s;
        return call(host_services::start, request);
    }
    instance_info state() { return call(host_services::instances, instances_request{}).instances.at(0); }
    template <class Condition>
    bool becomes(Condition holds) {
        for (int round = 0; round < 300; ++round) {
            if (holds(state())) return true;
            system.world.run_for(100ms);
        }
        return false;
    }

    names_test::system system;
    virtual_machine host;
    port_behaviour port;
};

} // namespace

TEST_CASE("a component whose port no longer answers is shown, and started again by its policy") {
    probed_harbour in;
    CHECK(in.start("tcp://127.0.0.1:8080", restart_policy::on_failure).outcome == start_outcome::ready);
    in.system.world.run_for(20s);
    CHECK(in.state().probe_trouble.empty());
    CHECK(in.state().restarts == 0);
    in.port.listens = false;
    CHECK(in.becomes(
        [](const instance_info& now) { return now.probe_trouble.find("its probe tcp://127.0.0.1:8080 failed") == 0; }));
    CHECK(in.becomes([](const instance_info& now) {
        return now.state == instance_state::waiting && now.reason.find("failed 3 times on end") != std::string::npos;
    }));
    in.port.listens = true;
    CHECK(in.becomes([](const instance_info& now) { return now.state == instance_state::ready && now.restarts == 1; }));
    in.system.world.run_for(10s);
    CHECK(in.state().probe_trouble.empty());
    CHECK(in.state().restarts == 1);
}

TEST_CASE("without a policy it is shown only, until it answers again") {
    probed_harbour in;
    in.start("http://127.0.0.1:8080/health?full=1", restart_policy::never);
    in.system.world.run_for(5s);
    CHECK_THAT(in.port.asked, ise_test::StartsWith("GET /health?full=1 HTTP/1.1\r\nHost: 127.0.0.1:8080\r\n"));
    CHECK(in.state().probe_trouble.empty());
    in.port.answer = "HTTP/1.1 503 Service Unavailable\r\n\r\n";
    CHECK(in.becomes([](const instance_info& now) {
        return now.probe_trouble.find("it answers HTTP/1.1 503 Service Unavailable") != std::string::npos;
    }));
    in.port.answer = "";
    CHECK(in.becomes(
        [](const instance_info& now) { return now.probe_trouble.find("no answer within 2 s") != std::string::npos; }));
    in.system.world.run_for(60s);
    CHECK(in.state().state == instance_state::ready);
    in.port.answer = "HTTP/1.0 204 No Content\r\n";
    CHECK(in.becomes([](const instance_info& now) { return now.probe_trouble.empty(); }));
}

TEST_CASE("a probe asks only where the component listens, or a host that the server allows") {
    probed_harbour in;
    for (const char* elsewhere : {"http://169.254.169.254/latest", "tcp://127.0.0.1:22", "http://[::1]:8080/"}) {
        auto result = in.start(elsewhere, restart_policy::never);
        CHECK(result.outcome == start_outcome::bad_argument);
        CHECK_THAT(result.why,
                   Contains("cannot be probed: the component does not listen there") && Contains("--allow-host"));
    }
    auto may = [](const char* probe, const char* listens, const launch_rules& rules = launch_rules()) {
        return rules.may_probe(parse_probe(probe).value().at, {ise::endpoint::parse(listens).value()}).has_value();
    };
    CHECK(may("tcp://127.0.0.1:80", "tcp://127.0.0.1:80"));
    CHECK(may("tcp://127.0.0.1:80", "tcp://0.0.0.0:80"));
    CHECK_FALSE(may("tcp://127.0.0.1:80", "tcp://127.0.0.1:81"));
    CHECK_FALSE(may("tcp://127.0.0.1:80", "udp://127.0.0.1:80"));
    CHECK_FALSE(may("tcp://10.0.0.7:80", "tcp://10.0.0.7:80")); // no address that it may listen on
    launch_rules rules;
    rules.target_hosts = {"127.0.0.1:81"};
    CHECK(may("tcp://127.0.0.1:81", "tcp://127.0.0.1:80", rules));
    CHECK_FALSE(may("tcp://127.0.0.1:82", "tcp://127.0.0.1:80", rules));
}

TEST_CASE("a probe is a TCP endpoint or an HTTP resource") {
    CHECK(parse_probe("http://127.0.0.1/").value().at.port == 80);
    CHECK(parse_probe("http://[::1]:81/x").value().path == "/x");
    for (const char* wrong : {"", "ftp://127.0.0.1:1", "tcp://127.0.0.1", "tcp://127.0.0.1:0", "tcp://127.0.0.1:1/x",
                              "http://127.0.0.1/a b", "http://user@127.0.0.1/", "http://127.0.0.1:80\r\nX: y/"})
        CHECK_THAT(parse_probe(wrong).error().message(), Contains("write it like tcp://127.0.0.1:8080"));
}

} // namespace probing_test
