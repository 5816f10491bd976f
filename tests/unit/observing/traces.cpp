#include "watched.hpp"

#include <ise/component/observing.hpp>
#include <ise/http/http_server.hpp>

#include <asio/post.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <cstdio>
#include <fstream>
#include <functional>
#include <future>
#include <map>
#include <set>

namespace observing_test {
namespace {

using nlohmann::json;

struct seen_span {
    std::string component, name, trace, id, parent;
    int kind = 0, status = 0;
};

std::vector<seen_span> spans_of(const std::string& line) {
    std::vector<seen_span> all;
    auto parsed = json::parse(line);
    for (const auto& resource : parsed.at("resourceSpans"))
        for (const auto& one : resource.at("scopeSpans").at(0).at("spans")) {
            seen_span made;
            made.component = resource["resource"]["attributes"][0]["value"]["stringValue"];
            made.name = one.at("name");
            made.trace = one.at("traceId");
            made.id = one.at("spanId");
            made.parent = one.value("parentSpanId", "");
            made.kind = one.at("kind");
            made.status = one.at("status").at("code");
            CHECK(std::stoull(one.at("endTimeUnixNano").get<std::string>()) >=
                  std::stoull(one.at("startTimeUnixNano").get<std::string>()));
            all.push_back(std::move(made));
        }
    return all;
}

/// A caller asks `relay` of one component, whose handler asks `echo` of another; all in nodes of their own.
void make_calls(ise::environment& env, const ise::node_options& options, bool refused) {
    ise::node far(env, options), near(env, options), asking(env, options);
    auto& boat = far.start(
        "sea/boat",
        [refused](ise::component& self) -> task<> {
            self.provide(echo, [refused](question asked) {
                if (refused) throw ise::error(ise::errc::refused, "not today");
                return reply{asked.text};
            });
            co_await self.ready();
            co_await self.sleep(1h);
        },
        at("tcp://127.0.0.1:0"));
    auto where = boat.services().listening().front();
    auto& gate = near.start(
        "sea/gate",
        [where](ise::component& self) -> task<> {
            auto to = self.at(where);
            self.provide(relay, [to](question asked) -> task<reply> {
                auto answer = co_await to.call(echo, asked.text, 10s);
                co_return answer;
            });
            co_await self.ready();
            co_await self.sleep(1h);
        },
        at("tcp://127.0.0.1:0"));
    auto entry = gate.services().listening().front();
    run_on(asking, [entry, refused](ise::component& self) -> task<> {
        auto to = self.at(entry);
        auto answer = co_await to.try_call(relay, "x", 10s);
        CHECK(answer.has_value() == !refused);
    });
}

std::vector<seen_span> spans_in(const std::string& file) {
    std::vector<seen_span> all;
    std::ifstream in(file);
    for (std::string line; std::getline(in, line);) {
        auto some = spans_of(line);
        all.insert(all.end(), some.begin(), some.end());
    }
    return all;
}

std::string file_of(const ise::environment& env, const std::string& name) {
    auto file = name + "_" + std::to_string(env.identity().process_id) + ".jsonl";
    std::remove(file.c_str());
    return file;
}

const seen_span& one_of(const std::vector<seen_span>& all, std::string_view name, int kind) {
    for (const auto& each : all)
        if (each.name == name && each.kind == kind) return each;
    FAIL("no span of " << name);
    return all.front();
}

constexpr int server = 2, client = 3, producer = 4, consumer = 5;

struct note {
    std::string text; // within a process it travels as an object
};
inline constexpr ise::subscription<note> notes{"notes"};

/// `echo` of sea/boat publishes a note, of which sea/plotter, that follows the notes, tells sea/gate by `relay`. Asks
/// echo, then publishes a note outside of any call, and waits until sea/gate has heard of both.
void publish_notes(ise::environment& env, const ise::node_options& options, const std::string& transport) {
    ise::node gate_node(env, options), boat_node(env, options), plotter_node(env, options), asking(env, options);
    const bool inside = transport.starts_with("inproc");
    std::promise<void> once, twice;
    int heard = 0;
    auto& gate = gate_node.start(
        "sea/gate",
        [&](ise::component& self) -> task<> {
            self.provide(relay, [&](question asked) {
                if (++heard == 1) once.set_value();
                if (heard == 2) twice.set_value();
                return reply{asked.text};
            });
            co_await self.ready();
            co_await self.sleep(1h);
        },
        at("tcp://127.0.0.1:0"));
    std::function<void()> publish_again;
    auto& boat = boat_node.start(
        "sea/boat",
        [&](ise::component& self) -> task<> {
            auto out = self.publish(notes);
            publish_again = [out] { out(note{"2"}); };
            self.provide(echo, [out](question asked) -> task<reply> {
                out(note{"1"});
                co_return reply{asked.text};
            });
            co_await self.ready();
            co_await self.sleep(1h);
        },
        at(transport));
    auto boat_at = boat.services().listening().front();
    auto gate_at = gate.services().listening().front();
    std::promise<void> following;
    (inside ? boat_node : plotter_node).start("sea/plotter", [&](ise::component& self) -> task<> {
        auto from = self.at(boat_at), to = self.at(gate_at);
        auto some = co_await from.subscribe(notes);
        following.set_value();
        for (;;) {
            auto packet = co_await some.next();
            co_await to.call(relay, packet->text, 10s);
        }
    });
    following.get_future().wait();
    run_on(asking, [&](ise::component& self) -> task<> {
        auto to = self.at(boat_at);
        if (!inside) co_await to.call(echo, "x", 10s);
    });
    if (inside) {
        boat_node.start("sea/asking", [&](ise::component& self) -> task<> {
            auto to = self.at(boat_at);
            co_await to.call(echo, "x", 10s);
        });
    }
    once.get_future().wait();
    asio::post(boat.get_executor(), [&] { publish_again(); });
    twice.get_future().wait();
}

} // namespace

TEST_CASE("a packet that a handler publishes takes the trace of its call to the calls that a subscriber makes with it, "
          "and the next packet does not") {
    const std::string transport = GENERATE("tcp://127.0.0.1:0", "inproc://traced-notes");
    ise::real_environment env;
    auto options = without_names();
    options.traces = file_of(env, "traces_of_packets");
    publish_notes(env, options, transport);
    auto all = spans_in(options.traces);
    std::remove(options.traces.c_str());
    const auto &asked = one_of(all, "echo", client), &served = one_of(all, "echo", server),
               &published = one_of(all, "notes", producer), &taken = one_of(all, "notes", consumer);
    CHECK(served.parent == asked.id);
    CHECK(published.parent == served.id);
    CHECK(published.component == "sea/boat");
    CHECK(taken.parent == published.id);
    CHECK(taken.component == "sea/plotter");
    std::vector<seen_span> told;
    for (const auto& each : all)
        if (each.name == "relay" && each.kind == client) told.push_back(each);
    REQUIRE(told.size() == 2);
    const auto& first = told[0].trace == asked.trace ? told[0] : told[1];
    const auto& second = &first == &told[0] ? told[1] : told[0];
    CHECK(first.trace == asked.trace);
    CHECK(first.parent == taken.id);
    CHECK(second.trace != asked.trace);
    CHECK(second.parent.empty());
    CHECK(std::ranges::count_if(all, [](const auto& each) { return each.kind == consumer; }) == 1);
}

TEST_CASE("without a rate as many traces are kept as the export takes lightly, and again after it") {
    ise::tracer spans(std::nullopt, 3);
    auto kept = [&] {
        std::uint32_t count = 0;
        for (std::uint32_t at = 0; at < 3 * ise::tracer::usual_traces; ++at) {
            ise::trace_id in;
            std::uint64_t caused_by = 0;
            count += spans.begin_call(in, caused_by, false);
        }
        return count;
    };
    CHECK(kept() == ise::tracer::usual_traces);
    CHECK(kept() == 0);
    (void)spans.take();
    CHECK(kept() == ise::tracer::usual_traces);
}

TEST_CASE("a numbered trace is the same at both ends, and another for another number") {
    const auto one = ise::numbered_trace("boat", 7), same = ise::numbered_trace("boat", 7);
    CHECK(one.trace == same.trace);
    CHECK(one.high == same.high);
    CHECK(one.parent == same.parent);
    CHECK(one.trace != 0);
    CHECK(one.parent != 0);
    CHECK(ise::numbered_trace("boat", 8).trace != one.trace);
    CHECK(ise::numbered_trace("buoy", 7).trace != one.trace);
}

TEST_CASE("both sides of a call and of the call that its handler makes are spans of one trace, each caused by the one "
          "before") {
    const bool refused = GENERATE(false, true);
    ise::real_environment env;
    auto options = without_names();
    options.traces = file_of(env, "traces_of_test");
    make_calls(env, options, refused);
    auto all = spans_in(options.traces);
    std::remove(options.traces.c_str());
    REQUIRE(all.size() == 4);
    const auto &asked = one_of(all, "relay", client), &served = one_of(all, "relay", server),
               &nested = one_of(all, "echo", client), &last = one_of(all, "echo", server);
    CHECK(asked.trace.size() == 32);
    CHECK(asked.trace.substr(0, 16) != std::string(16, '0'));
    for (const auto& each : all) {
        CHECK(each.trace == asked.trace);
        CHECK(each.status == (refused ? 2 : 1));
    }
    CHECK(asked.parent.empty());
    CHECK(served.parent == asked.id);
    CHECK(nested.parent == served.id);
    CHECK(last.parent == nested.id);
    CHECK(served.component == "sea/gate");
    CHECK(last.component == "sea/boat");
    CHECK(asked.component == "(anonymous)");
}

TEST_CASE("a trace rate of 0 keeps no trace, and a handler begins none of its own") {
    ise::real_environment env;
    auto options = without_names();
    options.traces = file_of(env, "traces_of_none");
    options.trace_rate = 0;
    make_calls(env, options, false);
    CHECK(spans_in(options.traces).empty());
    std::remove(options.traces.c_str());
}

TEST_CASE("spans are posted to a collector, and dropped and counted where it is away") {
    ise::real_environment env;
    ise::node collecting(env, without_names());
    std::promise<ise::endpoint> listening;
    std::promise<std::string> posted;
    collecting.start("", [&](ise::component& self) -> task<> {
        ise::http_server collector(self.on(), self.log(), ise::http_limits(), [&](std::string name, task<> body) {
            self.spawn(std::move(name), std::move(body));
        });
        bool first = true;
        collector.otherwise([&](const ise::http_request& asked) {
            if (std::exchange(first, false)) posted.set_value(asked.path + "\n" + asked.message.body);
            return ise::http_response();
        });
        collector.listen(ise::endpoint::parse("tcp://127.0.0.1:0").value()).value();
        listening.set_value(collector.where());
        co_await self.sleep(1h);
    });
    auto options = without_names();
    options.traces = "http://127.0.0.1:" + std::to_string(listening.get_future().get().port);
    make_calls(env, options, false);
    auto text = posted.get_future().get();
    CHECK(text.starts_with("/v1/traces\n"));
    CHECK_FALSE(spans_of(text.substr(text.find('\n') + 1)).empty());
    collecting.stop();
    collecting.wait();
    make_calls(env, options, false); // nobody is there any more, and the nodes end all the same
}

TEST_CASE("what spans do not fit into the queue is dropped and counted") {
    ise::tracer spans(1, 7);
    ise::trace_id in;
    for (std::size_t at = 0; at < ise::tracer::max_spans + 3; ++at)
        spans.ended(in, at + 1, ise::span::side::client, {}, {}, {}, "a", "b", "c");
    CHECK(spans.dropped() == 3);
    CHECK(spans.take().size() == ise::tracer::max_spans);
    spans.ended(in, 5, ise::span::side::client, {}, {}, {}, "a", "b", "c");
    CHECK(spans.take().size() == 1);
    CHECK(spans.take().empty());
}

TEST_CASE("a share of traces is kept, and no number comes twice") {
    ise::tracer spans(0.25, 3);
    std::set<std::uint64_t> ids;
    int kept = 0;
    for (int at = 0; at < 4000; ++at) {
        ise::trace_id in;
        std::uint64_t caused_by = 0;
        if (!spans.begin_call(in, caused_by, false)) continue;
        ++kept;
        CHECK(caused_by == 0);
        CHECK(ids.insert(in.trace).second);
        CHECK(ids.insert(in.high).second);
        CHECK(ids.insert(in.parent).second);
    }
    CHECK(kept > 850);
    CHECK(kept < 1150);
}

TEST_CASE("texts of peers stay texts in OTLP") {
    ise::span one;
    one.service = "a\"\n\xff";
    one.peer = "\\";
    one.outcome = ise::errc::timed_out;
    one.id = 2;
    auto info = ise::detail::otlp_json({one}, "p", {});
    CHECK(info.find('\n') == info.npos);
    CHECK(spans_of(info).at(0).status == 2);
}

TEST_CASE("a trace rate is a number from 0 to 1") {
    CHECK(ise::detail::parse_trace_rate("0.5").value() == 0.5);
    for (auto wrong : {"", "2", "-1", "nan", "0.5x"}) CHECK_FALSE(ise::detail::parse_trace_rate(wrong));
}

} // namespace observing_test
