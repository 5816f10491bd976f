// Sessions under an access policy, on the virtual world: who is verified, what is refused, and what an edit changes.
#include <ise/access/guard.hpp>
#include <ise/core/sleep.hpp>
#include <ise/service/action.hpp>
#include <ise/service/action_run.hpp>
#include <ise/service/action_runs.hpp>
#include <ise/transport/security.hpp>
#include <support/authority.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

namespace access_sessions_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise_test::Contains;

namespace {

authority& trusted() {
    static authority made("the trusted one");
    return made;
}

std::filesystem::path certificate_of(const std::string& name, const std::string& identities) {
    return trusted().issue(name, identities + authority::everywhere);
}

const std::filesystem::path& boat_files() {
    static auto folder = certificate_of("boat", "URI:ise://atirma/boat,");
    return folder;
}
const std::filesystem::path& web_files() {
    static auto folder = certificate_of("web", "URI:ise://atirma/web,");
    return folder;
}

// The boat is called by the shore over TLS, under a policy that both have.
struct sea {
    ise::sim::world world;
    std::vector<std::string> audit;
    std::unique_ptr<party> boat, shore;
    ise::remote there;
    std::string who_called, serial, who_subscribed;

    static constexpr const char* open = R"(version = 1
[[allow]]
who = "ise://atirma/boat"
name = "boat"
[[allow]]
who = "ise://atirma/web"
name = "shore"
call = "boat:helm"
subscribe = "boat:position"
)";

    ~sea() {
        for (auto* one : {boat.get(), shore.get()}) {
            if (!one) continue;
            if (!one->scope.stopping()) one->services->stop(100ms);
            one->scope.stop();
        }
        world.run_until([&] { return (!boat || boat->scope.size() == 0) && (!shore || shore->scope.size() == 0); });
    }
    void write(const std::string& host, const std::string& policy) {
        world.host(host).write_file("access.toml", policy);
    }
    std::unique_ptr<party> sail(const std::string& host, const std::filesystem::path& files,
                                const std::string& policy) {
        auto& to = world.host(host);
        for (const char* file : {"ca.pem", "certificate.pem", "key.pem"})
            to.write_file(std::string("tls/") + file, read_all(files / file));
        ise::security_options with;
        with.tls_folder = "tls";
        auto& process = to.start_process(host);
        auto credentials = ise::security::load(process, with).value();
        if (!policy.empty()) {
            write(host, policy);
            ise::access::audit_log log([this](const std::string& line) { audit.push_back(line); });
            credentials.access = ise::access::guard::load(process, "access.toml", log).value();
        }
        auto made =
            std::make_unique<party>(process, process.make_loop("main"), host, ise::service_options(), credentials);
        made->services->follow_access();
        return made;
    }
    void begin(const std::string& policy = open, const std::filesystem::path& shore_files = web_files(),
               const std::string& policy_ashore = open) {
        boat = sail("boat", boat_files(), policy);
        shore = sail("shore", shore_files, policy_ashore);
        boat->provide(helm, [this](set_mode asked, const ise::call_context& by) {
            who_called = by.who;
            serial = by.verified->serial;
            return mode_set{true, asked.mode};
        });
        boat->provide(echo, [](blob given) { return given; });
        ise::publication_callbacks<std::remove_const_t<decltype(position)>> callbacks;
        callbacks.on_subscribe = [this](const auto&, const ise::subscriber_info& by) -> ise::result<ise::nothing> {
            who_subscribed = by.who;
            return ise::nothing();
        };
        fixes = boat->publish(position, std::move(callbacks));
        boat->listen("tls://0.0.0.0:7400");
        there = shore->at("tls://boat:7400");
    }

    template <class T>
    T run(ise::task<T> body) {
        auto state = start(shore->on, std::move(body));
        if (!world.run_until([&] { return state->done; })) throw std::logic_error("it did not end within an hour");
        return std::move(state->get());
    }
    template <class Contract, class Request>
    static ise::task<ise::result<typename Contract::response_type>> ask(ise::remote at, Contract service,
                                                                        Request request) {
        auto got = co_await at.try_call(service, request, 10s);
        co_return got;
    }
    ise::result<mode_set> steer() { return run(ask(there, helm, set_mode{"hold"})); }
    ise::result<blob> echoed() { return run(ask(there, echo, blob())); }
    std::size_t lines(const std::string& with) const {
        return static_cast<std::size_t>(
            std::ranges::count_if(audit, [&](const auto& line) { return line.find(with) != line.npos; }));
    }

