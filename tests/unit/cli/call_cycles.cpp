// Calls that wait for one another across processes: from descriptions by hand, and from real components.
#include <apps/ise/call_cycles.hpp>
#include <apps/ise/span_tree.hpp>

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/service/service_host.hpp>

#include <support/catch.hpp>

#include <atomic>
#include <future>
#include <source_location>

namespace call_cycles_test {

using namespace std::chrono_literals;
using namespace ise::cli;
using ise::task;
using ise_test::Contains;

namespace {

struct question {
    std::string text;
};
struct reply {
    std::string text;
};
inline constexpr ise::request_response<question, reply> ask{"ask"}, tell{"tell"};

surveyed component(const std::string& path) {
    surveyed made;
    made.name.path = path;
    made.about.emplace();
    made.about->path = path;
    return made;
}

void awaits(surveyed& at, const std::string& handler, std::uint64_t caller_id, const std::string& provider,
            const std::string& service, std::uint64_t id) {
    ise::awaited_call_info made;
    made.handler = handler;
    made.caller = "x (tcp://1)";
    made.caller_id = caller_id;
    made.provider = provider;
    made.service = service;
    made.id = id;
    made.where = at.name.path + ".cpp:7";
    made.waited = 1s;
    at.about->awaited.push_back(made);
}

void serves(surveyed& at, const std::string& service, const std::string& caller, std::uint64_t id, bool running) {
    ise::served_call_info made;
    made.service = service;
    made.caller = caller;
    made.id = id;
    made.running = running;
    at.about->served.push_back(made);
}

ise::node_options without_names() {
    ise::node_options made;
    made.use_names = false;
    made.log = ise::log_sink();
    return made;
}

ise::component_options on_loopback() {
    ise::component_options made;
    made.listen.push_back(ise::endpoint::parse("tcp://127.0.0.1:0").value());
    return made;
}

} // namespace

TEST_CASE("a handler that works is no cycle, nor one whose request another handler may take") {
    auto a = component("a"), b = component("b");
    awaits(a, "ask", 1, "b", "tell", 5);
    serves(a, "ask", "x (tcp://1)", 1, true);
    serves(b, "tell", "a (tcp://2)", 5, true); // it waits for nobody
    CHECK(examine_calls({a, b}).empty());

    // Another handler of b waits for a, whose service is busy; the one that a waits for goes on.
    awaits(b, "tell", 9, "a", "ask", 3);
    serves(b, "tell", "x (tcp://1)", 9, true);
    serves(a, "ask", "b (tcp://3)", 3, false);
    CHECK(examine_calls({a, b}).empty());
}

TEST_CASE("a request that waits for a busy handler closes the cycle, and what only leads there is left out") {
    auto a = component("a"), b = component("b"), c = component("c");
    awaits(a, "ask", 1, "b", "tell", 5);
    serves(a, "ask", "x (tcp://1)", 1, true);
    awaits(b, "tell", 5, "a", "ask", 3);
    b.about->awaited.back().caller = "a (tcp://2)";
    serves(b, "tell", "a (tcp://2)", 5, true);
    serves(a, "ask", "b (tcp://3)", 3, false);
    awaits(c, "other", 8, "a", "ask", 4);
    serves(a, "ask", "c (tcp://4)", 4, false);
    auto found = examine_calls({a, b, c});
    REQUIRE(found.size() == 1);
    CHECK(found[0].kind == "call_cycle");
    CHECK(found[0].component == "a");
    CHECK(found[0].severity == severity_level::error);
    CHECK_THAT(found[0].message, Contains("the handler of 'ask' at a, a.cpp:7, waits for 'tell' of b (1 s)\n"));
    CHECK_THAT(
        found[0].message,
        Contains("the handler of 'tell' at b, b.cpp:7, waits for 'ask' of a (1 s), where all handlers are busy"));
    CHECK(found[0].message.find("of 'other'") == std::string::npos);
}

TEST_CASE("a cycle of exclusive handlers over tcp is named with components, services and lines, while it lasts") {
    ise::real_environment env;
    std::promise<ise::endpoint> b_listens;
    auto b_at = b_listens.get_future().share();
    std::atomic<unsigned> a_line = 0, b_line = 0;
    std::promise<finding> named;
    // Last: handlers run until they have stopped.
    ise::node first(env, without_names()), second(env, without_names()), third(env, without_names());
    auto& a = first.start(
        "sea/a",
        [&](ise::component& self) -> task<> {
            self.provide_exclusive(ask, [&](question) -> task<reply> {
                auto to = self.at(b_at.get());
                a_line = std::source_location::current().line() + 1;
                auto got = co_await to.call(tell, "x", 60s);
                co_return got;
            });
            co_await self.ready();
            co_await self.sleep(1h);
        },
        on_loopback());
    const auto a_at = a.services().listening().front();
    auto& b = second.start(
        "sea/b",
        [&, a_at](ise::component& self) -> task<> {
            auto to = self.at(a_at);
            self.provide(tell, [&, to](question) -> task<reply> {
                b_line = std::source_location::current().line() + 1;
                auto got = co_await to.call(ask, "x", 60s);
                co_return got;
            });
            co_await self.ready();
            co_await self.sleep(1h);
        },
        on_loopback());
    b_listens.set_value(b.services().listening().front());

    third.start("", [&](ise::component& self) -> task<> {
        auto to_a = self.at(a_at), to_b = self.at(b_at.get());
        self.spawn("call", [](ise::remote to) -> task<> { (void)co_await to.try_call(ask, "x", 60s); }(to_a));
        const ise::describe_request how{};
        for (;;) { // until the calls are under way for long enough
            std::vector<surveyed> now(2);
            now[0].name.path = "sea/a";
            now[1].name.path = "sea/b";
            now[0].about = co_await to_a.call(ise::describe_service, how, 10s);
            now[1].about = co_await to_b.call(ise::describe_service, how, 10s);
            auto found = examine_calls(now);
            if (!found.empty()) {
                named.set_value(found.front());
                co_return;
            }
            co_await self.sleep(10ms);
        }
    });
    auto found = named.get_future().get();
    CHECK(found.component == "sea/a");
    auto file = std::string(__FILE__) + ":";
    CHECK_THAT(found.message, Contains("the handler of 'ask' at sea/a, " + file + std::to_string(a_line) +
                                       ", waits for 'tell' of sea/b ("));
    CHECK_THAT(found.message, Contains("the handler of 'tell' at sea/b, " + file + std::to_string(b_line) +
                                       ", waits for 'ask' of sea/a ("));
    CHECK_THAT(found.message, Contains("where all handlers are busy"));
}

TEST_CASE("spans are drawn as a tree, whatever a file says") {
    auto line = [](const std::string& id, const std::string& parent, const std::string& component, int kind,
                   const std::string& peer, int begin, int status) {
        return R"({"resourceSpans":[{"resource":{"attributes":[{"key":"service.name","value":{"stringValue":")" +
               component + R"("}}]},"scopeSpans":[{"spans":[{"traceId":"ab12","spanId":")" + id +
               R"(","parentSpanId":")" + parent + R"(","name":"helm","kind":)" + std::to_string(kind) +
               R"(,"startTimeUnixNano":")" + std::to_string(begin) + R"(","endTimeUnixNano":")" +
               std::to_string(begin + 1000) + R"(","attributes":[{"key":"server.address","value":{"stringValue":")" +
               peer + R"("}},{"key":"error.type","value":{"stringValue":"refused"}}],"status":{"code":)" +
               std::to_string(status) + "}}]}]}]}\n";
    };
    std::vector<traced_span> all;
    REQUIRE(read_spans(line("2", "1", "boat", 2, "", 1500, 2) + line("1", "", "shore", 3, "boat", 1000, 1) +
                           line("3", "9", "lost", 2, "", 3000, 1) + "{\"resourceSp", // being written
                       all));
    REQUIRE(all.size() == 3);
    CHECK(spans_of_trace(all, "cd").empty());
    auto spans = spans_of_trace(all, "");
    CHECK(draw_trace(spans) == "trace ab12, 1970-01-01T00:00:00Z, 3 us, 3 spans\n"
                               "shore calls 'helm' of boat   at 0 us, 1 us\n"
                               "└─ boat answers 'helm'   at 0.5 us, 1 us: refused\n"
                               "lost answers 'helm'   at 2 us, 1 us (what caused it is not in these files)\n");
    for (auto wrong : {"{}\n", "x\n",
                       R"({"resourceSpans":[{"scopeSpans":[{"spans":[{}]}]}]})"
                       "\n"}) {
        auto read = read_spans(wrong, all);
        REQUIRE_FALSE(read);
        CHECK_THAT(read.error().message(), Contains("line 1 is not OTLP/JSON") && !Contains("json.exception"));
    }
    // Two that cause each other end, too.
    std::vector<traced_span> loop;
    REQUIRE(read_spans(line("1", "2", "a", 2, "", 1, 1) + line("2", "1", "b", 2, "", 2, 1), loop));
    CHECK_THAT(draw_trace(loop), Contains("2 spans"));
}

} // namespace call_cycles_test
