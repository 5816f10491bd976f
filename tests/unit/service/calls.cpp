#include <ise/asio.hpp>
#include <ise/packet/archive.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <asio/detached.hpp>

#include <new>
#include <optional>
#include <stdexcept>
#include <string>
#include <utility>

namespace calls_test {

namespace {
// Its own function writes it, and may fail.
struct writing {
    bool ink = true;
    template <class Archive>
    void save(Archive&) const {
        if (!ink) throw std::runtime_error("no ink");
    }
    template <class Archive>
    void load(Archive&) {}
};
struct page {
    writing text;
};
} // namespace
} // namespace calls_test

template <>
struct ise::opaque_type<calls_test::writing> {
    static constexpr std::string_view name = "test/writing";
    static constexpr std::uint32_t version = 1;
};

namespace calls_test {
namespace {
constexpr ise::request_response<boat_services::set_mode, page> scribe{"scribe"};

// The next one is not made.
struct brittle {
    static inline bool breaks = false;
    int number = 0;
    brittle() {
        if (std::exchange(breaks, false)) throw std::bad_alloc();
    }
    template <class Archive>
    void serialize(Archive& archive) {
        archive(number);
    }
};
struct received {
    int number = 0;
};
constexpr ise::request_response<brittle, received> porcelain{"porcelain"};
} // namespace

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise::execution;
using ise_test::Contains;

namespace {

using outcome = ise::result<mode_set>;

ise::task<outcome> try_helm(ise::remote boat, std::string mode, ise::duration limit = 5s) {
    set_mode request{std::move(mode)};
    auto answer = co_await boat.try_call(helm, request, limit);
    co_return answer;
}

ise::task<ise::result<blob>> try_echo(ise::remote boat, std::size_t size, ise::duration limit = 5s) {
    blob request;
    request.content.assign(size, 7);
    auto answer = co_await boat.try_call(echo, request, limit);
    co_return answer;
}

// What the handlers of a boat saw.
struct log_book {
    int begun = 0, cancelled = 0;
    std::vector<std::string> modes;
    ise::time_point deadline{};
};

// "wait" takes ten seconds; other modes are answered at once.
auto steering(ise::loop& on, log_book& book) {
    return [&on, &book](set_mode request, const ise::call_context& context) -> ise::task<mode_set> {
        ++book.begun;
        book.modes.push_back(request.mode);
        book.deadline = context.deadline;
        if (request.mode == "fly") throw ise::error(errc::refused, "boats sail");
        if (request.mode == "sink") throw std::runtime_error("the keel is gone");
        if (request.mode == "drift") throw ise::error(errc::not_connected, "the rudder does not answer");
        if (request.mode.starts_with("wait")) {
            try {
                co_await ise::sleep_for(on, 10s);
            } catch (const std::exception&) {
                ++book.cancelled;
                throw;
            }
        }
        mode_set answer{true, request.mode};
        co_return answer;
    };
}

struct fixture {
    sim_parties all;
    party& boat;
    party& shore = all.add("shore");
    log_book book;
    ise::remote there;

    explicit fixture(ise::serve_options serving = ise::serve_options(),
                     ise::service_options options = ise::service_options())
        : boat(all.add("boat", options)) {
        boat.provide(helm, steering(boat.on, book), serving);
        boat.listen("tcp://0.0.0.0:7400");
        there = shore.at("tcp://boat:7400");
    }
    ~fixture() {
        all.stop();
        CHECK(boat.escaped.empty());
        CHECK(shore.escaped.empty());
        CHECK(shore.services->calls().open_calls() == 0);
    }
    outcome call(std::string mode, ise::duration limit = 5s) {
        return all.run(shore, try_helm(there, std::move(mode), limit));
    }
};

} // namespace

TEST_CASE("a call gives the handler's response") {
    fixture at;
    auto got = at.call("hold");
    REQUIRE(got);
    CHECK(got->reason == "hold");
    CHECK(at.boat.services->counts().calls_served == 1);
}

TEST_CASE("a call that is refused says why, and that nothing was done") {
    fixture at;
    auto got = at.call("fly");
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::refused);
    CHECK(got.error().executed() == execution::not_executed);
    CHECK_THAT(got.error().message(), Contains("boats sail") && Contains("helm") && Contains("boat"));
}