    ise::publication<std::remove_const_t<decltype(position)>> fixes;
};

} // namespace

TEST_CASE("access: who calls is verified by the certificate, and reaches handlers") {
    sea at;
    at.begin();
    auto got = at.steer();
    INFO((got ? std::string() : got.error().message()));
    REQUIRE(got);
    CHECK(at.who_called == "ise://atirma/web");
    CHECK_FALSE(at.serial.empty());
    CHECK(at.boat->services->sessions().begin()->second->verified().who == "ise://atirma/web");
    CHECK(at.shore->services->sessions().begin()->second->verified().who == "ise://atirma/boat");
}

TEST_CASE("access: without a policy everything is allowed, and who calls is known all the same") {
    sea at;
    at.begin("", web_files(), "");
    REQUIRE(at.steer());
    REQUIRE(at.echoed());
    CHECK(at.who_called == "ise://atirma/web");
}

TEST_CASE("access: what no rule allows is refused with who, what and why, and not executed") {
    sea at;
    at.begin();
    auto got = at.echoed();
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::access_denied);
    CHECK(got.error().executed() == ise::execution::not_executed);
    CHECK_THAT(
        got.error().message(),
        Contains("ise://atirma/web may not call 'echo' of boat: no rule of access.toml allows it (ise access why "
                 "ise://atirma/web call boat:echo)"));
    REQUIRE(at.lines("\"call boat:echo\"") == 1);
    CHECK(at.lines(R"("who":"ise://atirma/web")") >= 1);
    CHECK(at.steer());
    SECTION("nor is it told whether a service is there") {
        constexpr ise::request_response<blob, blob> none{"none"};
        auto missing = at.run(sea::ask(at.there, none, blob()));
        REQUIRE_FALSE(missing);
        CHECK(missing.error().code() == errc::access_denied);
    }
    SECTION("each refused call is a line of the audit log") {
        (void)at.echoed();
        (void)at.echoed();
        CHECK(at.lines("\"call boat:echo\"") == 3);
    }
}

TEST_CASE("access: a subscription that no rule allows is refused, others know who subscribed") {
    auto subscribe = [](ise::remote to, const auto& service) -> ise::task<std::string> {
        std::string why;
        try {
            auto packets = co_await to.subscribe(service);
        } catch (const ise::error& refused) {
            why = fmt::format("{}: {}", ise::name_of(refused.code()), refused.what());
        }
        co_return why;
    };
    sea at;
    at.begin();
    at.boat->publish(pictures);
    auto why = at.run(subscribe(at.there, pictures));
    CHECK_THAT(why, Contains("access_denied") && Contains("may not subscribe to 'pictures' of boat"));
    CHECK(at.run(subscribe(at.there, position)).empty());
    CHECK(at.who_subscribed == "ise://atirma/web");
}

TEST_CASE("access: a subscriber that its own acceptance denies is refused, and its provider hears that it left") {
    sea at;
    at.begin(R"(version = 1
[[allow]]
who = "ise://atirma/web"
name = "shore"
subscribe = "boat:pictures"
[[deny]]
who = "**"
subscribe = "flagship:*"
)");
    int left = 0;
    ise::publication_callbacks<std::remove_const_t<decltype(pictures)>> callbacks;
    callbacks.on_subscribe = [&](const auto&, const ise::subscriber_info&) -> ise::result<ise::nothing> {
        at.boat->services->serve_as({"flagship"});
        return ise::nothing();
    };
    callbacks.on_unsubscribe = [&](const auto&, const ise::subscriber_info&) {
        ++left;
        return ise::nothing();
    };
    auto shown = at.boat->publish(pictures, std::move(callbacks));
    auto subscribe = [](ise::remote to) -> ise::task<int> {
        auto packets = co_await to.subscribe(pictures);
        co_return 0;
    };
    auto subscribing = start(at.shore->on, subscribe(at.there));
    REQUIRE(at.world.run_until([&] { return subscribing->done; }, 1min));
    CHECK(subscribing->code() == errc::access_denied);
    CHECK(shown.subscribers() == 0);
    CHECK(left == 1);
}

TEST_CASE("access: nobody has a path that his identity may not have, in either direction") {
    sea at;
    std::string policy = sea::open;
    SECTION("an impostor asks") {
        auto other = policy;
        other.replace(other.find("name = \"shore\""), 14, "name = \"other\"");
        at.begin(other, web_files(), "");
        auto got = at.steer();
        REQUIRE_FALSE(got);
        CHECK_THAT(got.error().message(), Contains("ise://atirma/web may not have the name shore"));
        CHECK(at.lines("\"name shore\"") >= 1);
    }
    SECTION("an impostor serves") {
        auto other = policy;
        other.replace(other.find("name = \"boat\""), 13, "name = \"keel\"");
        at.begin("", web_files(), other);
        auto got = at.steer();
        REQUIRE_FALSE(got);
        CHECK_THAT(got.error().message(), Contains("ise://atirma/boat may not have the name boat"));
        CHECK(at.who_called.empty());
    }
}

TEST_CASE("access: a certificate with several identities is refused, one without is nobody's") {
    sea at;
    SECTION("several") {
        auto files = certificate_of("several", "URI:ise://atirma/web,URI:ise://atirma/boat,");
        CHECK_THROWS_WITH(at.begin(sea::open, files, ""),
                          Contains("certificate.pem cannot be used: its certificate has 2 URIs"));
    }
    SECTION("none") {
        at.begin(sea::open, certificate_of("none", ""), "");
        auto got = at.steer();
        REQUIRE_FALSE(got);
        CHECK_THAT(got.error().message(), Contains("nobody may not have the name shore"));
    }
}

TEST_CASE("access: an edit counts within ten seconds for sessions that exist") {
    const std::string only_echo = R"(version = 1
[[allow]]
who = "ise://atirma/web"
name = "shore"
call = "boat:echo"
)";
    auto follow = [](ise::remote to, std::shared_ptr<std::string> end) -> ise::task<int> {
        auto packets = co_await to.subscribe(position);
        try {
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
            }
        } catch (const ise::error& why) {
            *end = why.what();
        }
        if (end->empty()) *end = "it ended";
        co_return 0;
    };
    sea at;
    at.begin();
    REQUIRE(at.steer());
    REQUIRE_FALSE(at.echoed());
    auto ended = std::make_shared<std::string>();
    auto following = start(at.shore->on, follow(at.there, ended));
    at.world.run_for(1s);
    REQUIRE(at.boat->services->counts().sessions_accepted == 1);
    SECTION("what is denied now is refused, and subscriptions end") {
        at.write("boat", only_echo);
        at.world.run_for(10s);
        auto got = at.steer();
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == errc::access_denied);
        CHECK(at.echoed()); // and what was denied may be allowed
        CHECK_FALSE(ended->empty());
        CHECK(at.boat->services->counts().sessions_accepted == 1);
    }
    SECTION("what was denied, is allowed, and was not provided meanwhile, is called once it is") {
        at.boat->services->services().remove("echo");
        CHECK(at.echoed().error().code() == errc::access_denied); // not whether it is there
        at.write("boat", only_echo);
        at.world.run_for(10s);
        CHECK(at.echoed().error().code() == errc::no_such_service);
        at.boat->provide(echo, [](blob given) { return given; });
        CHECK(at.echoed());
        at.boat->services->services().remove("helm");
        at.boat->provide(helm, [](set_mode) { return mode_set{}; });
        CHECK(at.steer().error().code() == errc::access_denied); // provided anew is not allowed anew
        CHECK(at.boat->services->counts().sessions_accepted == 1);
    }
    SECTION("the session of an identity that was taken its path ends") {
        at.write("boat", "version = 1\n[[deny]]\nwho = \"ise://atirma/web\"\nname = \"**\"\n");
        at.world.run_for(12s);
        CHECK(at.boat->services->sessions().empty());
        CHECK_FALSE(at.steer());
    }
    SECTION("with a file that cannot be used, what there is goes on, and nothing new begins") {
        at.write("boat", "version = 1\n[[allow]\n");
        at.world.run_for(10s);
        CHECK(at.steer());
        CHECK(ended->empty());
        at.shore->services->sessions().begin()->second->wire().close(ise::failure(errc::peer_lost, "cut"));
        auto got = at.steer();
        REQUIRE_FALSE(got);
        CHECK_THAT(got.error().message(), Contains("the access policy cannot be used") && Contains("access.toml:2:"));
        at.write("boat", sea::open);
        at.world.run_for(10s);
        CHECK(at.steer());
    }
    SECTION("without an edit nothing changes") {
        at.world.run_for(1min);
        CHECK(at.steer());
        CHECK(ended->empty());
    }
}

