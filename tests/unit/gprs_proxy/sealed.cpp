// What the boat kept while a key was changed, or while the proxy had another one, is not lost.
#include "quay.hpp"

#include <components/seal/key_file.hpp>
#include <components/seal/sealed_frame.hpp>

#include <support/catch.hpp>

namespace sealed_test {

using namespace std::chrono_literals;
using namespace atirma;
using gprs_test::quay;

namespace {

seal::radio_key a_key(std::uint8_t epoch, int salt) {
    seal::radio_key made;
    made.boat = "atirma";
    made.epoch = epoch;
    made.secret.fill(static_cast<std::byte>(salt));
    return made;
}

/// The boat seals under `in_use`, the proxy has the files that it is given.
struct sealed_quay : quay {
    explicit sealed_quay(const std::string& protocol = "tcp", std::uint32_t fixes = 20) : quay(protocol, fixes) {
        boat.seal = [this](const ise::bytes& raw) {
            auto key = in_use;
            key.link = "gprs";
            return seal::seal_from_boat(key, raw);
        };
        options.radio_key_file = "radio.key";
    }
    void give_shore(const seal::radio_keys& keys) { world.host("shore").write_file("radio.key", format_keys(keys)); }

    seal::radio_key in_use = a_key(0, 1);
};

} // namespace

TEST_CASE("gprs proxy: a key that is changed while the boat is out of coverage costs no packet") {
    for (const auto* protocol : {"tcp", "udp"}) {
        INFO(protocol);
        sealed_quay it(protocol);
        it.give_shore({it.in_use, a_key(1, 2), {}});
        it.start();
        REQUIRE(it.until([&] { return it.seen.telemetry.size() >= 3; }));
        it.world.net().partition("boat", "shore");
        REQUIRE(it.until([&] { return it.boat.measured == 15; }));
        it.in_use = a_key(1, 2); // over another link
        it.world.run_for(3s);
        it.world.net().heal("boat", "shore");
        REQUIRE(it.until([&] { return it.complete(); }));
        CHECK(it.seen.state->seal.refused == 0);
    }
}

TEST_CASE("gprs proxy: one without the boat's key acknowledges nothing, and with it gets everything") {
    for (const auto* protocol : {"tcp", "udp"}) {
        for (auto wrong : {a_key(1, 1), a_key(0, 3), seal::radio_key()}) {
            bool none = wrong.boat.empty();
            INFO(protocol << (none ? ", no key" : wrong.epoch == 0 ? ", another key" : ", another epoch"));
            sealed_quay it(protocol);
            if (none) it.options.radio_key_file.clear();
            else it.give_shore({wrong, std::nullopt, {}});
            it.start();
            REQUIRE(it.until([&] { return it.boat.measured == 20; }));
            it.world.run_for(2min);
            CHECK(it.boat.acknowledged == 0);
            CHECK(it.boat.waiting == 20);
            CHECK(it.seen.telemetry.empty());
            CHECK(it.seen.state->malformed > 0);
            CHECK(it.seen.state->not_safe_yet == 0); // others find room
            it.proxy->crash();
            it.options.radio_key_file = "radio.key";
            it.give_shore({it.in_use, std::nullopt, {}});
            it.proxy->restart();
            REQUIRE(it.until([&] { return it.boat.waiting == 0; }));
            // The console may hear the proxy again later than the boat: what the proxy published is looked at.
            REQUIRE(it.until([&] { return it.seen.state->telemetry_published == 20; }));
            CHECK(it.seen.state->given_up == 0);
        }
    }
}

TEST_CASE("gprs proxy: a notice under a key that the proxy does not have holds up no packet") {
    sealed_quay it("tcp", 5);
    it.give_shore({it.in_use, std::nullopt, {}});
    std::uint32_t sealed = 0;
    it.boat.seal = [&](const ise::bytes& raw) {
        auto key = ++sealed == 2 ? a_key(1, 2) : it.in_use;
        key.link = "gprs";
        auto plain = raw;
        if (sealed == 2) plain[1] = static_cast<std::byte>(seal::notice_type);
        return seal::seal_from_boat(key, plain);
    };
    it.start();
    REQUIRE(it.until([&] { return it.boat.measured == 5 && it.boat.waiting == 0; }));
    CHECK(it.seen.telemetry.size() == 4);
    CHECK(it.seen.state->seal.refused == 1);
}

} // namespace sealed_test