TEST_CASE("an exception of a handler reaches the caller and leaves the session alive") {
    fixture at;
    auto got = at.call("sink");
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::handler_failed);
    CHECK(got.error().executed() == execution::unknown);
    CHECK_THAT(got.error().message(), Contains("the keel is gone"));
    CHECK(at.call("hold"));
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a service that is not there is named, also where a subscription has the name") {
    fixture at;
    at.boat.publish(ise::subscription<fix>("anchor"));
    constexpr ise::request_response<set_mode, mode_set> sails("sails"), anchor("anchor");
    for (const auto& absent : {sails, anchor}) {
        auto ask = [](ise::remote to, ise::request_response<set_mode, mode_set> what) -> ise::task<outcome> {
            set_mode request{"x"};
            auto got = co_await to.try_call(what, request, 1s);
            co_return got;
        };
        auto got = at.all.run(at.shore, ask(at.there, absent));
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == errc::no_such_service);
        CHECK(got.error().executed() == execution::not_executed);
        CHECK_THAT(got.error().message(), Contains(std::string(absent.name())));
    }
}

TEST_CASE("a call times out when nobody answers, and the handler is cancelled") {
    fixture at;
    auto got = at.call("wait", 2s);
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::timed_out);
    CHECK(got.error().executed() == execution::unknown);
    CHECK(at.all.run_until([&] { return at.book.cancelled == 1; }));
    CHECK(at.call("hold"));
}

TEST_CASE("a call of a component that is not there times out, not executed, and names the obstacle") {
    fixture at;
    auto nobody = at.shore.at("tcp://boat:9999");
    auto got = at.all.run(at.shore, try_helm(nobody, "hold", 3s));
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::timed_out);
    CHECK(got.error().executed() == execution::not_executed);
    CHECK_THAT(got.error().message(), Contains("boat:9999") && Contains("refused"));
}

TEST_CASE("calls that wait for a session end at their deadlines, also a hundred thousand of them") {
    fixture at;
    at.all.world.net().partition("boat", "shore");
    constexpr int calls = 100'000;
    int ended = 0;
    auto ask = [](ise::remote to, int& count) -> ise::task<> {
        for (int i = 0; i < calls; ++i)
            to.try_call(helm, set_mode{"hold"}, 3s + std::chrono::microseconds(i), [&count](outcome got) {
                if (!got && got.error().executed() == execution::not_executed) ++count;
            });
        co_return;
    };
    at.all.run(at.shore, ask(at.there, ended));
    const auto before = std::chrono::steady_clock::now();
    at.all.world.run_for(4s);
    CHECK(std::chrono::steady_clock::now() - before < 30s); // a hundred times what it takes
    CHECK(ended == calls);
}

TEST_CASE("a call waits for a component that comes up within its deadline") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    log_book book;
    boat.provide(helm, steering(boat.on, book));
    all.world.at(4s, [&] { boat.listen("tcp://0.0.0.0:7400"); });
    auto got = all.run(shore, try_helm(shore.at("tcp://boat:7400"), "hold", 20s));
    CHECK(got);
}

TEST_CASE("a session that breaks leaves a running call unknown") {
    fixture at;
    REQUIRE(at.call("hold"));
    auto waiting = start(at.shore.on, try_helm(at.there, "wait", 60s));
    at.all.run_until([&] { return at.book.begun == 2; });
    SECTION("because the provider's process died") {
        at.all.world.host("boat").start_process("other");
        dynamic_cast<ise::sim::process&>(at.boat.env).pause();
        at.all.world.net().isolate("boat");
        at.all.run_until([&] { return waiting->done; });
        CHECK_THAT(waiting->get().error().message(), Contains("not heard"));
        at.all.world.net().heal_all();
        dynamic_cast<ise::sim::process&>(at.boat.env).go_on();
    }
    SECTION("because the provider said goodbye") {
        at.boat.services->stop(1s);
        at.all.run_until([&] { return waiting->done; });
        CHECK(waiting->get().error().code() == errc::cancelled); // it was told before the goodbye
        CHECK(waiting->get().error().executed() == execution::unknown);
        return;
    }
    CHECK(waiting->get().error().code() == errc::peer_lost);
    CHECK(waiting->get().error().executed() == execution::unknown);
}

TEST_CASE("the caller's cancellation reaches the handler") {
    fixture at;
    auto waiting = start(at.shore.on, try_helm(at.there, "wait", 60s));
    at.all.run_until([&] { return at.book.begun == 1; });
    waiting->cancel.emit(asio::cancellation_type::terminal);
    CHECK(at.all.run_until([&] { return waiting->done && at.book.cancelled == 1; }));
    CHECK(at.shore.services->calls().late_replies == 0); // who gives up is not answered
    for (int i = 0; i < 3; ++i) CHECK(at.call("hold"));  // its slot and its worker serve again
}

TEST_CASE("of what a handler throws only a refusal keeps its code") {
    fixture at;
    auto got = at.call("drift");
    CHECK(got.error().code() == errc::handler_failed);
    CHECK(got.error().executed() == execution::unknown);
    CHECK_THAT(got.error().message(), Contains("the rudder does not answer"));
}