TEST_CASE("access: an edit that allows what is used lets no call fail meanwhile") {
    sea at;
    at.begin();
    int failed = 0, served = 0;
    for (int at_second = 0; at_second < 30; ++at_second) {
        at.write("boat", fmt::format("{}# {}\n", sea::open, at_second));
        (at.steer() ? served : failed) += 1;
        at.world.run_for(1s);
    }
    CHECK(served == 30);
    CHECK(failed == 0);
}

// What a thousand callers that have a session each get while the policy changes.
struct crowd {
    static constexpr std::size_t callers = 1000;
    sim_parties sea;
    std::vector<party*> all;
    std::size_t allowed = 0, failed = 0, refused = 0;
    ise::time_point edited = ise::time_point::max(), last_denied_served{};

    static std::string policy(const char* calls) {
        return fmt::format("version = 1\n[[allow]]\nwho = \"nobody\"\nname = \"caller-*\"\ncall = \"boat:{}\"\n",
                           calls);
    }
    ise::task<> call(party& by, ise::remote boat, ise::time_point until) {
        set_mode mode{"hold"};
        blob nothing;
        while (by.on.now() < until) {
            auto steered = co_await boat.try_call(helm, mode, 10s);
            ++(steered ? allowed : failed);
            auto echoed = co_await boat.try_call(echo, nothing, 10s);
            if (echoed) last_denied_served = std::max(last_denied_served, by.on.now());
            else if (echoed.error().code() == errc::access_denied) ++refused;
            else ++failed;
            co_await ise::sleep_for(by.on, 1s);
        }
    }
};

