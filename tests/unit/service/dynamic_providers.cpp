// Services that are provided without their headers, called and subscribed to with and without.
#include <ise/core/error.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/service/dynamic_provider.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <memory>
#include <string>
#include <vector>

namespace dynamic_providers_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::dynamic_contract;
using ise::dynamic_packet;
using ise::errc;
using ise_test::Contains;

namespace {

// As a later version of the service has them.
struct set_mode_2 {
    std::string mode;
    int urgency = 5;
};
struct mode_set_2 {
    bool accepted = false;
    std::string reason;
    std::vector<int> steps;
};
constexpr ise::request_response<set_mode_2, mode_set_2> helm_2{"helm"};
// And as another service that is called the same.
struct angle {
    double degrees = 0;
};
constexpr ise::request_response<angle, angle> other_helm{"helm"};
struct later_fix {
    double latitude_deg = 0, longitude_deg = 0;
    float speed_kn = 0;
    std::string of;
};
struct watch_area {
    std::string name;
};
struct watch_answer {
    std::string text;
};
constexpr ise::subscription<fix, watch_area, watch_answer, watch_area, watch_answer> watched{"watched"};

struct tale {
    std::string text;
};
constexpr ise::subscription<tale> tales{"tales"};

dynamic_contract as_dynamic(const auto& service) {
    std::vector<std::string> texts;
    for (const auto& packet : service.types().schemas) texts.push_back(packet.text());
    return dynamic_contract::parse(std::string(service.name()), service.types().kind, texts).value();
}

struct fixture {
    sim_parties all;
    party& boat = all.add("boat");
    party& shore = all.add("shore");
    ise::remote there;

    fixture() {
        boat.listen("tcp://0.0.0.0:7400");
        there = shore.at("tcp://boat:7400");
    }
    template <class Handler>
    void provide(const dynamic_contract& service, Handler handler, ise::serve_options options = ise::serve_options()) {
        boat.services->services()
            .add(ise::detail::make_any_dynamic_service(*boat.services, service, std::move(handler), options))
            .value();
    }
    ise::dynamic_publication publish(const dynamic_contract& service,
                                     ise::dynamic_callbacks callbacks = ise::dynamic_callbacks()) {
        auto core = ise::make_dynamic_publication(*boat.services, service, std::move(callbacks));
        boat.services->services().add(core).value();
        return {core, service.packet(ise::role::published)};
    }
};

template <class Contract>
ise::task<ise::result<typename Contract::response_type>> call(ise::remote to, Contract service,
                                                              typename Contract::request_type request) {
    auto got = co_await to.try_call(service, request, 5s);
    co_return got;
}

dynamic_packet answer(const ise::schema& type, const std::string& json) {
    return dynamic_packet::from_json(type, json);
}

} // namespace

TEST_CASE("a dynamic handler answers typed callers, as a coroutine and as a function") {
    fixture at;
    auto service = as_dynamic(helm);
    const auto& type = service.packet(ise::role::response);
    SECTION("coroutine") {
        at.provide(service, [&](dynamic_packet asked) -> ise::task<dynamic_packet> {
            co_await ise::sleep_for(at.boat.on, 10ms);
            co_return answer(type, R"({"accepted":true,"reason":"now )" + asked.field("mode").as_string() + "\"}");
        });
    }
    SECTION("coroutine with its context") {
        at.provide(service, [&](dynamic_packet asked, const ise::call_context& of) -> ise::task<dynamic_packet> {
            CHECK(of.service == "helm");
            co_return answer(type, R"({"accepted":true,"reason":"now )" + asked.field("mode").as_string() + "\"}");
        });
    }
    SECTION("function") {
        at.provide(service, [&](dynamic_packet asked) {
            return answer(type, R"({"accepted":true,"reason":"now )" + asked.field("mode").as_string() + "\"}");
        });
    }
    SECTION("function with its context") {
        at.provide(service, [&](dynamic_packet asked, const ise::call_context& of) -> ise::result<dynamic_packet> {
            CHECK(of.caller.starts_with("shore"));
            return answer(type, R"({"accepted":true,"reason":"now )" + asked.field("mode").as_string() + "\"}");
        });
    }
    for (const char* mode : {"hold", "sail"}) { // the second by a worker that served before
        auto got = at.all.run(at.shore, call(at.there, helm, set_mode{mode}));
        REQUIRE(got);
        CHECK(got->accepted);
        CHECK(got->reason == std::string("now ") + mode);
    }
}