TEST_CASE("beyond what its provider takes at once a caller is told by which limit, before and in a session") {
    ise::service_options few;
    few.max_calls_per_session = 2;
    fixture at(ise::serve_options(), few);
    bool in_session = GENERATE(false, true);
    if (in_session) REQUIRE(at.call("hold"));
    std::vector<std::shared_ptr<started<outcome>>> calls;
    for (const char* mode : {"wait 1", "wait 2", "wait 3"})
        calls.push_back(start(at.shore.on, try_helm(at.there, mode, 120s)));
    at.all.run_until([&] { return calls[2]->done; });
    CHECK(calls[2]->get().error().code() == errc::overloaded);
    CHECK(calls[2]->get().error().executed() == execution::not_executed);
    CHECK_THAT(calls[2]->get().error().message(), Contains("(max_calls_per_session there)"));
    at.all.run_until([&] { return calls[0]->done && calls[1]->done; });
    CHECK((calls[0]->get() && calls[1]->get()));
}

TEST_CASE("a call is overloaded beyond what may wait, and those that wait are served in turn") {
    ise::serve_options serving;
    serving.concurrent = 1;
    serving.waiting = 2;
    fixture at(serving);
    REQUIRE(at.call("hold"));
    std::vector<std::shared_ptr<started<outcome>>> calls;
    for (const char* mode : {"wait 1", "wait 2", "wait 3", "wait 4"})
        calls.push_back(start(at.shore.on, try_helm(at.there, mode, 120s)));
    at.all.run_until([&] { return calls[3]->done; });
    CHECK(calls[3]->get().error().code() == errc::overloaded);
    CHECK_THAT(calls[3]->get().error().message(), Contains("(waiting, waiting_bytes)"));
    CHECK(calls[3]->get().error().executed() == execution::not_executed);
    CHECK(at.book.begun == 2); // exclusive: one at a time
    at.all.run_until([&] { return calls[2]->done; });
    CHECK((calls[0]->get() && calls[1]->get() && calls[2]->get()));
    CHECK(at.book.modes == std::vector<std::string>{"hold", "wait 1", "wait 2", "wait 3"});
}

TEST_CASE("a request that cannot be made out once its turn has come is refused, and the handler serves the next") {
    fixture at;
    ise::serve_options one;
    one.concurrent = 1;
    auto handle = [&](brittle came) -> ise::task<received> {
        co_await ise::sleep_for(at.boat.on, 1s);
        received answer{came.number};
        co_return answer;
    };
    at.boat.provide(porcelain, handle, one);
    auto send = [](ise::remote to, int number) -> ise::task<ise::result<received>> {
        brittle request;
        request.number = number;
        auto answer = co_await to.try_call(porcelain, request, 5s);
        co_return answer;
    };
    auto first = start(at.shore.on, send(at.there, 1));
    auto second = start(at.shore.on, send(at.there, 2));
    at.all.world.run_for(500ms);
    brittle::breaks = true;
    at.all.run_until([&] { return first->done && second->done; });
    CHECK_FALSE(brittle::breaks);
    CHECK(first->get());
    REQUIRE_FALSE(second->get());
    CHECK(second->get().error().code() == errc::handler_failed);
    CHECK(at.all.run(at.shore, send(at.there, 3)));
}

TEST_CASE("a request that is given up while it waits for an exclusive service never runs") {
    ise::serve_options serving;
    serving.concurrent = 1;
    fixture at(serving);
    auto first = start(at.shore.on, try_helm(at.there, "wait", 60s));
    auto second = start(at.shore.on, try_helm(at.there, "second", 60s));
    at.all.run_until([&] { return at.book.begun == 1; });
    at.all.world.run_for(1s);
    second->cancel.emit(asio::cancellation_type::terminal);
    auto third = start(at.shore.on, try_helm(at.there, "third", 60s)); // takes the place of the second
    at.all.run_until([&] { return first->done && third->done; });
    CHECK((first->get() && third->get()));
    CHECK(at.book.modes == std::vector<std::string>{"wait", "third"});
}

TEST_CASE("an exclusive handler whose call leads back to itself: the error names the handler and the request that "
          "waits for it") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    auto& user = all.add("user");
    ise::serve_options exclusive;
    exclusive.concurrent = 1;
    // Of the call on the way: within the first call's time, or all of it.
    auto limit = GENERATE(ise::duration(1s), ise::duration(10s));
    boat.provide(
        helm,
        [&](set_mode request) -> ise::task<mode_set> {
            auto there = boat.at("tcp://shore:7400");
            blob packet;
            auto echoed = there.call(echo, packet, limit);
            co_await std::move(echoed);
            mode_set answer{true, request.mode};
            co_return answer;
        },
        exclusive);
    shore.provide(echo, [&](blob request) -> ise::task<blob> {
        auto there = shore.at("tcp://boat:7400");
        set_mode back{"back"};
        auto steered = there.call(helm, back, 60s);
        co_await std::move(steered);
        co_return request;
    });
    boat.listen("tcp://0.0.0.0:7400");
    shore.listen("tcp://0.0.0.0:7400");
    auto got = all.run(user, try_helm(user.at("tcp://boat:7400"), "hold", 10s));
    REQUIRE_FALSE(got);
    std::string logged;
    for (const auto& line : boat.warnings) logged += line + "\n";
    CHECK_THAT(logged, Contains("'helm' runs one request at a time (provide_exclusive), and one from "));
    if (limit == 1s) {
        CHECK(got.error().code() == errc::handler_failed);
        CHECK_THAT(got.error().message(),
                   Contains("'helm' runs one request at a time (provide_exclusive), and one from ") &&
                       Contains("this is a cycle"));
    }
    all.stop();
}

