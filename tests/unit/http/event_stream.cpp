#include <ise/http/http_server.hpp>

#include <unit/http/client.hpp>

#include <support/catch.hpp>

#include <memory>
#include <optional>

namespace event_stream_test {

using web_test::another_host;
using web_test::client;

namespace {
bool has(const std::string& text, std::string_view part) { return text.find(part) != std::string::npos; }

struct stream_site : web_test::grounds {
    explicit stream_site(ise::http_limits limits = {}, const std::string& address = "127.0.0.1")
        : server(host->loop(), log, limits, spawner()) {
        events = &server.events("/events", [this](std::string_view last) {
            return ise::sse_event{"e:" + std::to_string(++snapshots), "snapshot", "after " + std::string(last)};
        });
        server.listen(web_test::any_port(address)).value();
    }
    std::unique_ptr<client> watcher(std::string_view headers = "", std::string_view path = "/events") {
        auto c = std::make_unique<client>(context, server.where().port);
        c->get(path, headers);
        c->read_until("event: snapshot");
        return c;
    }
    void run_until_clients(std::size_t wanted) {
        while (events->clients() != wanted) context.restart(), context.run_one();
    }
    int snapshots = 0;
    ise::http_server server;
    ise::sse_channel* events = nullptr;
};

/// A client that takes what it is given only when told to.
struct slow_sink final : ise::sse_sink {
    void write(std::shared_ptr<const std::string> text, written done) override {
        REQUIRE_FALSE(waiting);
        texts.push_back(*text);
        waiting = std::move(done);
    }
    void close() noexcept override { closed = true; }
    void take(std::error_code failed = {}) {
        auto done = std::move(*waiting);
        waiting.reset();
        done(failed);
    }
    std::vector<std::string> texts;
    std::optional<written> waiting;
    bool closed = false;
};
} // namespace

TEST_CASE("a client receives the snapshot first and then every event in order") {
    stream_site s;
    auto c = s.watcher();
    CHECK(has(c->received, "Content-Type: text/event-stream"));
    CHECK(has(c->received, "Cache-Control: no-store"));
    c->read_until("data: after \n");
    for (int i = 0; i < 50; ++i)
        s.events->publish({"e:" + std::to_string(10 + i), "update", "number " + std::to_string(i) + "."});
    c->read_until("number 49.");
    std::size_t at = 0;
    for (int i = 0; i < 50; ++i) {
        auto next = c->received.find("number " + std::to_string(i) + ".", at);
        REQUIRE(next != std::string::npos);
        at = next;
    }
    CHECK(s.events->statistics().events_skipped == 0);
}

TEST_CASE("what a client had seen reaches the snapshot, by header or by query") {
    stream_site s;
    s.watcher("Last-Event-ID: e:7\r\n")->read_until("data: after e:7\n");
    auto c = s.watcher("", "/events?last=e:8");
    CHECK(has(c->read_until("data: after e:8\n"), "after e:8"));
}

TEST_CASE("a client that leaves is forgotten at once") {
    stream_site s;
    auto c = s.watcher();
    REQUIRE(s.events->clients() == 1);
    c.reset();
    s.run_until_clients(0);
    CHECK(s.events->statistics().left == 1);
}

TEST_CASE("more watchers than allowed are told so and the others stay") {
    ise::http_limits limits;
    limits.streams.max_clients = 1;
    stream_site s(limits);
    auto c = s.watcher();
    client second(s.context, s.server.where().port);
    second.get("/events");
    CHECK(has(second.read_answer(), "HTTP/1.1 503"));
    CHECK(has(second.received, "Retry-After"));
    s.events->publish({"", "update", "still"});
    CHECK(has(c->read_until("still"), "still"));
}

TEST_CASE("page: of too many streams the host with the most loses one to another host") {
    const auto elsewhere = another_host();
    if (elsewhere.empty()) return;
    ise::http_limits limits;
    limits.streams.max_clients = 3;
    stream_site s(limits, "0.0.0.0");
    std::vector<std::unique_ptr<client>> crowd;
    for (int i = 0; i < 3; ++i) crowd.push_back(s.watcher());
    client own(s.context, s.server.where().port);
    own.get("/events");
    CHECK(has(own.read_answer(), "HTTP/1.1 503"));
    client viewer(s.context, s.server.where().port, elsewhere);
    viewer.get("/events");
    CHECK(has(viewer.read_until("event: snapshot"), "200 OK"));
    CHECK(has(crowd[0]->read_to_end(), "event: snapshot"));
    CHECK(s.events->clients() == 3);
    s.events->publish({"", "update", "still"});
    for (auto* one : {crowd[1].get(), crowd[2].get(), &viewer}) CHECK(has(one->read_until("still"), "still"));
}

TEST_CASE("a quiet stream receives a comment on each tick") {
    stream_site s;
    auto c = s.watcher();
    s.events->tick();
    s.events->tick();
    CHECK(has(c->read_until(": still here\n\n"), ": still here"));
}

TEST_CASE("stopping ends streams and connections and leaves the port free") {
    stream_site s;
    auto c = s.watcher();
    client idle(s.context, s.server.where().port);
    idle.get("/nothing");
    idle.read_answer();
    auto at = s.server.where();
    s.server.stop();
    c->read_to_end();
    idle.read_to_end();
    CHECK(s.events->clients() == 0);
    CHECK(s.server.statistics().open_connections == 0);
    while (s.scope.size() > 0) s.turn(); // every coroutine ends by itself
    ise::http_server next(s.host->loop(), s.log, {}, s.spawner());
    next.listen(at).value();
    CHECK(next.where() == at);
}

TEST_CASE("a server that is destroyed under open connections leaves nothing behind") {
    web_test::grounds here;
    auto& context = here.context;
    auto server = std::make_unique<ise::http_server>(here.host->loop(), here.log, ise::http_limits(), here.spawner());
    server->events("/events", [](std::string_view) { return ise::sse_event{"", "snapshot", "{}"}; });
    server->listen(web_test::any_port()).value();
    client watching(context, server->where().port), halfway(context, server->where().port);
    watching.get("/events");
    watching.read_until("event: snapshot");
    halfway.send("GET / HT");
    server.reset();
    watching.read_to_end();
    halfway.read_to_end();
    CHECK(watching.closed);
    while (here.scope.size() > 0) here.turn();
}

TEST_CASE("a real client that does not read holds a bounded amount and gets a fresh snapshot when it does") {
    ise::http_limits limits;
    limits.streams.max_queued_bytes = 64 * 1024;
    stream_site s(limits);
    auto slow = s.watcher();
    auto quick = s.watcher();
    const std::string big(32 * 1024, 'x');
    int sent = 0;
    while (s.events->statistics().resynchronised == 0) { // the kernel's buffers take some megabytes first
        s.events->publish({"", "update", big + std::to_string(++sent) + "."});
        quick->read_until(big.substr(0, 16) + std::to_string(sent) + ".");
        REQUIRE(has(quick->received, "x" + std::to_string(sent) + ".")); // the quick one misses nothing
        quick->received.clear();
    }
    auto before = s.snapshots;
    slow->received.clear();
    slow->read_until("event: snapshot");
    CHECK(s.snapshots == before + 1);
    CHECK(s.events->statistics().events_skipped > 0);
}

TEST_CASE("a slow client's queue gives way to one snapshot, and the skipped events are counted") {
    int snapshots = 0;
    ise::sse_limits limits;
    limits.max_queued_bytes = 100;
    ise::sse_channel channel(
        [&](std::string_view) {
            return ise::sse_event{"", "snapshot", std::to_string(++snapshots)};
        },
        limits);
    auto sink = std::make_shared<slow_sink>();
    REQUIRE(channel.add(sink, ""));
    for (int i = 0; i < 10; ++i) channel.publish({"", "update", "twenty bytes of text"});
    CHECK(sink->texts.size() == 1); // the first snapshot is still under way
    CHECK(channel.statistics().resynchronised == 1);
    CHECK(channel.statistics().events_skipped == 10);
    sink->take();
    CHECK(snapshots == 2);
    sink->take();
    channel.publish({"7", "update", "live again"});
    CHECK(sink->texts.back() == "id: 7\nevent: update\ndata: live again\n\n");
}

TEST_CASE("events that fit the queue wait and arrive together, none lost") {
    ise::sse_channel channel([](std::string_view) { return ise::sse_event{"", "snapshot", ""}; });
    auto sink = std::make_shared<slow_sink>();
    channel.add(sink, "");
    channel.publish({"", "update", "one"});
    channel.publish({"", "update", "two"});
    sink->take();
    REQUIRE(sink->texts.size() == 2);
    CHECK(sink->texts[1] == "event: update\ndata: one\n\nevent: update\ndata: two\n\n");
}

TEST_CASE("clients that know nothing share one snapshot, and learn what came after it") {
    std::vector<std::string> asked;
    ise::sse_channel channel([&](std::string_view last) {
        asked.emplace_back(last);
        return ise::sse_event{"life:" + std::to_string(asked.size()), "snapshot", "since " + std::string(last)};
    });
    std::vector<std::shared_ptr<slow_sink>> sinks;
    auto add = [&](std::string_view last) {
        sinks.push_back(std::make_shared<slow_sink>());
        REQUIRE(channel.add(sinks.back(), last));
        return sinks.back();
    };
    add("");
    add("");
    CHECK(asked == std::vector<std::string>{""});
    CHECK(channel.statistics().shared == 1);
    channel.publish({"life:2", "update", "moved"});
    auto late = add("another-life:77"); // what another life of the source had told is not known here
    CHECK(late->texts.at(0) == sinks.at(0)->texts.at(0));
    late->take();
    CHECK(late->texts.at(1) == "id: life:2\nevent: snapshot\ndata: since life:1\n\n");
    auto knows = add("life:2");
    CHECK(has(knows->texts.at(0), "data: since life:2\n"));
    channel.tick();
    add("");
    CHECK(asked.back().empty()); // made anew: what came since would grow and grow
}

TEST_CASE("a client that fell behind is told what it lacks, not everything") {
    std::string asked;
    ise::sse_limits limits;
    limits.max_queued_bytes = 60;
    ise::sse_channel channel(
        [&](std::string_view last) {
            return asked = last, ise::sse_event{"a:9", "snapshot", ""};
        },
        limits);
    auto sink = std::make_shared<slow_sink>();
    channel.add(sink, "a:1");
    sink->take();
    channel.publish({"a:2", "update", "it was given this"});
    channel.publish({"a:3", "update", "and this waits"});
    channel.publish({"a:4", "update", "this is too much"});
    sink->take();
    CHECK(asked == "a:2");
}

TEST_CASE("a client that takes nothing for several ticks is dropped") {
    ise::sse_limits limits;
    limits.max_stuck_ticks = 3;
    ise::sse_channel channel([](std::string_view) { return ise::sse_event{"", "snapshot", ""}; }, limits);
    auto stuck = std::make_shared<slow_sink>();
    channel.add(stuck, "");
    channel.tick();
    channel.tick();
    CHECK(channel.clients() == 1);
    CHECK(channel.tick() == 1);
    CHECK(channel.clients() == 0);
    CHECK(stuck->closed);
    CHECK(channel.statistics().dropped_slow == 1);
    stuck->take(std::make_error_code(std::errc::operation_canceled)); // a late callback does no harm
}

TEST_CASE("a client whose write fails is forgotten, also in the middle of publishing") {
    auto channel = std::make_unique<ise::sse_channel>([](std::string_view) {
        return ise::sse_event{"", "snapshot", ""};
    });
    auto broken = std::make_shared<slow_sink>(), fine = std::make_shared<slow_sink>();
    channel->add(broken, "");
    channel->add(fine, "");
    broken->take(std::make_error_code(std::errc::broken_pipe));
    CHECK(channel->clients() == 1);
    channel.reset();
    CHECK(fine->closed);
    fine->take(); // after the channel's end
}

TEST_CASE("line breaks in an event cannot forge another") {
    CHECK(ise::encode_event({"1\nevent: x", "up\r\ndate", "a\nb\r\nc"}) ==
          "id: 1event: x\nevent: update\ndata: a\ndata: b\ndata: c\n\n");
}

} // namespace event_stream_test
