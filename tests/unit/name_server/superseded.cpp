// Who was cut off while another was granted its name: withdraws within a lease period of contact.
#include "system.hpp"

#include <ise/component/introspection.hpp>
#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>

namespace superseded_test {

using namespace names_test;

namespace {

constexpr ise::duration lease = 2s; // the default

// Says when it has lost its name, and goes on.
class survivor final : public ise::component {
public:
    std::optional<ise::failure> lost;

private:
    ise::task<> run() override {
        provide(twice, [](number rq) {
            number answer{rq.value * 2};
            return answer;
        });
        co_await sleep(100h);
    }
    void on_name_lost(const ise::failure& why) override { lost = why; }
};

struct rivals {
    explicit rivals(std::uint64_t seed = 1) : it(true, seed) {
        it.start("boat", "boat", [this](ise::node& node) {
            old_node = &node;
            old = &node.start<survivor>("atirma/doubler", everywhere());
        });
        it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s);
        it.start_body("boat2", "client", [this](ise::component& self) -> ise::task<> {
            auto there = self.at("atirma/doubler");
            for (;;) {
                auto got = co_await there.try_call(twice, number{21}, 1s);
                (got ? answered : failed)++;
                if (!got) last_failure = got.error();
                holder = there.way().current() ? there.way().current()->peer().epoch : 0;
                co_await self.sleep(20ms);
            }
        });
        it.world.run_until([&] { return answered > 3; }, 5s);
    }

    // The old one is cut off from the name server and another is granted the name.
    void replace() {
        it.world.net().partition("boat", "ns");
        it.world.run_until([&] { return !it.holds("atirma/doubler"); }, 10s);
        it.start_doubler("spare", "atirma/doubler");
        it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s);
    }

    names_test::system it;
    ise::node* old_node = nullptr;
    survivor* old = nullptr;
    int answered = 0, failed = 0;
    std::uint64_t holder = 0;
    std::optional<ise::failure> last_failure;
};

} // namespace

TEST_CASE("superseded: a name that could not be renewed is unconfirmed, and confirmed again when it was") {
    rivals at;
    CHECK(at.old->name_confirmed());
    at.it.world.net().partition("boat", "ns");
    at.it.world.run_for(lease);
    CHECK_FALSE(at.old->name_confirmed());
    auto before = at.answered;
    at.it.world.run_for(5s);
    CHECK(at.answered > before + 100); // its sessions go on

    bool confirmed = true;
    at.it.start_body("boat", "asker", [&](ise::component& self) -> ise::task<> {
        auto port = at.old->services().listening().front().port;
        auto there = self.at(ise::endpoint::parse("tcp://127.0.0.1:" + std::to_string(port)).value());
        ise::describe_request question;
        auto about = co_await there.call(ise::describe_service, question, 2s);
        confirmed = about.confirmed;
    });
    CHECK(at.it.world.run_until([&] { return !confirmed; }, 5s)); // and people see it
    at.it.world.net().heal("boat", "ns");
    CHECK(at.it.world.run_until([&] { return at.old->name_confirmed(); }, 5s));
    CHECK_FALSE(at.old->lost);
}

TEST_CASE("superseded: the old holder withdraws within a lease period of contact, whenever that is") {
    auto cut_for = GENERATE(0ms, 130ms, 260ms, 390ms, 520ms, 650ms, 780ms, 910ms, 1040ms, 7300ms, 61s);
    CAPTURE(cut_for.count());
    rivals at;
    at.replace();
    at.it.world.run_for(cut_for);
    REQUIRE_FALSE(at.old->lost);
    auto higher = at.it.epoch_of("atirma/doubler");
    REQUIRE(at.holder < higher); // its client is with it still
    REQUIRE(at.holder != 0);
    at.it.world.net().heal("boat", "ns");
    REQUIRE(at.it.world.run_until([&] { return at.old->lost.has_value(); }, lease));
    CHECK(at.old->lost->code() == ise::errc::superseded);
    CHECK_FALSE(at.old->name_confirmed());

    // It answers nobody any more, and its client goes on with the new holder.
    CHECK(at.it.world.run_until([&] { return at.holder == higher; }, 5s));
    CHECK(at.old->services().sessions().empty());
    CHECK(at.old->state() == ise::component_state::ready); // as it wished
    at.it.world.run_for(30s);
    CHECK(at.it.epoch_of("atirma/doubler") == higher);
}

TEST_CASE("superseded: a requester of the old holder learns that it is superseded") {
    rivals at;
    at.replace();
    at.it.world.net().heal("boat", "ns");
    REQUIRE(at.it.world.run_until([&] { return at.old->lost.has_value(); }, 5s));
    std::string obstacle;
    at.it.start_body("boat", "late", [&](ise::component& self) -> ise::task<> {
        auto port = at.old->services().listening().front().port;
        auto there = self.at(ise::endpoint::parse("tcp://127.0.0.1:" + std::to_string(port)).value());
        auto made = co_await there.connect(1s);
        if (!made) obstacle = made.error().message();
    });
    REQUIRE(at.it.world.run_until([&] { return !obstacle.empty(); }, 5s));
    CAPTURE(obstacle);
    CHECK(obstacle.find("another took this name over") != std::string::npos);
}

TEST_CASE("superseded: a component that does not say otherwise stops as failed, and its callers hear why") {
    names_test::system it;
    ise::node* old = nullptr;
    it.start("boat", "boat", [&](ise::node& node) {
        old = &node;
        node.start<doubler>("atirma/doubler", everywhere());
    });
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    std::string cause;
    it.start_body("boat2", "client", [&](ise::component& self) -> ise::task<> {
        auto place = co_await self.services().resolver()->resolve("atirma/doubler");
        auto there = self.at(place->members.front().endpoints.front());
        auto connected = co_await there.connect(5s);
        connected.value();
        while (there.way().current()) co_await self.sleep(5ms);
        cause = there.way().obstacle();
    });
    it.world.run_for(1s);
    it.world.net().partition("boat", "ns");
    REQUIRE(it.world.run_until([&] { return !it.holds("atirma/doubler"); }, 10s));
    it.start_doubler("spare", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    it.world.net().heal("boat", "ns");
    REQUIRE(it.world.run_until([&] { return old->all_stopped(); }, 10s));
    CHECK(old->reports().at(0).failure.find("another took this name over") != std::string::npos);
    it.world.run_until([&] { return !cause.empty(); }, 1s);
    CAPTURE(cause);
    CHECK(cause.find("another took this name over") != std::string::npos);
}

} // namespace superseded_test
