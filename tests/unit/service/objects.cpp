// Within a process packets are handed over as the objects that they are: no codec, no copies but those that were asked
// for.
#include <ise/packet/archive.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/in_one_process.hpp>

#include <ise/service/dynamic.hpp>

#include <atomic>
#include <optional>
#include <string>
#include <vector>

namespace objects_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::errc;
using ise::execution;
using ise::overflow;

namespace {

// What happened to all packets below.
std::atomic<int> written{0}, decoded{0}, copied{0};
std::atomic<bool> writes{true}; // false: who writes one down fails

// A packet that tells what becomes of it.
struct watched {
    std::string text;

    watched() = default;
    watched(std::string said) : text(std::move(said)) {}
    watched(const watched& other) : text(other.text) { ++copied; }
    watched(watched&&) noexcept = default;
    watched& operator=(const watched& other) {
        text = other.text;
        ++copied;
        return *this;
    }
    watched& operator=(watched&&) noexcept = default;

    template <class Archive>
    void save(Archive& archive) const {
        ++written;
        if (!writes) throw std::runtime_error("this packet is not to be written");
        archive(text);
    }
    template <class Archive>
    void load(Archive& archive) {
        ++decoded;
        archive(text);
    }
};
struct hefty {
    std::vector<std::uint8_t> content;
    std::array<double, 20> numbers{}; // does not fit where it would be held without an allocation
};
// As another program would declare it that talks to those above.
namespace elsewhere {
struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted = false;
    std::string reason;
};
struct fix {
    double latitude_deg = 0, longitude_deg = 0;
    float speed_kn = 0;
};
constexpr ise::request_response<set_mode, mode_set> helm{"helm"};
constexpr ise::subscription<fix> position{"position"};
} // namespace elsewhere

constexpr ise::request_response<watched, watched> talk{"talk"};
constexpr ise::subscription<watched> news{"news"};
constexpr ise::request_response<hefty, hefty> carry{"carry"};

struct fixture {
    in_one_process all;
    party& boat;
    party& shore;
    ise::remote there;

    explicit fixture(bool one_loop = GENERATE(false, true), ise::service_options options = {})
        : all(one_loop), boat(all.add("boat", options)), shore(all.add("shore", options)),
          there(shore.at(boat.listen("inproc://boat"))) {
        static_cast<void>(talk.types()); // describing a packet writes one
        static_cast<void>(news.types());
        written = decoded = copied = 0;
        writes = true;
    }
    ~fixture() { writes = true; }
    template <class T>
    T run(ise::task<T> body) {
        return all.run(shore, std::move(body));
    }
    bool run_until(const std::function<bool()>& done) { return all.world.run_until(done); }
    void cut() {
        for (auto& [raw, held] : std::map(shore.services->sessions()))
            held->wire().close(ise::failure(errc::peer_lost, "cut"));
    }
};

template <class Contract>
ise::task<ise::result<typename Contract::response_type>> ask(ise::remote to, Contract contract,
                                                             typename Contract::request_type request,
                                                             ise::duration limit = 5s) {
    auto got = co_await to.try_call(contract, std::move(request), limit);
    co_return got;
}

template <class Contract>
ise::task<std::vector<ise::received<typename Contract::packet_type>>> take(ise::subscriber<Contract>& from,
                                                                           std::size_t count) {
    std::vector<ise::received<typename Contract::packet_type>> all;
    while (all.size() < count) {
        auto packet = co_await from.next();
        if (!packet) break;
        all.push_back(packet);
    }
    co_return all;
}

} // namespace

TEST_CASE("objects: request and response are moved, and nothing is encoded") {
    fixture f;
    bool plain = GENERATE(true, false);
    if (plain) {
        f.boat.provide(talk, [](watched said) { return watched(said.text + "!"); });
    } else {
        f.boat.provide(talk, [](watched said) -> ise::task<watched> {
            watched answer(said.text + "!");
            co_return answer;
        });
    }
    for (int i = 0; i < 3; ++i) { // the first waits for a session, and for a worker
        auto got = f.run(ask(f.there, talk, watched("ahoy")));
        REQUIRE(got);
        CHECK(got->text == "ahoy!");
    }
    CHECK(written == 0);
    CHECK(decoded == 0);
    CHECK(copied == 0);
}