TEST_CASE("access: an edit reaches a thousand sessions within eleven seconds, and no call that stays allowed fails") {
    crowd at;
    at.sea.world.host("boat").write_file("access.toml", crowd::policy("{helm,echo}"));
    ise::security_options with;
    with.access_file = "access.toml";
    auto& boat = at.sea.add("boat", {}, with);
    boat.services->follow_access();
    boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    boat.provide(echo, [](blob given) { return given; });
    auto where = boat.listen("tcp://" + at.sea.world.host("boat").address() + ":7400");
    std::vector<std::shared_ptr<started<void>>> running;
    for (std::size_t n = 0; n < crowd::callers; ++n) {
        auto& one = at.sea.add(fmt::format("caller-{}", n));
        running.push_back(start(one.on, at.call(one, one.at(where), one.on.now() + 30s)));
    }
    at.sea.world.run_for(8s);
    REQUIRE(boat.services->sessions().size() == crowd::callers);
    REQUIRE(at.refused == 0);
    at.sea.world.host("boat").write_file("access.toml", crowd::policy("helm"));
    at.edited = boat.on.now();
    REQUIRE(at.sea.world.run_until(
        [&] { return std::ranges::all_of(running, [](const auto& one) { return one->done; }); }));
    CHECK(at.failed == 0);
    CHECK(at.allowed > 25 * crowd::callers);
    CHECK(at.last_denied_served > at.edited);
    CHECK(at.last_denied_served < at.edited + 11s);
    CHECK(at.refused > 10 * crowd::callers);
    CHECK(boat.services->counts().sessions_accepted == crowd::callers);
}