TEST_CASE("both sides of a call may be dynamic, and of other versions of its packets") {
    fixture at;
    auto service = as_dynamic(helm);
    // The handler answers in the layout of a later version: it is adapted.
    at.provide(service, [](dynamic_packet asked) {
        CHECK(asked.type().fingerprint() == ise::schema_of<set_mode>().fingerprint());
        mode_set_2 response{true, "it was " + asked.as<set_mode>().mode, {1, 2}};
        return ise::to_dynamic(response);
    });
    auto later = as_dynamic(helm_2);
    auto got = at.all.run(at.shore, ise::call_dynamic(at.there, later, ise::to_dynamic(set_mode_2{"hold", 9}), 5s));
    REQUIRE(got);
    CHECK(got->as<mode_set_2>().reason == "it was hold");
    CHECK(got->as<mode_set_2>().steps.empty());
    auto typed = at.all.run(at.shore, call(at.there, helm_2, set_mode_2{"sail", 1}));
    REQUIRE(typed);
    CHECK(typed->reason == "it was sail");
    auto wrong = at.all.run(at.shore, call(at.there, other_helm, angle{1}));
    REQUIRE_FALSE(wrong);
    CHECK(wrong.error().code() == errc::type_mismatch);
}

TEST_CASE("what a dynamic handler throws reaches the caller as what a typed one throws") {
    fixture at;
    at.provide(as_dynamic(helm), [&](dynamic_packet asked) -> ise::task<dynamic_packet> {
        auto mode = asked.field("mode").as_string();
        if (mode == "refuse") throw ise::error(errc::refused, "boats sail");
        if (mode == "fail") throw std::runtime_error("the rudder is gone");
        if (mode == "unfit") co_return ise::to_dynamic(angle{3});
        co_await ise::sleep_for(at.boat.on, 1h);
        co_return asked;
    });
    auto outcome = [&](const char* mode) {
        auto got = at.all.run(at.shore, call(at.there, helm, set_mode{mode}));
        REQUIRE_FALSE(got);
        return got.error();
    };
    CHECK(outcome("refuse").code() == errc::refused);
    auto failed = outcome("fail");
    CHECK(failed.code() == errc::handler_failed);
    CHECK_THAT(failed.message(), Contains("the rudder is gone"));
    auto unfit = outcome("unfit");
    CHECK(unfit.code() == errc::handler_failed);
    CHECK_THAT(unfit.message(), Contains("the response of 'helm' does not fit"));
    CHECK(unfit.executed() == ise::execution::unknown);
    CHECK(outcome("last").code() == errc::timed_out); // and the handler was cancelled, or the world would not end
}

TEST_CASE("a plain dynamic handler that returns a failure keeps its code, and one that does not fit is told") {
    fixture at;
    at.provide(as_dynamic(helm), [](dynamic_packet asked) -> ise::result<dynamic_packet> {
        if (asked.field("mode").as_string() == "unfit") return ise::to_dynamic(angle{3});
        return ise::failure(errc::refused, "not today");
    });
    auto refused = at.all.run(at.shore, call(at.there, helm, set_mode{"x"}));
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == errc::refused);
    auto unfit = at.all.run(at.shore, call(at.there, helm, set_mode{"unfit"}));
    REQUIRE_FALSE(unfit);
    CHECK(unfit.error().code() == errc::handler_failed);
}

TEST_CASE("a contract of the wrong kind, or that cannot be read, is refused") {
    fixture at;
    auto calls = as_dynamic(helm);
    auto packets = as_dynamic(position);
    CHECK_THROWS_WITH(ise::make_dynamic_publication(*at.boat.services, calls), Contains("provide it"));
    ise::dynamic_function nothing = [](dynamic_packet asked, const ise::call_context&) { return asked; };
    CHECK_THROWS_WITH(ise::make_dynamic_service(*at.boat.services, packets, nothing), Contains("publish it"));
    auto few = dynamic_contract::parse("helm", ise::service_kind::subscription, {"struct{}"});
    REQUIRE_FALSE(few);
    CHECK(few.error().code() == errc::invalid_argument);
    auto unreadable = dynamic_contract::parse("helm", ise::service_kind::request_response, {"struct{}", "strukt"});
    REQUIRE_FALSE(unreadable);
    CHECK_THAT(unreadable.error().message(), Contains("the response of 'helm' is not described readably"));
    CHECK(dynamic_contract::of(helm).types()->fingerprints == calls.types()->fingerprints);
    ise::dynamic_publication empty;
    CHECK_FALSE(empty);
    CHECK_THROWS_WITH(empty(ise::to_dynamic(fix{})), Contains("an empty publication"));
}

namespace {

ise::task<std::vector<double>> latitudes(ise::remote from, std::size_t count) {
    std::vector<double> got;
    auto fixes = co_await from.subscribe(position, ise::subscribe_options::keep_last(100));
    while (got.size() < count) {
        auto packet = co_await fixes.next();
        if (!packet) break;
        got.push_back(packet->latitude_deg);
    }
    co_return got;
}

ise::task<> send_all(ise::dynamic_publication out, int count) {
    for (int i = 1; i <= count; ++i) {
        auto packet = ise::to_dynamic(fix{double(i), 0, 0});
        co_await out.send(packet);
    }
}

ise::task<std::vector<double>> all_lossless(ise::remote from, std::size_t count) {
    std::vector<double> got;
    auto fixes = co_await from.subscribe(position, ise::subscribe_options::lossless(4));
    while (got.size() < count) {
        auto packet = co_await fixes.next();
        if (!packet) break;
        got.push_back(packet->latitude_deg);
    }
    co_return got;
}

} // namespace