TEST_CASE("the deadline that remains travels with the request") {
    fixture at;
    at.all.world.net().between("boat", "shore").latency = 100ms;
    REQUIRE(at.call("hold", 30s));
    auto begun = at.all.world.now();
    REQUIRE(at.call("hold", 30s));
    auto remaining = at.book.deadline - begun;
    CHECK(remaining > 30s - 110ms); // half of a round trip is what the two clocks may differ
    CHECK(remaining <= 30s);
}

namespace {

// Requests that are begun after the time at which nobody waits any more, by the world's clock.
struct late_fixture : fixture {
    ise::duration limit = 1s;
    ise::time_point made{};
    int begun = 0, late = 0, answered = 0;
    std::vector<std::shared_ptr<started<ise::result<blob>>>> calls;

    void note() {
        ++begun;
        if (all.world.now() >= made + limit) ++late;
    }
    // Its thread is busy for that long.
    void compute(ise::duration length) { all.world.engine().advance_to(all.world.now() + length); }
    void ask(int count, std::size_t size = 1000) {
        made = all.world.now();
        for (int i = 0; i < count; ++i) calls.push_back(start(shore.on, try_echo(there, size, limit)));
    }
    void wait() {
        all.run_until([&] { return std::ranges::all_of(calls, [](const auto& one) { return one->done; }); });
        all.world.run_for(20s);
        for (auto& one : calls) answered += one->get() ? 1 : 0;
    }
};

} // namespace

TEST_CASE("an expired request is not started, wherever it waited and whatever the two clocks say") {
    late_fixture at;
    static_cast<ise::sim::process&>(at.boat.env).set_clock_offset(GENERATE(0s, -3000s, 86400s));
    auto plain = GENERATE(false, true);
    ise::duration takes{};
    if (plain) {
        at.boat.provide(echo, [&](blob) {
            at.note();
            at.compute(takes);
            return blob();
        });
    } else {
        at.boat.provide(echo, [&](blob) -> ise::task<blob> {
            at.note();
            at.compute(takes);
            blob made;
            co_return made;
        });
    }
    INFO((plain ? "plain" : "coroutine"));
    SECTION("in a slow link") {
        at.all.world.net().between("boat", "shore").bandwidth_bytes_per_second = 20'000;
        at.ask(1, 10);
        at.wait();
        CHECK(at.answered == 1);
        at.ask(192);
        at.wait();
        CHECK(at.begun < 60);
        CHECK(at.begun > 10);
    }
    SECTION("in a slow link, over a session that has just begun") {
        at.all.world.net().between("boat", "shore").bandwidth_bytes_per_second = 20'000;
        at.ask(192);
        at.wait();
        CHECK(at.begun < 60);
        CHECK(at.begun > 10);
    }
    SECTION("in front of a process that is stopped for a while") {
        REQUIRE(at.call("steady"));
        auto& process = static_cast<ise::sim::process&>(at.boat.env);
        process.pause();
        at.ask(34);
        at.all.world.run_for(2s);
        process.go_on();
        at.wait();
        CHECK(at.begun == 0);
        CHECK(at.boat.services->counts().calls_expired == 34);
    }
    SECTION("behind others that are handled in the same turn") {
        REQUIRE(at.call("steady"));
        takes = 300ms;
        at.ask(27);
        at.wait();
        CHECK(at.begun == 4);
        CHECK(at.boat.services->counts().calls_expired == 23);
    }
    CHECK(at.late == 0);
}

TEST_CASE("a call whose request came too late says that nothing was done, where its answer is in time") {
    fixture at;
    auto& process = static_cast<ise::sim::process&>(at.boat.env);
    at.all.world.net().between("boat", "shore").latency = 100ms;
    REQUIRE(at.call("steady"));
    process.pause();
    auto calling = start(at.shore.on, try_helm(at.there, "steady", 1s));
    at.all.world.run_for(900ms);
    process.go_on(); // the answer cannot be back in time any more
    at.all.run_until([&] { return calling->done; });
    REQUIRE_FALSE(calling->get());
    CHECK(calling->get().error().code() == errc::timed_out);
    CHECK(at.book.begun == 1);
}