TEST_CASE("access: a file that cannot be used is one change, whatever time passes, and so is its correction") {
    sea at;
    at.write("boat", sea::open);
    auto& process = at.world.host("boat").start_process("boat");
    auto guard = ise::access::guard::load(process, "access.toml", ise::access::audit_log()).value();
    auto look_again = [&] {
        at.world.run_for(ise::access::guard::reread_after + 1s);
        guard->refresh();
        return guard->version();
    };
    const auto hash = guard->current()->hash();
    auto before = look_again();
    at.write("boat", "garbage [[");
    auto broken = look_again();
    CHECK(broken == before + 1);
    CHECK(look_again() == broken);
    CHECK(look_again() == broken);
    REQUIRE(guard->broken());
    CHECK_THAT(guard->broken()->message(),
               Contains("the access policy cannot be used") && Contains(hash) && Contains("access.toml:1:"));
    at.write("boat", "version = 2");
    CHECK(look_again() == broken + 1); // another reason
    at.write("boat", sea::open);
    auto mended = look_again();
    CHECK(mended > broken + 1);
    CHECK_FALSE(guard->broken());
    CHECK(look_again() == mended);
}

TEST_CASE("access: a policy that cannot be used from the start is an error with its lines") {
    sea at;
    at.write("boat", "version = 1\n[[allow]]\nwho = \"web\"\n");
    auto& process = at.world.host("boat").start_process("boat");
    ise::security_options with;
    with.access_file = "access.toml";
    auto made = ise::security::load(process, with);
    REQUIRE_FALSE(made);
    CHECK_THAT(made.error().message(), Contains("no access policy (--access, ISE_ACCESS)") &&
                                           Contains("access.toml:3:7: 'web' is not an identity"));
    with.access_file = "nowhere.toml";
    CHECK_FALSE(ise::security::load(process, with));
    with.access_file.clear();
    with.audit_file = "audit.jsonl";
    auto alone = ise::security::load(process, with);
    REQUIRE_FALSE(alone);
    CHECK_THAT(alone.error().message(), Contains("needs an access policy"));
}

TEST_CASE("access: whoever proved the shared key has its identity") {
    sea at;
    ise::security_options with;
    with.key_file = "key";
    std::string policy = "version = 1\nsystem = \"atirma\"\n[[allow]]\nwho = \"ise://atirma/key\"\nname = \"**\"\n"
                         "call = \"boat:helm\"\n";
    for (const char* host : {"boat", "shore"}) {
        at.world.host(host).write_file("key", std::string(64, 'k'));
        at.write(host, policy);
    }
    auto sail = [&](const std::string& host) {
        auto& process = at.world.host(host).start_process(host);
        auto given = with;
        given.access_file = "access.toml";
        auto credentials = ise::security::load(process, given).value();
        CHECK(credentials.own == "ise://atirma/key");
        return std::make_unique<party>(process, process.make_loop("main"), host, ise::service_options(), credentials);
    };
    at.boat = sail("boat");
    at.shore = sail("shore");
    at.boat->provide(helm, [&](set_mode asked, const ise::call_context& by) {
        at.who_called = by.who;
        return mode_set{true, asked.mode};
    });
    at.boat->provide(echo, [](blob given) { return given; });
    at.boat->listen("tcp://0.0.0.0:7400");
    at.there = at.shore->at("tcp://boat:7400");
    auto got = at.steer();
    INFO((got ? std::string() : got.error().message()));
    REQUIRE(got);
    CHECK(at.who_called == "ise://atirma/key");
    CHECK_FALSE(at.echoed());
}

struct sail_order {
    std::string to;
};
inline constexpr ise::action<sail_order, sail_order, sail_order> sail{"sail"};

namespace {

constexpr const char* with_action = R"(version = 1
[[allow]]
who = "ise://atirma/boat"
name = "boat"
[[allow]]
who = "ise://atirma/web"
name = "shore"
call = "boat:helm"
subscribe = "boat:{position,sail}"
)";

// What a peer has going: a subscription and a started action, and how they ended.
struct under_way {
    std::string subscription, action;
    bool sailing = false, stopped = false;
};

