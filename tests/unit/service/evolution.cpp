#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <algorithm>
#include <memory>
#include <string>
#include <variant>
#include <vector>

namespace evolution_test {

using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise_test::Contains;

// One service as three versions of a program declare it.
namespace older {
struct order {
    std::string mode;
};
struct done {
    bool accepted = false;
};
struct report {
    double speed_kn = 0;
};
struct entry {
    std::variant<int, std::string> what;
};
constexpr ise::request_response<order, done> helm("helm");
constexpr ise::subscription<report> log_line("log");
constexpr ise::subscription<entry> entries("entries");
} // namespace older

namespace newer {
struct order {
    std::string mode;
    int urgency = 3;
};
struct done {
    bool accepted = false;
    std::string reason = "none given";
};
struct report {
    double speed_kn = 0;
    double heading_deg = -1;
};
struct entry {
    std::variant<int, std::string, double> what;
};
constexpr ise::request_response<order, done> helm("helm");
constexpr ise::subscription<report> log_line("log");
constexpr ise::subscription<entry> entries("entries");
} // namespace newer

namespace other {
struct order {
    std::int64_t course_deg = 0;
};
struct done {
    bool accepted = false;
};
struct report {
    std::string text;
};
constexpr ise::request_response<order, done> helm("helm");
constexpr ise::subscription<report> log_line("log");
} // namespace other

namespace {

template <class Contract>
ise::task<ise::result<typename Contract::response_type>> ask(ise::remote to, Contract contract,
                                                             typename Contract::request_type request) {
    auto got = co_await to.try_call(contract, request, 5s);
    co_return got;
}

template <class Contract>
ise::task<typename Contract::packet_type> first_of(ise::remote from, Contract contract) {
    auto packets = co_await from.subscribe(contract);
    auto packet = co_await packets.next();
    if (!packet) throw ise::error(packets.cause());
    co_return *packet;
}

struct fixture {
    sim_parties all;
    party& boat = all.add("boat");
    party& shore = all.add("shore");
    ise::remote there = shore.at("tcp://boat:7400");
    fixture() { boat.listen("tcp://0.0.0.0:7400"); }
    template <class T>
    std::shared_ptr<started<T>> finish(ise::task<T> body) {
        auto begun = start(shore.on, std::move(body));
        CHECK(all.run_until([&] { return begun->done; }));
        return begun;
    }
};

} // namespace

TEST_CASE("an older caller and a newer provider understand each other") {
    fixture at;
    int urgency = 0;
    at.boat.provide(newer::helm, [&](newer::order asked) {
        urgency = asked.urgency;
        newer::done answer{asked.mode == "hold", "as you say"};
        return answer;
    });
    for (int i = 0; i < 3; ++i) { // first while schemas are exchanged, then knowing them
        older::order request{"hold"};
        auto got = at.all.run(at.shore, ask(at.there, older::helm, request));
        REQUIRE(got);
        CHECK(got->accepted);
        CHECK(urgency == 3); // its own default
    }
}

TEST_CASE("a newer caller and an older provider understand each other") {
    fixture at;
    std::string mode;
    at.boat.provide(older::helm, [&](older::order asked) {
        mode = asked.mode;
        return older::done{true};
    });
    for (int i = 0; i < 3; ++i) {
        newer::order request{"hold", 9};
        auto got = at.all.run(at.shore, ask(at.there, newer::helm, request));
        REQUIRE(got);
        CHECK(got->accepted);
        CHECK(got->reason == "none given");
        CHECK(mode == "hold");
    }
}

TEST_CASE("calls made at once while the schemas are on their way are all served") {
    fixture at;
    at.boat.provide(newer::helm, [&](newer::order asked) -> ise::task<newer::done> {
        newer::done answer{true, asked.mode};
        co_return answer;
    });
    std::vector<std::shared_ptr<started<ise::result<older::done>>>> calls;
    for (int i = 0; i < 20; ++i) calls.push_back(start(at.shore.on, ask(at.there, older::helm, older::order{"hold"})));
    calls[7]->cancel.emit(asio::cancellation_type::terminal);
    at.all.run_until([&] { return std::all_of(calls.begin(), calls.end(), [](auto& one) { return one->done; }); });
    for (std::size_t i = 0; i < calls.size(); ++i) {
        INFO(i);
        if (i != 7) CHECK((!calls[i]->thrown && calls[i]->get()));
    }
}

TEST_CASE("a request, a reply and a request to subscribe wait for the schemas however large they are, if alone") {
    ise::service_options options;
    options.session_bytes = 40'000;
    sim_parties all;
    party& boat = all.add("boat", options);
    party& shore = all.add("shore", options);
    boat.listen("tcp://0.0.0.0:7400");
    boat.provide(newer::helm, [&](newer::order asked) {
        newer::done answer{true, asked.mode};
        return answer;
    });
    newer::order request{std::string(100'000, 'x'), 9};
    SECTION("older caller") {
        auto got = all.run(shore, ask(shore.at("tcp://boat:7400"), older::helm, older::order{request.mode}));
        REQUIRE(got);
        CHECK(got->accepted);
    }
    SECTION("caller of this version") {
        auto got = all.run(shore, ask(shore.at("tcp://boat:7400"), newer::helm, request));
        REQUIRE(got);
        CHECK(got->reason == request.mode);
    }
    SECTION("older subscriber") {
        std::size_t asked_for = 0;
        ise::subscription<newer::report, newer::order> published("watched");
        ise::publication_callbacks<decltype(published)> callbacks;
        callbacks.on_subscribe = [&](const newer::order& asked, const ise::subscriber_info&) {
            asked_for = asked.mode.size();
            return ise::nothing{};
        };
        auto out = boat.publish(published, callbacks);
        out(newer::report{4.5, 90});
        auto read = [](ise::remote from, older::order asked) -> ise::task<double> {
            ise::subscription<older::report, older::order> watched("watched");
            auto packets = co_await from.subscribe(watched, asked, ise::subscribe_options::lossless(8));
            auto packet = co_await packets.next();
            if (!packet) throw ise::error(packets.cause());
            co_return packet->speed_kn;
        };
        auto reading = read(shore.at("tcp://boat:7400"), older::order{request.mode});
        CHECK(all.run(shore, std::move(reading)) == 4.5);
        CHECK(asked_for == request.mode.size());
    }
}

TEST_CASE("packets that differ incompatibly are refused with a diff, on both sides") {
    fixture at;
    int served = 0;
    at.boat.provide(other::helm, [&](other::order) {
        ++served;
        return other::done{};
    });
    for (int i = 0; i < 2; ++i) {
        auto got = at.all.run(at.shore, ask(at.there, older::helm, older::order{"hold"}));
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == errc::type_mismatch);
        CHECK(got.error().executed() == ise::execution::not_executed);
        CHECK_THAT(got.error().message(), Contains("request") && Contains("mode") && Contains("course_deg"));
    }
    CHECK(served == 0);
    REQUIRE(at.boat.warnings.size() == 1);
    CHECK_THAT(at.boat.warnings[0], Contains("course_deg"));
}

TEST_CASE("subscriptions follow the same rules") {
    fixture at;
    SECTION("older subscriber") {
        auto out = at.boat.publish(newer::log_line);
        out(newer::report{4.5, 90});
        CHECK(at.finish(first_of(at.there, older::log_line))->get().speed_kn == 4.5);
    }
    SECTION("newer subscriber") {
        auto out = at.boat.publish(older::log_line);
        out(older::report{4.5});
        auto got = at.finish(first_of(at.there, newer::log_line));
        CHECK(got->get().speed_kn == 4.5);
        CHECK(got->get().heading_deg == -1);
    }
    SECTION("incompatible") {
        auto out = at.boat.publish(other::log_line);
        auto got = at.finish(first_of(at.there, older::log_line));
        CHECK(got->code() == errc::type_mismatch);
        CHECK_THROWS_WITH(got->get(), Contains("published packet") && Contains("text"));
        CHECK(at.boat.warnings.size() == 1);
    }
    SECTION("a subscriber that leaves while the schemas are on their way") {
        auto out = at.boat.publish(newer::log_line);
        at.all.world.net().between("boat", "shore").latency = 1s;
        auto leaving = start(at.shore.on, first_of(at.there, older::log_line));
        at.all.world.run_for(6s);
        leaving->cancel.emit(asio::cancellation_type::terminal);
        at.all.world.run_for(20s);
        CHECK(leaving->done);
        CHECK(out.subscribers() == 0);
    }
}

TEST_CASE("a service that is withdrawn and provided anew loses no subscription on its way, also while schemas are "
          "asked for") {
    auto moment = GENERATE(range(0, 1000, 20));
    INFO(moment << " ms");
    fixture at;
    auto out = at.boat.publish(newer::log_line);
    at.all.world.net().between("boat", "shore").latency = 100ms;
    auto waiting = start(at.shore.on, first_of(at.there, older::log_line));
    at.all.world.run_for(std::chrono::milliseconds(moment));
    at.boat.services->services().remove("log");
    auto next = at.boat.publish(newer::log_line);
    at.all.world.run_for(3s);
    if (waiting->done) {
        CHECK_THROWS_WITH(waiting->get(), Contains("not published any more"));
    } else {
        CHECK(next.subscribers() == 1);
        next(newer::report{3, 90});
        at.all.world.run_for(3s);
        REQUIRE(waiting->done);
        CHECK(waiting->get().speed_kn == 3);
    }
}

TEST_CASE("a subscription between two versions resumes after a cut, and keeps the response of its first session") {
    fixture at;
    ise::subscription<older::report, ise::nothing, older::done> watched("watched");
    ise::subscription<newer::report, ise::nothing, newer::done> published("watched");
    ise::publication_callbacks<decltype(published)> callbacks;
    callbacks.on_subscribe = [](const ise::nothing&, const ise::subscriber_info&) {
        return newer::done{true, "welcome"};
    };
    auto out = at.boat.publish(published, callbacks);
    out(newer::report{1, 90});
    auto read = [](ise::remote from, decltype(watched) what, std::vector<double>& speeds) -> ise::task<std::uint64_t> {
        auto packets = co_await from.subscribe(what);
        while (speeds.size() < 2) {
            auto packet = co_await packets.next();
            if (!packet) throw ise::error(packets.cause());
            speeds.push_back(packet->speed_kn);
        }
        CHECK(packets.response().accepted);
        co_return packets.counts().resumed;
    };
    std::vector<double> speeds;
    auto reading = start(at.shore.on, read(at.there, watched, speeds));
    at.all.run_until([&] { return speeds.size() == 1; });
    at.all.world.net().partition("boat", "shore");
    at.all.world.run_for(10s);
    out(newer::report{2, 90});
    at.all.world.net().heal_all();
    at.all.run_until([&] { return reading->done; });
    CHECK(reading->get() == 1);
    CHECK(speeds == std::vector<double>{1, 2});
}

TEST_CASE("a lossless subscriber of an older version leaves out the alternatives that it does not know, and its "
          "publisher goes on") {
    fixture at;
    auto out = at.boat.publish(newer::entries);
    struct account {
        std::vector<int> numbers;
        std::uint64_t lost = 0;
        ise::subscription_counts counts;
        bool ended = false;
    };
    account got;
    auto read = [](ise::remote from, account& into) -> ise::task<> {
        auto packets = co_await from.subscribe(older::entries, ise::subscribe_options::lossless(8));
        for (;;) {
            auto packet = co_await packets.next();
            into.counts = packets.counts();
            if (!packet) break;
            into.numbers.push_back(std::get<int>(packet->what));
            into.lost += packet.lost_before().value();
        }
        into.ended = true;
    };
    auto send = [](ise::publication<ise::subscription<newer::entry>> to, int& sent) -> ise::task<> {
        for (; sent < 100; ++sent) {
            newer::entry next{sent};
            if (sent % 3 != 0) next.what = 1.5;
            co_await to.send(next);
        }
    };
    auto reading = start(at.shore.on, read(at.there, got));
    REQUIRE(at.all.run_until([&] { return out.subscribers() == 1; }));
    int sent = 0;
    auto sending = start(at.boat.on, send(out, sent));
    at.all.world.run_for(20s);
    CHECK(sent == 100);
    CHECK(sending->done);
    CHECK(got.numbers.size() == 34);
    CHECK(got.numbers.back() == 99);
    CHECK(got.lost == 66);
    CHECK(got.counts.undecodable == 66);
    CHECK_FALSE(got.ended);
}

TEST_CASE("a service that is provided anew with other packets is called over the same session") {
    fixture at;
    at.boat.listen("udp://0.0.0.0:7400");
    const std::string where = GENERATE("tcp://boat:7400", "udp://boat:7400");
    INFO(where);
    auto there = at.shore.at(where);
    const auto latency = GENERATE(1ms, 200ms);
    at.all.world.net().between("boat", "shore").latency = latency;
    auto provide_older = [&] {
        at.boat.provide(older::helm, [](older::order asked) { return older::done{asked.mode == "hold"}; });
    };
    auto provide_newer = [&] {
        at.boat.provide(newer::helm, [](newer::order asked) {
            newer::done answer{asked.mode == "hold", std::to_string(asked.urgency)};
            return answer;
        });
    };
    auto provide_other = [&] { at.boat.provide(other::helm, [](other::order) { return other::done{true}; }); };
    auto call = [&]() -> std::string {
        newer::order request{"hold", 9};
        auto got = at.all.run(at.shore, ask(there, newer::helm, request));
        if (!got) return std::string(ise::name_of(got.error().code()));
        CHECK(got->accepted);
        return got->reason;
    };
    CHECK(call() == "no_such_service");
    for (int i = 0; i < 2; ++i) {
        provide_other();
        CHECK(call() == "type_mismatch");
        at.boat.services->services().remove("helm");
        CHECK(call() == "no_such_service");
        provide_older();
        CHECK(call() == "none given");
        CHECK(call() == "none given");
        at.boat.services->services().remove("helm");
        provide_newer();
        CHECK(call() == "9");
        at.boat.services->services().remove("helm");
        provide_older();
        CHECK(call() == "none given");
        at.boat.services->services().remove("helm");
        CHECK(call() == "no_such_service");
    }
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

TEST_CASE("a service that is provided anew with other packets at any moment leaves the session whole") {
    auto moment = GENERATE(range(0, 1000, 20));
    INFO(moment << " ms");
    fixture at;
    at.all.world.net().between("boat", "shore").latency = 100ms;
    at.boat.provide(newer::helm, [](newer::order) { return newer::done{true, "newer"}; });
    older::order request{"hold"};
    std::vector<std::shared_ptr<started<ise::result<older::done>>>> calls;
    for (int i = 0; i < 10; ++i) {
        calls.push_back(start(at.shore.on, ask(at.there, older::helm, request)));
        at.all.world.run_for(std::chrono::milliseconds(moment / 10));
    }
    at.boat.services->services().remove("helm");
    at.boat.provide(older::helm, [](older::order) { return older::done{true}; });
    for (int i = 0; i < 10; ++i) {
        calls.push_back(start(at.shore.on, ask(at.there, older::helm, request)));
        at.all.world.run_for(20ms);
    }
    REQUIRE(at.all.run_until([&] { return std::ranges::all_of(calls, [](const auto& one) { return one->done; }); }));
    for (const auto& one : calls) {
        if (one->get()) CHECK(one->get()->accepted);
        else CHECK(one->get().error().code() != errc::malformed);
    }
    CHECK(calls.back()->get());
    CHECK(at.boat.services->counts().sessions_accepted == 1);
}

} // namespace evolution_test