TEST_CASE("what a handler throws is logged at its provider, at a bounded rate") {
    fixture at;
    at.boat.provide(echo, [](blob) -> blob { throw std::runtime_error("no echo today"); });
    for (int i = 0; i < 50; ++i) {
        REQUIRE_FALSE(at.call("sink"));
        REQUIRE_FALSE(at.all.run(at.shore, try_echo(at.there, 1)));
        REQUIRE_FALSE(at.call("fly")); // a refusal is an answer
    }
    REQUIRE(at.boat.warnings.size() >= 2);
    CHECK(at.boat.warnings.size() < 10);
    CHECK_THAT(at.boat.warnings.at(0), Contains("'helm'") && Contains("the keel is gone"));
    CHECK_THAT(at.boat.warnings.at(1), Contains("'echo'") && Contains("no echo today"));
}

TEST_CASE("a nested call has the smaller deadline of the two and the same trace") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& proxy = all.add("proxy");
    auto& shore = all.add("shore");
    log_book book;
    boat.provide(helm, steering(boat.on, book));
    boat.listen("tcp://0.0.0.0:7400");
    auto way = proxy.at("tcp://boat:7400");
    proxy.provide(helm, [way](set_mode request) -> ise::task<mode_set> {
        auto nested = co_await way.call(helm, request, 1h);
        co_return nested;
    });
    proxy.listen("tcp://0.0.0.0:7400");
    auto begun = all.world.now();
    auto got = all.run(shore, try_helm(shore.at("tcp://proxy:7400"), "wait", 3s));
    CHECK(got.error().code() == errc::timed_out);
    CHECK(book.deadline - begun < 4s);
    CHECK(all.run_until([&] { return book.cancelled == 1; })); // through both
    CHECK(all.run(shore, try_helm(shore.at("tcp://proxy:7400"), "hold", 3s)));
}

TEST_CASE("what goes on at a handler's executor after its answer has neither its caller nor its deadline") {
    fixture at;
    auto& third = at.all.add("third");
    third.provide(helm, [&](set_mode) -> ise::task<mode_set> {
        co_await ise::sleep_for(third.on, 30s);
        mode_set answer;
        co_return answer;
    });
    third.listen("tcp://0.0.0.0:7500");
    std::optional<outcome> errand;
    auto run_errand = [](ise::loop& on, ise::remote to, std::optional<outcome>& into) -> ise::task<> {
        co_await ise::sleep_for(on, 1min);
        auto got = co_await try_helm(to, "hold", 60s);
        into.emplace(std::move(got));
    };
    at.boat.provide(echo, [&, far = at.boat.at("tcp://third:7500")](blob given) -> ise::task<blob> {
        asio::any_io_executor here = co_await ise::this_task::executor;
        auto begun = run_errand(at.boat.on, far, errand);
        ise::async_run(here, std::move(begun), asio::detached);
        co_return given;
    });
    CHECK(at.all.run(at.shore, try_echo(at.there, 8, 2s)));
    at.there = {};
    REQUIRE(at.all.run_until([&] { return at.boat.services->sessions().empty(); }));
    std::optional<std::string> caller;
    at.all.run_until([&] {
        at.boat.services->calls().each_awaited([&](const ise::pending_call& call) { caller = call.made_in->caller; });
        return caller || errand;
    });
    CHECK(caller == "");
    at.all.run_until([&] { return errand.has_value(); });
    CHECK(*errand);
}

TEST_CASE("a handler's executor may be kept for longer than its service is provided") {
    fixture at;
    std::optional<outcome> errand;
    std::optional<asio::any_io_executor> kept;
    at.boat.provide(echo, [&](blob given) -> ise::task<blob> {
        kept = co_await ise::this_task::executor;
        co_return given;
    });
    CHECK(at.all.run(at.shore, try_echo(at.there, 8, 2s)));
    at.boat.services->services().remove("echo");
    at.there = {};
    REQUIRE(at.all.run_until([&] { return at.boat.services->sessions().empty(); })); // which knew the service
    CHECK(ise::context_of(*kept)->deadline == ise::time_point::max());
    auto run_errand = [](ise::remote to, std::optional<outcome>& into) -> ise::task<> {
        auto got = co_await try_helm(to, "hold");
        into.emplace(std::move(got));
    };
    ise::async_run(*kept, run_errand(at.boat.at("tcp://boat:7400"), errand), asio::detached);
    REQUIRE(at.all.run_until([&] { return errand.has_value(); }));
    CHECK(*errand);
}

