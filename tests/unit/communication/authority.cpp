#include <components/communication_node/authority_book.hpp>

#include <support/catch.hpp>

namespace authority_test {

using namespace atirma;
using ise_test::Contains;

namespace {

const utc_time morning{std::chrono::sys_days(std::chrono::year(2017) / 9 / 4) + std::chrono::hours(8)};

struct helm {
    authority_book book;
    explicit helm(bool odd = false) : book(odd) {}

    ise::result<authority_state> ask(const std::string& who, authority_action action, bool confirmed = false,
                                     const std::string& to = {}) {
        authority_request request;
        request.action = action;
        request.confirmed = confirmed;
        request.to = to;
        auto made = book.decide(request, who, morning);
        if (made) book.apply(*made, made->epoch == book.now().epoch ? book.change() + 1 : 0);
        return made;
    }
    std::string refusal(const std::string& who, authority_action action, bool confirmed = false,
                        const std::string& to = {}) {
        auto made = ask(who, action, confirmed, to);
        REQUIRE_FALSE(made);
        CHECK(made.error().code() == ise::errc::refused);
        return made.error().message();
    }
};

using enum authority_action;

} // namespace

TEST_CASE("authority: who takes what nobody holds may command, the others are told who holds it and what to do") {
    helm it;
    CHECK_THAT(*it.book.refusal("ana"), Contains("nobody holds the authority") && Contains("take"));
    auto taken = it.ask("ana", take);
    REQUIRE(taken);
    CHECK(taken->holder == "ana");
    CHECK(taken->epoch == 2);
    CHECK(taken->since == morning);
    CHECK_FALSE(it.book.refusal("ana"));
    CHECK_THAT(*it.book.refusal("bea"),
               Contains("ana holds the authority over the boat since 2017-09-04 08:00:00 UTC, not bea") &&
                   Contains("action ask"));
    CHECK(it.ask("ana", take)->epoch == 2); // holds it already
    CHECK_THAT(it.refusal("bea", take), Contains("ana holds") && Contains("request it") && Contains("confirmed true"));
    CHECK(it.book.now().holder == "ana");
}

TEST_CASE("authority: it is asked for, handed over, taken by force and released, each time under a higher epoch") {
    helm it;
    REQUIRE(it.ask("ana", take));
    REQUIRE(it.ask("bea", ask));
    CHECK(it.ask("bea", ask)->asked_by == std::vector<std::string>{"bea"});
    CHECK(it.book.now().epoch == 2);
    CHECK_THAT(it.refusal("bea", hand_over, false, "bea"), Contains("only the holder"));
    CHECK_THAT(it.refusal("ana", hand_over), Contains("`to`"));
    CHECK_THAT(it.refusal("ana", hand_over, false, "ana"), Contains("other than the holder"));
    auto handed = it.ask("ana", hand_over, false, "bea");
    REQUIRE(handed);
    CHECK(handed->holder == "bea");
    CHECK(handed->epoch == 4);
    CHECK(handed->asked_by.empty());
    auto forced = it.ask("ana", take, true);
    REQUIRE(forced);
    CHECK(forced->epoch == 6);
    CHECK(forced->how == "taken by ana from bea");
    CHECK_THAT(it.refusal("bea", release), Contains("only the holder"));
    CHECK(it.ask("ana", release)->epoch == 8);
    CHECK(it.book.now().holder.empty());
    CHECK_THAT(it.refusal("ana", release), Contains("nothing to release"));
    CHECK_THAT(it.refusal("ana", ask), Contains("take it"));
    CHECK_THAT(it.refusal("ana", hand_over, false, "bea"), Contains("nothing to hand over"));
    CHECK(it.ask("ana", look)->epoch == 8);
}

TEST_CASE("authority: nodes that do not see each other never give the same epoch, and agree where they meet") {
    helm primary(false), secondary(true);
    REQUIRE(primary.ask("ana", take));
    CHECK(secondary.book.is_newer(primary.book.now(), 0));
    secondary.book.apply(primary.book.now(), 0);
    REQUIRE(primary.ask("ana", release)); // cut off from each other
    REQUIRE(secondary.ask("bea", take, true));
    CHECK(primary.book.now().epoch == 4);
    CHECK(secondary.book.now().epoch == 3);
    CHECK(secondary.book.is_newer(primary.book.now(), 0));
    CHECK_FALSE(primary.book.is_newer(secondary.book.now(), 0));
    REQUIRE(secondary.ask("bea", release));
    CHECK(secondary.book.now().epoch == 5);
    CHECK(primary.book.is_newer(secondary.book.now(), 0));
    CHECK_FALSE(primary.book.is_newer(primary.book.now(), primary.book.change()));
    CHECK(primary.book.is_newer(primary.book.now(), primary.book.change() + 1));
}

TEST_CASE("authority: a boat that obeys a higher epoch makes the holder take it again, above that one") {
    helm it;
    REQUIRE(it.ask("ana", take));
    it.book.boat_obeys(7, 2);
    CHECK_THAT(*it.book.refusal("ana"), Contains("epoch 7") && Contains("take it again"));
    auto anew = it.ask("ana", take);
    REQUIRE(anew);
    CHECK(anew->epoch == 8);
    CHECK(anew->boat_epoch == 8);
    CHECK_FALSE(it.book.refusal("ana"));
    it.book.boat_obeys(7, 2); // of a telecommand that was under way for long
    CHECK_FALSE(it.book.refusal("ana"));
}

TEST_CASE("authority: a forged answer of the boat costs the operators two takes at most, at either node") {
    for (bool odd : {false, true}) {
        helm it(odd);
        authority_state long_since;
        long_since.holder = "ana";
        long_since.epoch = odd ? 101 : 100;
        it.book.apply(long_since, 0);
        auto first = it.book.now().boat_epoch;
        for (std::uint32_t forged : {0xFFFFFFFFu, 0xFFFFFFFEu, 0x80000000u, 0u}) {
            CAPTURE(odd, forged);
            auto before = it.book.now();
            it.book.boat_obeys(forged, before.boat_epoch);
            CHECK_THAT(*it.book.refusal("ana"), Contains("take it again"));
            auto follows = it.ask("ana", take);
            REQUIRE(follows);
            CHECK(follows->boat_epoch != 0);
            CHECK(follows->boat_epoch - forged <= 4); // also where the numbers begin again
            CHECK(follows->boat_epoch % 2 == (odd ? 1u : 0u));
            CHECK(follows->epoch > before.epoch); // the nodes' own count is not the attacker's
            CHECK(follows->epoch <= before.epoch + 2);
            // The boat itself has not moved, and says so.
            it.book.boat_obeys(first, follows->boat_epoch);
            auto anew = it.ask("ana", take);
            REQUIRE(anew);
            CHECK(anew->boat_epoch > first);
            CHECK(anew->boat_epoch <= first + 2);
            CHECK_FALSE(it.book.refusal("ana"));
            first = anew->boat_epoch;
        }
    }
}

TEST_CASE("authority: epochs that are used up are an error, and none begins anew below the others") {
    for (bool odd : {false, true}) {
        helm it(odd);
        authority_state last;
        last.holder = "ana";
        last.epoch = odd ? 0xFFFFFFFF : 0xFFFFFFFE;
        last.boat_epoch = 4;
        it.book.apply(last, 0);
        CHECK_THAT(it.refusal("bea", take, true), Contains("used up"));
        CHECK_THAT(it.refusal("ana", release), Contains("used up"));
        CHECK(it.book.now().epoch == last.epoch);
        CHECK_FALSE(it.book.refusal("ana")); // who holds it goes on
    }
}

TEST_CASE("authority: a state of a store that knew one epoch only goes on with it") {
    helm it;
    authority_state old;
    old.holder = "ana";
    old.epoch = 6;
    it.book.apply(old, 0);
    CHECK(it.book.now().boat_epoch == 6);
    CHECK(it.ask("bea", take, true)->boat_epoch == 8);
}

TEST_CASE(
    "authority: only a path holds it: it is handed over to nothing else, and what else holds it commands nothing") {
    helm it;
    REQUIRE(it.ask("test/ana", take));
    for (const std::string nobody :
         {"anonymous@local", "anonymous@10.0.0.9:4321", "two words", "tcp://shore:1", "/ana", "ana/", "a//b"}) {
        CAPTURE(nobody);
        CHECK_THAT(it.refusal("test/ana", hand_over, false, nobody), Contains("`to`") && Contains("path"));
        for (auto action : {take, ask, hand_over, release})
            CHECK_THAT(it.refusal(nobody, action, true, "test/ana"), Contains("has no path") && Contains("--as PATH"));
        CHECK(it.ask(nobody, look)->holder == "test/ana");
        helm old; // the store of a program that handed it over all the same
        authority_state held;
        held.holder = nobody;
        held.epoch = 6;
        old.book.apply(held, 0);
        CHECK_THAT(old.book.refusal(nobody).value_or(""), Contains("has no path"));
        CHECK(old.ask("test/ana", take, true)->holder == "test/ana");
        CHECK_FALSE(old.book.refusal("test/ana"));
    }
}

TEST_CASE("authority: an operator is known by his path, and by his session where he claims none, or what is no path") {
    CHECK(operator_of("test/ana (tcp://10.0.0.9:4321)") == "test/ana");
    CHECK(operator_of("ana (local:///run/ise/one)") == "ana");
    CHECK(operator_of("tcp://10.0.0.9:4321") == "anonymous@10.0.0.9:4321");
    CHECK(operator_of("local:///run/ise/one") == "anonymous@local");
    for (const std::string claimed : {"anonymous@local", "two words", "local://x", "tcp://elsewhere:1",
                                      "test/ana (tcp://1.2.3.4:5)", "test/ana (", "/ana", " ", "ana\n"}) {
        CAPTURE(claimed);
        CHECK(operator_of(claimed + " (tcp://10.0.0.9:4321)") == "anonymous@10.0.0.9:4321");
    }
    CHECK(operator_of(std::string(201, 'x') + " (tcp://10.0.0.9:4321)") == "anonymous@10.0.0.9:4321");
}

TEST_CASE("authority: names and questions are bounded") {
    helm it;
    REQUIRE(it.ask("ana", take));
    for (std::size_t i = 0; i < authority_book::max_asking; ++i) REQUIRE(it.ask("operator" + std::to_string(i), ask));
    CHECK_THAT(it.refusal("one-more", ask), Contains("16 operators have requested"));
    CHECK_FALSE(it.ask("", take, true));
    CHECK_FALSE(it.ask(std::string(201, 'x'), take, true));
    CHECK_FALSE(it.ask("ana", hand_over, false, std::string(201, 'x')));
    CHECK_FALSE(it.ask("ana", static_cast<authority_action>(99)));
}

} // namespace authority_test
