// Sessions in good order whose calls are not.
#include "harbour.hpp"

#include <ctime>

namespace callers_test {

using namespace hostile_test;

TEST_CASE("hostile: a million service numbers end the session at introduced_services") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    for (std::uint64_t number = 0; number < 5000; ++number) peer.introduce(number, "helm", {1, 2});
    peer.finish();
    CHECK(at.all.run_until([&] { return peer.closed(); }));
    CHECK(at.warned("introduced_services"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: a name or a list of packets that no service has ends the session") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto limit = GENERATE(as<std::string>(), "service_name_bytes", "service_fingerprints");
    bool subscribes = GENERATE(false, true);
    ise::wire::subscribe terms;
    terms.service.service = limit == "service_name_bytes" ? std::string(500'000, 'n') : std::string("helm");
    terms.service.fingerprints.resize(limit == "service_name_bytes" ? 2 : 100'000);
    if (subscribes) peer.say(frame_type::subscribe, 1, terms);
    else peer.say(frame_type::introduce, 0, terms.service);
    peer.finish();
    CHECK(at.all.run_until([&] { return peer.closed(); }));
    INFO(at.all_warnings());
    CHECK(at.warned(limit));
    at.others_do_not_notice();
}

TEST_CASE("hostile: a request with the number of one that waits for its schemas ends the session") {
    harbour at(either());
    INFO(at.channel);
    const bool given_up = GENERATE(false, true);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "helm", {77, helm.types().fingerprints[1]});
    set_mode asked{"tack"};
    peer.request(5, 0, 1h, asked);
    if (given_up) peer.say(frame_type::cancel, 5, ise::bytes_view());
    const std::uint64_t next = (std::uint64_t{1} << 32) + 5; // another call in the same place
    peer.request(next, 0, 1h, asked);
    at.all.world.run_for(1s);
    CHECK(peer.closed() != given_up);
    CHECK(at.warned("not answered yet") != given_up);
    if (given_up) {
        ise::wire::schema_answer none;
        none.fingerprint = 77;
        peer.say(frame_type::schema, 0, none);
        CHECK(at.all.run_until([&] { return peer.count(frame_type::error) == 1; }));
        CHECK(peer.last(frame_type::error)->header.id == next);
        peer.request(5, 0, 1h, asked); // its place is free again
        CHECK(at.all.run_until([&] { return peer.count(frame_type::error) == 2; }));
    }
    at.others_do_not_notice();
}

TEST_CASE("hostile: cancels of calls that do not exist cost the same while many requests wait for schemas") {
    harbour at("tcp");
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    set_mode asked{"tack"};
    for (std::uint64_t number = 0; number < 4000; ++number)
        peer.introduce(number, "helm", {1000 + 2 * number, 1001 + 2 * number});
    auto cost_of_cancels = [&] {
        const auto before = std::clock();
        for (std::uint64_t i = 0; i < 50'000; ++i)
            peer.say(frame_type::cancel, (i + 1) << 32 | i % 4096, ise::bytes_view());
        peer.finish();
        at.all.world.run_for(1s);
        return static_cast<double>(std::clock() - before) / CLOCKS_PER_SEC;
    };
    const double idle = cost_of_cancels();
    for (std::uint32_t call = 0; call < 200; ++call) peer.request(call, call, 1h, asked);
    const double held = cost_of_cancels();
    CAPTURE(idle, held);
    CHECK_FALSE(peer.closed());
    CHECK(peer.count(frame_type::error) == 0);
    CHECK(held < 5 * idle + 0.1);
}

TEST_CASE("hostile: a million pending calls: those of others go on") {
    ise::serve_options serving;
    serving.concurrent = 8;
    serving.waiting = 64;
    harbour at(either(), {}, serving);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "helm", helm.types().fingerprints);
    set_mode forever{"long"};
    for (std::uint64_t call = 0; call < 20'000; ++call) peer.request(call, 0, 24h, forever);
    peer.finish();
    CHECK(at.all.world.run_until([&] { return peer.count(frame_type::error) == 20'000 - 6 - 64; }, 10s));
    CHECK(at.at_once == 6); // three quarters of the handlers
    CHECK_THAT(peer.why(frame_type::error).message(),
               Contains("max_calls_per_session") || Contains("(waiting, waiting_bytes)"));
    at.others_do_not_notice();
    // Many calls of the others at once: more than there are handlers left, within a fair share of what may wait.
    std::vector<std::shared_ptr<started<ise::result<mode_set>>>> calls;
    for (int i = 0; i < 30; ++i) calls.push_back(start(at.shore.on, harbour::try_helm(at.there, 5s)));
    CHECK(at.all.run_until([&] { return std::ranges::all_of(calls, [](const auto& call) { return call->done; }); }));
    CHECK(std::ranges::all_of(calls, [](const auto& call) { return call->get().has_value(); }));
    CHECK(at.at_once == 6);
}

TEST_CASE("hostile: who asks much is served no faster than who asks little") {
    ise::serve_options one;
    one.concurrent = 1;
    harbour at(either(), {}, one);
    INFO(at.channel);
    at.others_do_not_notice(); // its session is made
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "helm", helm.types().fingerprints);
    set_mode quick{"quick"};
    for (std::uint64_t call = 0; call < 900; ++call) peer.request(call, 0, 1h, quick); // 9 s of work
    peer.finish();
    at.all.world.run_for(50ms);
    REQUIRE(at.at_once == 1);
    at.others_do_not_notice(100ms); // behind the one that runs, and not behind all
    CHECK(peer.count(frame_type::reply) < 50);
}

TEST_CASE("hostile: requests that wait are bounded by bytes too") {
    ise::serve_options little;
    little.concurrent = 1;
    little.waiting_bytes = 100'000;
    harbour at(either(), {}, little);
    INFO(at.channel);
    at.others_do_not_notice();
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "helm", helm.types().fingerprints);
    set_mode big{std::string(30'000, 'x')};
    for (std::uint64_t call = 0; call < 10; ++call) peer.request(call, 0, 1h, big);
    peer.finish();
    at.all.run_until([&] { return peer.count(frame_type::error) + peer.count(frame_type::reply) == 10; });
    CHECK(peer.count(frame_type::error) >= 6);
    CHECK_THAT(peer.why(frame_type::error).message(), Contains("waiting_bytes"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: replies that nobody takes are bounded and others get theirs") {
    ise::service_options options;
    options.session_bytes = 1 << 20;
    harbour at(either(), options);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel, false);
    peer.greet();
    peer.introduce(0, "echo", echo.types().fingerprints);
    blob big;
    big.content.resize(100'000);
    std::size_t most = 0;
    const std::uint64_t calls = at.datagrams ? 200 : 4000;
    for (std::uint64_t call = 0; call < calls && at.of_raw(); ++call) {
        peer.request(call % 4096, 0, 1h, big);
        peer.finish();
        if (auto* session = at.of_raw()) most = std::max(most, session->wire().out().pending_call_bytes());
    }
    at.all.world.run_for(1s);
    if (auto* session = at.of_raw()) most = std::max(most, session->wire().out().pending_call_bytes());
    CHECK(most > 500'000);
    CHECK(most < (2u << 20) + 200'000);
    at.others_do_not_notice();
}

TEST_CASE("hostile: a host gains no memory by many sessions that take no replies, and others get theirs") {
    ise::service_options options;
    options.session_bytes = 1 << 20;
    harbour at("tcp", options);
    constexpr int sessions = 40;
    std::list<raw_peer> peers;
    blob big;
    big.content.resize(GENERATE(50'000u, 600'000u)); // less and more than is not counted
    std::size_t most = 0;
    auto unread = [&] {
        std::size_t all = 0;
        for (const auto& [session, held] : at.boat.services->sessions())
            all += session->wire().out().pending_call_bytes();
        return all;
    };
    for (int i = 0; i < sessions; ++i) {
        auto& peer = peers.emplace_back(at.all, at.sea, at.channel, false);
        peer.greet("raw" + std::to_string(i));
        peer.introduce(0, "echo", echo.types().fingerprints);
    }
    for (std::uint64_t call = 0; call < 40; ++call)
        for (auto& peer : peers) {
            if (peer.closed()) continue;
            peer.request(call, 0, 1h, big);
            peer.finish();
            most = std::max(most, unread());
        }
    at.all.world.run_for(1s);
    CHECK(std::max(most, unread()) < options.host_bytes() + sessions * 2 * ise::host_memory::free_bytes + 600'000);
    at.others_do_not_notice();
    peers.clear();
    at.all.world.run_for(10s);
    raw_peer again(at.all, at.sea, at.channel);
    again.greet();
    again.introduce(0, "echo", echo.types().fingerprints);
    again.request(0, 0, 1h, blob());
    again.finish();
    CHECK(at.all.run_until([&] { return again.count(frame_type::reply) == 1; }));
}

TEST_CASE("hostile: who takes no replies and goes on calling is ended at twice session_bytes") {
    ise::service_options options;
    options.session_bytes = 100'000;
    harbour at(either(), options);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel, false);
    peer.greet();
    peer.introduce(0, "nothing_of_that_kind", helm.types().fingerprints);
    set_mode any{"any"};
    for (std::uint64_t call = 0; call < 20'000 && !peer.closed(); ++call) {
        peer.request(call << 32, 0, 1h, any);
        if (call % 100 == 0) peer.finish();
    }
    CHECK(at.all.world.run_until([&] { return !at.of_raw(); }, 10s));
    CHECK(at.warned("session_bytes"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: answers to subscriptions and to their ends are bounded too") {
    ise::service_options options;
    options.session_bytes = 100'000;
    harbour at(either(), options);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel, false);
    peer.greet();
    auto type = GENERATE(frame_type::subscribe, frame_type::unsubscribe);
    ise::wire::subscribe terms;
    terms.service.service = "nothing_of_that_kind";
    auto body = ise::encode(terms);
    for (std::uint64_t id = 1; id < 200'000 && !peer.closed(); ++id) {
        peer.say(type, id, ise::bytes_view(body));
        if (id % 100 == 0) peer.finish();
    }
    CHECK(at.all.world.run_until([&] { return !at.of_raw(); }, 10s));
    CHECK(at.warned("session_bytes"));
    at.others_do_not_notice();
}

TEST_CASE("hostile: pongs that nobody takes end the session at control_bytes") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel, false);
    peer.greet();
    for (int i = 0; i < 400'000 && !peer.closed(); ++i) {
        peer.say(frame_type::ping, 1, ise::bytes_view());
        if (i % 1000 == 0) peer.finish();
    }
    CHECK(at.all.world.run_until([&] { return !at.of_raw(); }, 10s));
    CHECK(at.warned("control_bytes"));
    at.others_do_not_notice();
}

} // namespace callers_test