TEST_CASE("a handler calls its caller back over the same session, without deadlock") {
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore"); // listens nowhere
    constexpr ise::request_response<set_mode, mode_set> confirm("confirm");
    shore.provide(confirm, [](set_mode asked) { return mode_set{true, "yes, " + asked.mode}; });
    boat.provide(helm, [&boat, confirm](set_mode request) -> ise::task<mode_set> {
        ise::remote back(boat.services->link_back(boat.services->sessions().begin()->second));
        auto confirmed = co_await back.call(confirm, request, 2s);
        co_return confirmed;
    });
    boat.listen("tcp://0.0.0.0:7400");
    auto got = all.run(shore, try_helm(shore.at("tcp://boat:7400"), "hold"));
    REQUIRE(got);
    CHECK(got->reason == "yes, hold");
}

TEST_CASE("a reply that comes after its call has ended is counted") {
    fixture at;
    REQUIRE(at.call("hold"));
    at.all.world.net().between("boat", "shore").latency = 1s;
    auto got = at.call("hold", 1500ms); // answered at 2 s; the cancel crosses the reply
    CHECK(got.error().code() == errc::timed_out);
    at.all.world.run_for(5s);
    CHECK(at.shore.services->calls().late_replies == 1);
}

TEST_CASE("calls go on over a new session after a cut, and none runs twice") {
    fixture at;
    REQUIRE(at.call("first"));
    at.all.world.net().partition("boat", "shore");
    // Written into the dead connection, as far as anybody knows.
    auto lost = start(at.shore.on, try_helm(at.there, "lost", 60s));
    at.all.run_until([&] { return lost->done; });
    CHECK(lost->get().error().code() == errc::peer_lost);
    CHECK(lost->get().error().executed() == execution::unknown);
    // Asked for while there is no session: waits.
    auto waited = start(at.shore.on, try_helm(at.there, "waited", 60s));
    at.all.world.run_for(3s);
    CHECK_FALSE(waited->done);
    at.all.world.net().heal_all();
    at.all.run_until([&] { return waited->done; });
    CHECK(waited->get());
    CHECK(std::count(at.book.modes.begin(), at.book.modes.end(), "waited") == 1);
}

TEST_CASE("requests of which no byte was written move to the next session") {
    fixture at;
    at.boat.provide(echo, [](blob given) { return given; });
    REQUIRE(at.call("first"));
    at.all.world.net().partition("boat", "shore");
    // Fills the socket, so that what follows is not written.
    auto big = start(at.shore.on, try_echo(at.there, 4 << 20, 60s));
    at.all.world.run_for(10ms);
    std::vector<std::shared_ptr<started<outcome>>> small;
    for (int i = 0; i < 5; ++i)
        small.push_back(start(at.shore.on, try_helm(at.there, "small" + std::to_string(i), 60s)));
    at.all.run_until([&] { return big->done; });
    CHECK(big->get().error().executed() == execution::unknown);
    at.all.world.net().heal_all();
    at.all.run_until([&] { return std::all_of(small.begin(), small.end(), [](auto& one) { return one->done; }); });
    for (auto& one : small) CHECK(one->get());
    CHECK(at.book.modes == std::vector<std::string>{"first", "small0", "small1", "small2", "small3", "small4"});
}