ise::task<int> follow_fixes(ise::remote to, under_way& at) {
    auto packets = co_await to.subscribe(position);
    try {
        for (;;) {
            auto packet = co_await packets.next();
            if (!packet) break;
        }
        at.subscription = "it ended";
    } catch (const ise::error& why) {
        at.subscription = why.what();
    }
    co_return 0;
}

ise::task<int> follow_action(ise::remote to, under_way& at) {
    sail_order wanted;
    wanted.to = "buoy";
    try {
        auto run = co_await to.start(sail, wanted);
        (void)co_await run.result();
        at.action = "it arrived";
    } catch (const ise::error& why) {
        at.action = why.what();
    }
    co_return 0;
}

void provide_sail(party& boat, under_way& at) {
    auto handler = [&boat, &at](sail_order to, ise::progress<sail_order>) -> ise::task<sail_order> {
        at.sailing = true;
        try {
            co_await ise::sleep_for(boat.on, 1h);
        } catch (const std::exception&) {
            at.stopped = true;
            throw;
        }
        co_return to;
    };
    boat.services->services().add(ise::make_action(*boat.services, sail, std::move(handler))).value();
}

} // namespace

TEST_CASE("access: sessions of a revoked certificate end within ten seconds, with what they had going") {
    authority other("one that revokes");
    auto boat_folder = other.issue("boat", std::string("URI:ise://atirma/boat,") + authority::everywhere);
    auto web_folder = other.issue("web", std::string("URI:ise://atirma/web,") + authority::everywhere);
    auto put_list = [&](sea& at, const std::string& host) {
        at.world.host(host).write_file("tls/ca.pem", other.certificate() + other.list());
    };
    under_way goes;
    bool at_once = false;
    sea at;
    std::string policy = GENERATE(as<std::string>(), "", with_action);
    at.boat = at.sail("boat", boat_folder, policy);
    at.shore = at.sail("shore", web_folder, policy);
    for (const char* host : {"boat", "shore"}) put_list(at, host);
    at.boat->provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    at.fixes = at.boat->publish(position);
    provide_sail(*at.boat, goes);
    at.boat->listen("tls://0.0.0.0:7400");
    at.there = at.shore->at("tls://boat:7400");
    REQUIRE(at.steer());
    auto following = start(at.shore->on, follow_fixes(at.there, goes));
    auto sailing = start(at.shore->on, follow_action(at.there, goes));
    at.world.run_for(20s);
    REQUIRE(goes.sailing);
    REQUIRE(at.boat->services->sessions().size() == 1);
    SECTION("that of the one who asks") {
        other.revoke("web");
        put_list(at, "boat");
        at_once = true; // else the provider waits for its requester as long as it always does
    }
    SECTION("that of the one who is asked") {
        other.revoke("boat");
        put_list(at, "shore");
    }
    SECTION("another one's changes nothing") {
        other.issue("laptop");
        other.revoke("laptop");
        put_list(at, "boat");
        put_list(at, "shore");
        at.world.run_for(30s);
        CHECK(at.boat->services->sessions().size() == 1);
        CHECK(goes.subscription.empty());
        CHECK_FALSE(goes.stopped);
        CHECK(at.steer());
        return;
    }
    at.world.run_for(10s);
    CHECK(at.boat->services->sessions().empty());
    CHECK(at.shore->services->sessions().empty());
    if (at_once) CHECK(goes.stopped);
    CHECK_FALSE(at.steer()); // nor is there a new one
    at.world.run_for(1min);
    CHECK(goes.stopped);
    CHECK_FALSE(goes.action.empty());
}

TEST_CASE("access: an action that its identity may not have any more ends, and is cancelled at its provider") {
    under_way goes;
    sea at;
    at.begin(with_action, web_files(), with_action);
    provide_sail(*at.boat, goes);
    auto sailing = start(at.shore->on, follow_action(at.there, goes));
    at.world.run_for(1s);
    REQUIRE(goes.sailing);
    at.write("boat", sea::open);
    at.world.run_for(10s);
    CHECK(goes.stopped);
    CHECK_THAT(goes.action, Contains("may not subscribe to 'sail' of boat"));
    CHECK(at.steer()); // over the same session
    CHECK(at.boat->services->counts().sessions_accepted == 1);
}

} // namespace access_sessions_test
