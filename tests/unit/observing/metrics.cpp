#include "watched.hpp"

#include <ise/component/exposition.hpp>
#include <ise/component/observing.hpp>

#include <cstdio>
#include <cstdlib>
#include <fstream>
#include <future>

namespace observing_test {
namespace {

using ise::detail::exposition;

bool has(const std::string& text, const std::string& line) {
    return ("\n" + text).find("\n" + line + "\n") != text.npos;
}

/// A provider that publishes two packets, answers "echo", refuses "no", and a caller that asks it so.
struct busy_node {
    explicit busy_node(ise::node_options options) : node(env, std::move(options)) {
        std::promise<std::string> listening;
        auto& provider = node.start(
            "sea/boat",
            [](ise::component& self) -> task<> {
                self.provide(echo, [](question asked) {
                    if (asked.text == "no") throw ise::error(ise::errc::refused, "not today");
                    return reply{asked.text};
                });
                auto out = self.publish(readings);
                out(reading{1});
                out(reading{2});
                co_await self.ready();
                co_await self.sleep(1h);
            },
            at("tcp://127.0.0.1:0"));
        auto where = provider.services().listening().front();
        run_on(node, [where](ise::component& self) -> task<> {
            auto boat = self.at(where);
            for (int i = 0; i < 3; ++i) co_await boat.call(echo, "hello", 10s);
            auto refused = co_await boat.try_call(echo, "no", 10s);
            CHECK(refused.error().code() == ise::errc::refused);
        });
    }
    ise::real_environment env;
    ise::node node;
};

} // namespace

TEST_CASE("metrics over a real socket count calls by outcome, packets and the process") {
    log_book log;
    auto options = without_names();
    options.log = log.sink();
    options.metrics = "127.0.0.1:0";
    busy_node busy(std::move(options));
    const auto url = log.url();
    CHECK(url.starts_with("http://127.0.0.1:"));
    auto text = get(busy.node, url);
    INFO(text);
    CHECK(text.starts_with("text/plain; version=0.0.4; charset=utf-8\n"));
    CHECK(has(text, R"(ise_requests_total{component="sea/boat",service="echo",outcome="ok"} 3)"));
    CHECK(has(text, R"(ise_requests_total{component="sea/boat",service="echo",outcome="refused"} 1)"));
    CHECK(has(text, R"(ise_request_wait_seconds_bucket{component="sea/boat",service="echo",le="+Inf"} 4)"));
    CHECK(has(text, R"(ise_request_wait_seconds_count{component="sea/boat",service="echo"} 4)"));
    CHECK(has(text, R"(ise_packets_published_total{component="sea/boat",service="readings"} 2)"));
    CHECK(has(text, R"(ise_component_up{component="sea/boat"} 1)"));
    CHECK(text.find("\nprocess_resident_memory_bytes ") != text.npos);
    CHECK(text.find("ise_metrics_services_left_out 0") != text.npos);

    auto open = get(busy.node, url, "application/openmetrics-text; version=1.0.0");
    CHECK(open.starts_with("application/openmetrics-text; version=1.0.0; charset=utf-8\n"));
    CHECK(open.ends_with("# EOF\n"));
    CHECK(open.find("# TYPE ise_requests counter\n") != open.npos);
}

TEST_CASE("promtool finds no fault in the metrics") {
    if (std::system("command -v promtool > /dev/null") != 0)
        return ise_test::skip(
            "promtool is not installed (Debian: prometheus, which cmake/install-packages test installs)");
    log_book log;
    auto options = without_names();
    options.log = log.sink();
    options.metrics = "127.0.0.1:0";
    busy_node busy(std::move(options));
    auto text = get(busy.node, log.url());
    INFO(text);
    auto file = "metrics_of_test_" + std::to_string(busy.env.identity().process_id) + ".txt";
    std::ofstream(file) << text.substr(text.find('\n') + 1);
    const int verdict = std::system(("promtool check metrics < " + file).c_str());
    std::remove(file.c_str());
    CHECK(verdict == 0);
}

TEST_CASE("a component whose loop is held up is shown as down, and the metrics of the others come all the same") {
    log_book log;
    auto options = without_names();
    options.log = log.sink();
    options.metrics = "127.0.0.1:0";
    busy_node busy(std::move(options));
    std::promise<void> held, go_on;
    busy.node.start("sea/stuck", [&](ise::component&) -> task<> {
        held.set_value();
        go_on.get_future().wait();
        co_return;
    });
    held.get_future().wait();
    auto text = get(busy.node, log.url());
    go_on.set_value();
    CHECK(has(text, R"(ise_component_up{component="sea/stuck"} 0)"));
    CHECK(has(text, R"(ise_component_up{component="sea/boat"} 1)"));
}

TEST_CASE("a port in use for metrics is an error that says what to do, and ends the node in good order") {
    log_book log;
    ise::real_environment env;
    auto options = without_names();
    options.log = log.sink();
    options.metrics = "127.0.0.1:0";
    ise::node first(env, options);
    auto url = log.url();
    options.metrics = url.substr(7, url.rfind('/') - 7);
    try {
        ise::node second(env, options);
        FAIL("it listens where the first one does");
    } catch (const ise::error& thrown) {
        CHECK(thrown.code() == ise::errc::address_in_use);
        CHECK(std::string(thrown.what()).find("cannot serve metrics: ") == 0);
        CHECK(std::string(thrown.what()).find("ISE_METRICS") != std::string::npos);
    }
}

TEST_CASE("a port alone is one of the loopback interface, and what is no address is refused") {
    CHECK(ise::detail::metrics_address("9464")->text() == "tcp://127.0.0.1:9464");
    CHECK(ise::detail::metrics_address("0.0.0.0:9464")->text() == "tcp://0.0.0.0:9464");
    CHECK(ise::detail::metrics_address("tcp://[::1]:9464")->text() == "tcp://[::1]:9464");
    CHECK_FALSE(ise::detail::metrics_address(""));
    CHECK_FALSE(ise::detail::metrics_address("none"));
    for (auto wrong : {"99999", "localhost", "udp://127.0.0.1:9464", "9464 ", "unix:///tmp/x"}) {
        INFO(wrong);
        CHECK_THROWS_AS(ise::detail::metrics_address(wrong), ise::error);
    }
}

TEST_CASE("texts of peers end neither a label nor a line") {
    exposition made(exposition::format::prometheus);
    made.metric("a_total", exposition::kind::counter, "Help.").add({{"x", "q\"b\\n\nz\xff"}}, std::uint64_t{1});
    made.metric("b", exposition::kind::gauge, "Other.").add({}, 0.25);
    made.metric("a_total", exposition::kind::counter, "Help.").add({}, std::uint64_t{2});
    CHECK(made.text() == "# HELP a_total Help.\n# TYPE a_total counter\na_total{x=\"q\\\"b\\\\n\\nz?\"} 1\na_total 2\n"
                         "# HELP b Other.\n# TYPE b gauge\nb 0.25\n");
}

} // namespace observing_test