TEST_CASE("a call back over the session of a request ends with that session, also where it was not written yet") {
    fixture at;
    REQUIRE(at.all.run(at.shore, try_helm(at.there, "first")));
    // Back to whoever made the session, on the side that made it; its own link to the boat is `at.there`.
    ise::remote back(at.shore.services->link_back(at.shore.services->sessions().begin()->second));
    at.all.world.net().partition("shore", "boat");
    auto big = start(at.shore.on, try_echo(at.there, 400'000, 2s)); // the socket takes no more
    at.all.world.run_for(10ms);
    auto unwritten = start(at.shore.on, try_helm(back, "late", 10s));
    at.all.run_until([&] { return unwritten->done; });
    CHECK(unwritten->get().error().code() == errc::peer_lost);
    CHECK(unwritten->get().error().executed() == execution::not_executed);
    at.all.world.net().heal("shore", "boat");
    CHECK(at.all.run(at.shore, try_helm(at.there, "last", 30s)));
    CHECK(at.shore.services->calls().open_calls() == 0);
    CHECK(at.book.modes == std::vector<std::string>{"first", "last"});
}

TEST_CASE("a handle on the session of a request may outlive a component whose loop was abandoned") {
    ise::sim::world world(1);
    auto add = [&](const std::string& name) {
        auto& process = world.host(name).start_process(name);
        return std::make_unique<party>(process, process.make_loop("main"), name);
    };
    auto shore = add("shore"), boat = add("boat");
    log_book book;
    boat->provide(helm, steering(boat->on, book));
    boat->listen("tcp://0.0.0.0:7400");
    auto asking = start(shore->on, try_helm(shore->at("tcp://boat:7400"), "first"));
    REQUIRE(world.run_until([&] { return asking->done; }));
    {
        ise::remote back(boat->services->link_back(boat->services->sessions().begin()->second));
        boat->on.abandon(); // its executor ended under it
        boat.reset();
    } // the session goes, and its places were the boat's
    CHECK(book.modes == std::vector<std::string>{"first"});
    shore->services->stop(100ms);
    shore->scope.stop();
    CHECK(world.run_until([&] { return shore->scope.size() == 0; }));
}

TEST_CASE("64 MiB in flight do not hold up a 64-byte call on the same connection") {
    fixture at;
    auto& link = at.all.world.net().between("boat", "shore");
    link.bandwidth_bytes_per_second = 4 << 20;
    link.latency = 1ms;
    at.boat.provide(echo, [](blob given) {
        given.content.resize(1);
        return given;
    });
    REQUIRE(at.call("first"));
    auto big = start(at.shore.on, try_echo(at.there, 64 << 20, 60s));
    at.all.world.run_for(1s);
    auto begun = at.all.world.now();
    REQUIRE(at.call(std::string(64, 'x')));
    CHECK(at.all.world.now() - begun < 500ms); // virtual time: what was ahead of it in the pipe
    CHECK_FALSE(big->done);
    at.all.run_until([&] { return big->done; });
    REQUIRE(big->get());
    CHECK(big->get()->content.size() == 1);
}

TEST_CASE("a big request that is given up is abandoned, also the first of its service") {
    fixture at;
    at.all.world.net().between("boat", "shore").bandwidth_bytes_per_second = 1 << 20;
    int served = 0;
    at.boat.provide(echo, [&](blob given) {
        ++served;
        given.content.resize(1);
        return given;
    });
    auto big = start(at.shore.on, try_echo(at.there, 16 << 20, 2s));
    auto small = start(at.shore.on, try_echo(at.there, 16, 10s)); // overtakes it
    at.all.run_until([&] { return big->done && small->done; });
    CHECK(big->get().error().code() == errc::timed_out);
    CHECK(small->get());
    at.all.world.run_for(30s);
    CHECK(served == 1);
    CHECK(at.boat.services->counts().sessions_accepted == 1);
    CHECK(at.call("hold"));
}

TEST_CASE("a response that cannot be encoded is the handler's failure, and the session stays") {
    fixture at;
    at.boat.provide(scribe, [](set_mode) { return page{{.ink = false}}; });
    auto ask = [](ise::remote from) -> ise::task<ise::result<page>> {
        set_mode any{"any"};
        auto got = co_await from.try_call(scribe, any, 5s);
        co_return got;
    };
    for (int i = 0; i < 2; ++i) {
        auto got = at.all.run(at.shore, ask(at.there));
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == errc::handler_failed);
        CHECK(got.error().executed() == execution::unknown);
        CHECK_THAT(got.error().message(), Contains("the response of 'scribe' cannot be encoded: no ink"));
        CHECK(at.call("hold"));
    }
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a response beyond what its caller accepts is an error that says so, and the session stays") {
    ise::service_options modest;
    modest.accepts.max_message_bytes = 1 << 20;
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore", modest);
    boat.provide(echo, [](const blob& given) { return blob{std::vector<std::uint8_t>(given.content.size() * 4)}; });
    boat.listen("tcp://0.0.0.0:7400");
    auto there = shore.at("tcp://boat:7400");
    for (int i = 0; i < 2; ++i) {
        auto got = all.run(shore, try_echo(there, 1 << 18)); // with its length it is four bytes too long
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == errc::too_large);
        CHECK(got.error().executed() == execution::unknown); // the handler has run
        CHECK_THAT(
            got.error().message(),
            Contains("the response of 'echo' has 1048580 bytes, its caller accepts 1048576 (max_message_bytes)"));
        CHECK(all.run(shore, try_echo(there, (1 << 18) - 1)));
    }
    CHECK(boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a request beyond what the peer accepts is refused here, and the session stays") {
    ise::service_options modest;
    modest.accepts.max_message_bytes = 1 << 20;
    sim_parties all;
    auto& boat = all.add("boat", modest);
    auto& shore = all.add("shore");
    boat.provide(echo, [](blob given) { return given; });
    boat.listen("tcp://0.0.0.0:7400");
    auto there = shore.at("tcp://boat:7400");
    for (int i = 0; i < 2; ++i) { // before and after there is a session
        auto got = all.run(shore, try_echo(there, 2 << 20));
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == errc::too_large);
        CHECK(got.error().executed() == execution::not_executed);
        CHECK_THAT(got.error().message(), Contains("accepts 1048576 (max_message_bytes)"));
        CHECK(all.run(shore, try_echo(there, 1 << 19)));
    }
    CHECK(boat.services->counts().sessions_accepted == 1);
}