TEST_CASE("a dynamic publication reaches typed subscribers, and packets of another version are adapted") {
    fixture at;
    auto out = at.publish(as_dynamic(position));
    CHECK(out.type().fingerprint() == ise::schema_of<fix>().fingerprint());
    auto got = start(at.shore.on, latitudes(at.there, 3));
    at.all.run_until([&] { return out.subscribers() == 1; });
    out(ise::to_dynamic(fix{1, 0, 0}));
    out(dynamic_packet::from_json(out.type(), R"({"latitude_deg":2})"));
    out(ise::to_dynamic(later_fix{3, 0, 0, "a later version"}));
    CHECK_THROWS_AS(out(ise::to_dynamic(angle{4})), ise::error);
    at.all.run_until([&] { return got->done; });
    CHECK(got->get() == std::vector<double>{1, 2, 3});
    CHECK(out.published() == 3);
}

TEST_CASE("a packet that is larger than a subscriber accepts is left out and counted, also in the middle of a burst") {
    ise::service_options little;
    little.accepts.max_message_bytes = 6000;
    fixture at;
    auto& strict = at.all.add("strict", little);
    auto out = at.publish(as_dynamic(tales));
    auto told = [&](std::size_t length) { return ise::to_dynamic(tale{std::string(length, 'x')}); };
    auto got =
        at.all.run(strict, strict.at("tcp://boat:7400").subscribe(tales, ise::subscribe_options::keep_last(200)));
    {
        ise::loop::turn in(at.boat.on);
        for (int i = 0; i < 60; ++i) out(told(100));
        out(told(8000));
        for (int i = 0; i < 60; ++i) out(told(100));
    }
    at.all.world.run_for(1s);
    std::size_t packets = 0;
    std::uint64_t lost = 0;
    while (auto packet = got.try_next()) {
        CHECK(packet->text.size() == 100);
        lost += packet.lost_before().value();
        ++packets;
    }
    CHECK(packets == 120);
    CHECK(lost == 1);
}

TEST_CASE("a dynamic publication waits for lossless subscribers, and publishes for some") {
    fixture at;
    auto out = at.publish(as_dynamic(position));
    auto got = start(at.shore.on, all_lossless(at.there, 101));
    at.all.run_until([&] { return out.subscribers() == 1; });
    auto sent = start(at.boat.on, send_all(out, 100));
    at.all.run_until([&] { return sent->done && out.try_send(ise::to_dynamic(fix{101, 0, 0})); });
    at.all.run_until([&] { return got->done; });
    REQUIRE(got->get().size() == 101);
    CHECK(got->get().back() == 101);
    std::vector<std::string> asked;
    out.publish_if(ise::to_dynamic(fix{102, 0, 0}), [&](const ise::subscriber_info& who) {
        asked.push_back(who.peer);
        return false;
    });
    CHECK(out.published() == 102);
}

namespace {

ise::task<std::string> watch_and_leave(ise::remote from) {
    watch_area area{"bay"};
    ise::subscribe_options options;
    auto stream = co_await from.subscribe(watched, area, options);
    auto result = stream.response().text;
    watch_area last{"harbour"};
    auto answer = co_await stream.unsubscribe(last, 5s);
    co_return result + ", " + answer.text;
}

} // namespace

TEST_CASE("the callbacks of a dynamic publication accept, refuse and part") {
    fixture at;
    auto service = as_dynamic(watched);
    bool open = true;
    ise::dynamic_callbacks callbacks;
    callbacks.on_subscribe = [&](const dynamic_packet& asked,
                                 const ise::subscriber_info& who) -> ise::result<dynamic_packet> {
        if (!open) return ise::failure(errc::refused, "the bay is closed");
        CHECK(who.peer.starts_with("shore"));
        return ise::to_dynamic(watch_answer{"watches " + asked.field("name").as_string()});
    };
    callbacks.on_unsubscribe = [](const dynamic_packet& asked, const ise::subscriber_info&) {
        return ise::to_dynamic(watch_answer{"off to the " + asked.field("name").as_string()});
    };
    auto out = at.publish(service, std::move(callbacks));
    CHECK(at.all.run(at.shore, watch_and_leave(at.there)) == "watches bay, off to the harbour");
    open = false;
    CHECK_THROWS_WITH(at.all.run(at.shore, watch_and_leave(at.there)), Contains("the bay is closed"));
    CHECK(out.subscribers() == 0);
}

} // namespace dynamic_providers_test