TEST_CASE("objects: packets that are too large to be held in place arrive too") {
    fixture f;
    f.boat.provide(carry, [](hefty given) { return given; });
    hefty given;
    given.content.assign(300'000, 7);
    given.numbers[19] = 1.5;
    const auto* bytes = given.content.data();
    auto got = f.run(ask(f.there, carry, std::move(given)));
    REQUIRE(got);
    CHECK(got->content.data() == bytes); // the very same memory went there and back
    CHECK(got->numbers[19] == 1.5);
}

TEST_CASE("objects: a handler's failure, a refusal, a missing service and a deadline are told as everywhere") {
    fixture f;
    f.boat.provide(talk, [&](watched said) -> ise::task<watched> {
        if (said.text == "refuse") throw ise::error(errc::refused, "no");
        if (said.text == "throw") throw std::runtime_error("oops");
        co_await ise::sleep_for(f.boat.on, 1h);
        co_return said;
    });
    auto refused = f.run(ask(f.there, talk, watched("refuse")));
    CHECK(refused.error().code() == errc::refused);
    auto thrown = f.run(ask(f.there, talk, watched("throw")));
    CHECK(thrown.error().code() == errc::handler_failed);
    auto late = f.run(ask(f.there, talk, watched("sleep"), 1s));
    CHECK(late.error().code() == errc::timed_out);
    CHECK(late.error().executed() == execution::unknown);
    auto missing = f.run(ask(f.there, ise::request_response<watched, watched>("gossip"), watched("who")));
    CHECK(missing.error().code() == errc::no_such_service);
    CHECK(missing.error().executed() == execution::not_executed);
    CHECK(written == 0);
}

TEST_CASE("objects: all subscribers share one copy of what is published, or the packet itself if it was given away") {
    fixture f;
    auto out = f.boat.publish(news);
    std::vector<ise::subscriber<ise::subscription<watched>>> in;
    for (int i = 0; i < 3; ++i) in.push_back(f.run(f.there.subscribe(news, ise::subscribe_options::keep_last(8))));
    watched first("first");
    out(first);
    out(watched("second"));
    CHECK(copied == 1);
    std::vector<const watched*> seen;
    for (auto& each : in) {
        auto got = f.run(take(each, 2));
        REQUIRE(got.size() == 2);
        CHECK(got[0]->text == "first");
        CHECK(got[1]->text == "second");
        seen.push_back(&*got[1]);
    }
    CHECK(seen[0] == seen[1]);
    CHECK(seen[1] == seen[2]);
    CHECK(copied == 1);
    CHECK(written == 0);
    CHECK(decoded == 0);
}

TEST_CASE("objects: a packet taken by value is moved by its last holder, and copied for the others") {
    fixture f;
    auto out = f.boat.publish(news);
    auto one = f.run(f.there.subscribe(news, ise::subscribe_options::keep_last(8)));
    auto two = f.run(f.there.subscribe(news, ise::subscribe_options::keep_last(8)));
    out(watched("first"));
    out(watched("second")); // which is the last value now, and is held as that
    auto mine = f.run(take(one, 2));
    auto yours = f.run(take(two, 2));
    CHECK(mine[0].take().text == "first");
    CHECK(copied == 1);
    CHECK_FALSE(mine[0]);
    CHECK(yours[0].take().text == "first");
    CHECK(copied == 1);
    CHECK(yours[1].take().text == "second");
    CHECK(copied == 2);
}

TEST_CASE("objects: who comes later gets the last value, in the process as it is and elsewhere as bytes") {
    fixture f;
    auto out = f.boat.publish(news);
    out(watched("early"));
    CHECK(written == 0);
    auto near = f.run(f.there.subscribe(news));
    CHECK(f.run(take(near, 1)).front()->text == "early");
    CHECK(written == 0);
    auto far = f.run(f.shore.at(f.boat.listen("tcp://0.0.0.0:7400")).subscribe(news));
    CHECK(f.run(take(far, 1)).front()->text == "early");
    CHECK(written == 1);
    out(watched("both"));
    CHECK(f.run(take(near, 1)).front()->text == "both");
    CHECK(f.run(take(far, 1)).front()->text == "both");
    CHECK(written == 2);
    CHECK(decoded == 2); // of the one who is elsewhere
}

TEST_CASE("objects: what was published for some only leaves the newest value for who comes then") {
    fixture f;
    auto out = f.boat.publish(news);
    auto first = f.run(f.there.subscribe(news));
    out(watched("for all"));
    out.publish_if(watched("for none"), [](const ise::subscriber_info&) { return false; });
    auto second = f.run(f.there.subscribe(news));
    out(watched("next"));
    auto got = f.run(take(second, 2));
    CHECK(got[0]->text == "for all");
    CHECK(got[1]->text == "next");
    CHECK(got[1].lost_before() == 0);
    auto mine = f.run(take(first, 2));
    CHECK(mine[1].lost_before() == 0);
    CHECK(first.counts().skipped == 1);
}

TEST_CASE("objects: a last value that cannot be written is no reason to refuse a subscriber") {
    fixture f;
    auto out = f.boat.publish(news);
    out(watched("spoken"));
    writes = false;
    auto far = f.run(f.shore.at(f.boat.listen("tcp://0.0.0.0:7400")).subscribe(news));
    writes = true;
    out(watched("heard"));
    CHECK(f.run(take(far, 1)).front()->text == "heard");
    CHECK(f.boat.warnings.size() == 1);
}

TEST_CASE("objects: the last value is the newest packet, also where the ones before were objects and it is bytes") {
    fixture f;
    auto out = f.boat.publish(news);
    auto far = f.run(f.shore.at(f.boat.listen("tcp://0.0.0.0:7400")).subscribe(news));
    auto near = std::make_optional(f.run(f.there.subscribe(news, ise::subscribe_options::lossless(1))));
    auto send = [](ise::publication<ise::subscription<watched>> to, std::vector<std::string> said) -> ise::task<> {
        for (const auto& text : said) {
            watched packet(text);
            co_await to.send(packet);
        }
    };
    auto full = start(f.boat.on, send(out, {"1", "2"})); // one here, one held back there
    CHECK(f.run_until([&] { return full->done; }));
    auto first = start(f.boat.on, send(out, {"3"})), second = start(f.boat.on, send(out, {"4", "5", "6"}));
    f.all.world.run_for(100ms);
    CHECK(out.published() == 2);
    near.reset();
    CHECK(f.run_until([&] { return first->done && second->done; }));
    auto later = f.run(f.there.subscribe(news));
    CHECK(f.run(take(later, 1)).front()->text == "6");
    CHECK(f.run(take(far, 6)).back()->text == "6");
}

TEST_CASE("objects: types that only look the same are talked to in bytes") {
    fixture f;
    f.boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    auto out = f.boat.publish(position);
    elsewhere::set_mode hold{"hold"};
    auto got = f.run(ask(f.there, elsewhere::helm, hold));
    REQUIRE(got);
    CHECK(got->accepted);
    CHECK(got->reason == "hold");
    auto in = f.run(f.there.subscribe(elsewhere::position));
    out(fix{1, 2, 3});
    CHECK(f.run(take(in, 1)).front()->longitude_deg == 2);
}

TEST_CASE("objects: an older version of a service is adapted to") {
    struct order {
        std::string mode;
        int urgency = 3;
    };
    struct done {
        bool accepted = false;
    };
    fixture f;
    f.boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    order given{"hold", 5};
    auto got = f.run(ask(f.there, ise::request_response<order, done>("helm"), given));
    REQUIRE(got);
    CHECK(got->accepted);
}

TEST_CASE("objects: who knows the types at run time only gets bytes") {
    fixture f;
    f.boat.provide(talk, [](watched said) { return said; });
    auto out = f.boat.publish(news);
    auto call = ise::dynamic_contract::make("talk", ise::service_kind::request_response, talk.types().schemas).value();
    ise::dynamic_packet request(talk.types().schemas[0], ise::encode(watched("ahoy")));
    auto got = f.run(ise::call_dynamic(f.there, call, request));
    REQUIRE(got);
    CHECK(ise::decode<watched>(got->encoded()).text == "ahoy");
    auto contract = ise::dynamic_contract::make("news", ise::service_kind::subscription, news.types().schemas).value();
    auto typed = f.run(f.there.subscribe(news));
    auto in = f.run(
        ise::subscribe_dynamic(f.there, contract, ise::default_packet(contract.packet(ise::role::subscribe_request))));
    REQUIRE(in);
    out(watched("both"));
    auto came = f.run(in->next());
    REQUIRE(came);
    CHECK(ise::decode<watched>(came->encoded()).text == "both");
    CHECK(f.run(take(typed, 1)).front()->text == "both");
}

TEST_CASE("objects: a message beyond what the peer accepts is refused before it leaves") {
    ise::service_options options;
    options.accepts.max_message_bytes = 1 << 20;
    fixture f(GENERATE(false, true), options);
    f.boat.provide(echo, [](blob given) {
        given.content.resize(given.content.size() * 2);
        return given;
    });
    blob asked;
    asked.content.resize(2 << 20);
    auto got = f.run(ask(f.there, echo, asked));
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::too_large);
    CHECK(got.error().executed() == execution::not_executed);
    asked.content.resize(600'000);
    got = f.run(ask(f.there, echo, asked));
    REQUIRE_FALSE(got);
    CHECK(got.error().code() == errc::too_large);
    CHECK(got.error().executed() == execution::unknown);
    auto out = f.boat.publish(pictures);
    auto in = f.run(f.there.subscribe(pictures));
    blob shot;
    shot.content.resize(2 << 20);
    out(shot);
    shot.content.resize(10);
    out(shot);
    auto came = f.run(take(in, 1));
    CHECK(came[0]->content.size() == 10);
    CHECK(came[0].lost_before() == 1);
}

TEST_CASE("objects: what waits is bounded in bytes, and what is dropped is counted") {
    ise::service_options options;
    options.session_bytes = 256 << 10;
    fixture f(GENERATE(false, true), options);
    auto out = f.boat.publish(pictures);
    auto in = f.run(f.there.subscribe(pictures, ise::subscribe_options::keep_last(1000)));
    blob shot;
    shot.content.resize(300'000);
    for (int i = 0; i < 20; ++i) out(shot); // in one go: nothing is taken meanwhile
    shot.content.resize(1);
    out(shot);
    std::uint64_t lost = 0, came = 0;
    for (bool last = false; !last;) {
        auto got = f.run(take(in, 1));
        REQUIRE(got.size() == 1);
        ++came;
        lost += got[0].lost_before().value();
        last = got[0]->content.size() == 1;
    }
    CHECK(came + lost == 21);
    CHECK(came <= 5); // one left at once, three and the last waited
}

TEST_CASE("objects: keep the latest, keep some, lose none, or the end of it") {
    fixture f;
    auto out = f.boat.publish(position);
    auto policy = GENERATE(overflow::keep_latest, overflow::keep_last, overflow::lossless, overflow::disconnect);
    ise::subscribe_options options;
    options.policy = policy;
    options.depth = 4;
    auto in = f.run(f.there.subscribe(position, options));
    f.cut(); // nothing is taken from now on
    REQUIRE(f.run_until([&] { return !in.connected(); }));
    for (int i = 1; i <= 10; ++i) out(fix{1.0 * i, 0, 0});
    if (policy == overflow::lossless || policy == overflow::disconnect) {
        // A new subscription, or the news that it is over.
        REQUIRE(f.run_until([&] { return in.connected() || in.ended(); }));
        CHECK(out.subscribers() <= 1);
        return;
    }
    const std::uint64_t kept = policy == overflow::keep_latest ? 1 : 4;
    auto got = f.run(take(in, kept));
    CHECK(got[0]->latitude_deg == 11.0 - static_cast<double>(kept));
    CHECK(got[0].lost_before() == 10 - kept);
    CHECK(in.counts().resumed == 1);
}

TEST_CASE("objects: packets that waited go as bytes where the subscriber comes back over another transport") {
    struct changing final : ise::resolver {
        std::vector<ise::endpoint> where;
        ise::task<ise::result<ise::resolution>> resolve(std::string path) override {
            ise::resolution found;
            auto& holder = found.members.emplace_back();
            holder.path = path;
            holder.endpoints = where;
            co_return found;
        }
        ise::task<ise::result<ise::resolution>> resolve_when_present(std::string path, ise::time_point) override {
            return resolve(std::move(path));
        }
        ise::task<std::uint64_t> next_life(std::string, std::uint64_t, ise::time_point) override { co_return 0; }
    };
    fixture f;
    auto names = std::make_shared<changing>();
    f.shore.services->use_resolver(names);
    const auto near = ise::endpoint::parse("inproc://boat").value(), far = f.boat.listen("tcp://127.0.0.1:7400");
    const bool near_first = GENERATE(true, false);
    CAPTURE(near_first);
    names->where = {near_first ? near : far};
    auto out = f.boat.publish(news);
    auto in = f.run(ise::remote(f.shore.services->link_to("boat", ise::role_options()))
                        .subscribe(news, ise::subscribe_options::keep_last(8)));
    out(watched("one"));
    CHECK(f.run(take(in, 1)).front()->text == "one");
    names->where.clear();
    f.cut();
    REQUIRE(f.run_until([&] { return f.boat.services->sessions().empty(); })); // nothing is on its way any more
    out(watched("two"));
    out(watched("three"));
    names->where = {near_first ? far : near};
    auto got = f.run(take(in, 2));
    CHECK(got[0]->text == "two");
    CHECK(got[0].lost_before() == 0);
    CHECK(got[1]->text == "three");
    out(watched("four"));
    CHECK(f.run(take(in, 1)).front()->text == "four");
    CHECK(in.counts().resumed == 1);
}

TEST_CASE("objects: a request that was never written goes on with the next session, as the object that it is") {
    in_one_process all(false);
    auto& boat = all.add("boat");
    auto& shore = all.add("shore");
    int asked = 0;
    boat.provide(echo, [&](blob given) {
        ++asked;
        return given;
    });
    auto there = shore.at(boat.listen("inproc://boat"));
    REQUIRE(all.run(shore, ask(there, echo, blob())));
    // The first fills what lies between; the second waits on this side when the session is cut.
    blob large;
    large.content.resize(1 << 20);
    auto outcome = std::make_shared<std::vector<ise::result<blob>>>();
    std::vector<std::shared_ptr<started<ise::result<blob>>>> calls;
    {
        ise::loop::turn in(shore.on);
        calls.push_back(start(shore.on, ask(there, echo, large)));
        calls.push_back(start(shore.on, ask(there, echo, large)));
    }
    auto session = shore.services->sessions().begin()->second;
    REQUIRE(all.world.run_until([&] { return session->calls().pending() == 2; }));
    session->wire().flush();
    session->wire().flush();
    session->wire().close(ise::failure(errc::peer_lost, "cut"));
    REQUIRE(all.world.run_until([&] { return calls[0]->done && calls[1]->done; }));
    for (auto& call : calls) {
        auto& got = call->get();
        if (got) CHECK(got->content.size() == large.content.size());
        else CHECK(got.error().executed() == execution::unknown);
    }
    CHECK(asked >= 2);
}

} // namespace objects_test