TEST_CASE(
    "a handler's exception with a long text reaches the caller with the beginning of that, and the session stays") {
    ise::service_options modest;
    modest.accepts.max_message_bytes = 100'000;
    sim_parties all;
    auto& boat = all.add("boat");
    auto& shore = all.add("shore", modest);
    boat.provide(helm, [](set_mode) -> mode_set {
        std::string text = "-";
        for (int i = 0; i < 100'000; ++i) text += "é"; // of two bytes
        throw ise::error(errc::refused, text);
    });
    const std::string scheme = GENERATE("tcp", "udp");
    boat.listen(scheme + "://0.0.0.0:7400");
    auto there = shore.at(scheme + "://boat:7400");
    for (int i = 0; i < 2; ++i) {
        auto got = all.run(shore, try_helm(there, "hold"));
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == errc::refused);
        CHECK(got.error().message().ends_with("éé"));
        CHECK(got.error().message().size() > 4'000);
        CHECK(got.error().message().size() < 5'000);
    }
    CHECK(boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a service that is provided later, or anew, is called over the session that missed it") {
    fixture at;
    constexpr ise::request_response<set_mode, mode_set> sails("sails");
    auto set_sails = [&] {
        auto ask = [](ise::remote to, ise::request_response<set_mode, mode_set> what) -> ise::task<outcome> {
            set_mode request{"reef"};
            auto got = co_await to.try_call(what, request, 1s);
            co_return got;
        };
        return at.all.run(at.shore, ask(at.there, sails));
    };
    for (int life = 0; life < 3; ++life) {
        auto before = set_sails();
        REQUIRE_FALSE(before);
        CHECK(before.error().code() == errc::no_such_service);
        CHECK(before.error().executed() == execution::not_executed);
        CHECK_THAT(before.error().message(), Contains("there is no service 'sails'"));
        at.boat.provide(sails, [&](set_mode asked) { return mode_set{true, asked.mode + std::to_string(life)}; });
        auto got = set_sails();
        REQUIRE(got);
        CHECK(got->reason == "reef" + std::to_string(life));
        at.boat.services->services().remove("sails");
    }
    CHECK(at.call("hold")); // the others' numbers are as they were
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a service that is withdrawn is gone for those who called it before") {
    fixture at;
    REQUIRE(at.call("hold"));
    auto waiting = start(at.shore.on, try_helm(at.there, "wait", 60s));
    at.all.run_until([&] { return at.book.begun == 2; });
    at.boat.services->services().remove("helm");
    at.all.run_until([&] { return waiting->done; });
    CHECK(waiting->get().error().code() == errc::cancelled);
    auto after = at.call("hold");
    REQUIRE_FALSE(after);
    CHECK(after.error().code() == errc::no_such_service);
    CHECK(after.error().executed() == execution::not_executed);
}

TEST_CASE("a callback gets the outcome too") {
    fixture at;
    std::optional<outcome> got;
    auto ask = [](ise::remote to, std::optional<outcome>& into) -> ise::task<> {
        to.try_call(helm, set_mode{"hold"}, 5s, [&into](outcome came) { into.emplace(std::move(came)); });
        co_return;
    };
    at.all.run(at.shore, ask(at.there, got));
    at.all.run_until([&] { return got.has_value(); });
    CHECK(got->value().reason == "hold");
}

TEST_CASE("a link that nobody uses any more is forgotten when others follow, one that is used stays the same") {
    fixture at;
    auto& services = *at.shore.services;
    for (int port = 1; port != 10'000; ++port)
        services.link_to(ise::endpoint::parse("tcp://boat:" + std::to_string(port)).value());
    CHECK(services.known_links() < 100);
    CHECK(services.link_to(ise::endpoint::parse("tcp://boat:7400").value()).get() == &at.there.way());
    CHECK(at.call("hold"));
}

TEST_CASE("a remote may be dropped while its calls are on their way, and the last one lets the session go") {
    fixture at;
    std::vector<outcome> got;
    auto ask = [](ise::remote to, std::vector<outcome>& into) -> ise::task<> {
        for (const char* mode : {"hold", "wait", "home"})
            to.try_call(helm, set_mode{mode}, 20s, [&into](outcome came) { into.push_back(std::move(came)); });
        co_return;
    };
    auto way = at.there.way().weak_from_this();
    at.all.run(at.shore, ask(std::exchange(at.there, {}), got));
    CHECK_FALSE(way.expired());
    REQUIRE(at.all.run_until([&] { return got.size() == 2; }));
    CHECK_FALSE(way.expired());
    REQUIRE(at.all.run_until([&] { return got.size() == 3; }));
    CHECK(got[2].value().reason == "wait");
    CHECK(way.expired());
    REQUIRE(at.all.run_until([&] { return at.boat.services->sessions().empty(); }));
}

} // namespace calls_test
