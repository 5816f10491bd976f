// The key is changed over a radio that loses every second packet: boat and shore always find together again.
#include <components/boat/telecommand.hpp>
#include <components/seal/boat_ring.hpp>
#include <components/seal/key_file.hpp>
#include <components/seal/shore_ring.hpp>

#include <support/catch.hpp>

#include <cstdlib>
#include <map>
#include <random>
#include <set>

namespace rekey_test {

using namespace atirma;
using namespace atirma::seal;
using namespace std::chrono_literals;

namespace {

const std::vector<std::string> links{"xbee", "gprs", "iridium"};
constexpr std::size_t radio = 0;

radio_key a_key(std::uint8_t epoch = 0, int salt = 0) {
    radio_key made;
    made.boat = "atirma";
    made.epoch = epoch;
    for (std::size_t i = 0; i < key_size; ++i)
        made.secret[i] = static_cast<std::byte>(i * 7 + static_cast<std::size_t>(salt) * 31 + epoch);
    return made;
}
radio_key the_recovery_key() { return a_key(0, 99); }

ise::bytes command(std::uint32_t id) {
    telecommand made;
    made.id = id;
    made.sent_at = utc_time(1'700'000'000'000ms);
    made.command = commands::ping{};
    made.authority = 1;
    made.valid_for = 60s;
    return encode_telecommand(made);
}

ise::bytes telemetry() {
    acknowledgement made;
    made.id = 9;
    return encode_acknowledgement(made);
}

/// A disk whose operations fail on demand; a failed one may have written all the same.
struct disk {
    int fails_in = -1; ///< operations from now; -1: never
    bool writes_anyway = false;

    template <class Value>
    ise::result<void> write(std::optional<Value>& to, const Value& value) {
        bool failed = fails_in >= 0 && fails_in-- == 0;
        if (!failed || writes_anyway) to = value;
        if (failed) return ise::failure(ise::errc::io_failed, "disk full");
        return {};
    }
};

/// The boat with its disk.
struct boat_side {
    disk of;
    std::optional<boat_keys> keys;
    std::map<std::string, std::optional<boat_counters>> counters; // by fingerprint and link
    std::optional<boat_ring> ring;

    ise::result<void> start(const boat_keys& of_file, std::mt19937_64& random, bool recovery = true) {
        ring.reset();
        auto end = [this, &random](const radio_key& key) -> ise::result<boat_seal> {
            auto& kept = counters[fingerprint(key) + key.link];
            auto keep = [this, &kept](const boat_counters& now) { return of.write(kept, now); };
            auto drawn = random();
            boat_seal made(key, kept, drawn, keep);
            if (!kept)
                if (auto put = keep(made.counters()); !put) return put.error();
            return made;
        };
        auto made = boat_ring::make(keys.value_or(of_file), recovery ? std::optional(the_recovery_key()) : std::nullopt,
                                    links, end, [this](const boat_keys& now) { return of.write(keys, now); });
        if (!made) return made.error();
        ring.emplace(std::move(*made));
        return {};
    }
};

/// A proxy ashore, with its key file and its disk.
struct shore_side {
    disk of;
    std::string link = links[radio];
    seal::lane lane = lane::primary;
    radio_keys file;
    std::map<std::string, std::optional<shore_counters>> counters; // by fingerprint
    std::optional<shore_ring> ring;

    void start() {
        auto end = [this](radio_key key) {
            auto& kept = counters[fingerprint(key)];
            key.link = link;
            return shore_seal(key, lane, kept.value_or(shore_counters()),
                              [this, &kept](const shore_counters& now) { return of.write(kept, now); });
        };
        if (file.next)
            ring.emplace(end(file.now), end(*file.next), file.recovery, counters[fingerprint(*file.next)].has_value());
        else ring.emplace(end(file.now));
    }
};

std::uint64_t from_environment(const char* name, std::uint64_t preset) {
    const char* text = std::getenv(name); // NOLINT: nothing sets it meanwhile
    return text ? std::strtoull(text, nullptr, 10) : preset;
}

struct pair {
    std::mt19937_64 random{1};
    boat_side boat;
    shore_side shore;
    boat_keys first{a_key(), std::nullopt, false, 0};

    pair() {
        REQUIRE(boat.start(first, random));
        shore.file.now = a_key();
        shore.start();
        REQUIRE(shore.ring->open(boat.ring->take_notice(radio)));
    }
    void change_to(const radio_key& next, bool recovery = false, std::uint64_t generation = 1) {
        shore.file.next = next;
        if (recovery) shore.file.recovery = seal_recovery(the_recovery_key(), generation, next);
        shore.start();
    }
    /// The boat says something, the shore answers, the boat sends its notices: nothing is lost.
    void talk(int rounds = 1) {
        for (int i = 0; i < rounds; ++i) {
            (void)shore.ring->open(boat.ring->seal(radio, telemetry()));
            for (int step = 0; step < 3; ++step) {
                auto question = shore.ring->take_question();
                if (!question.empty()) (void)boat.ring->open(radio, question);
                auto notice = boat.ring->take_notice(radio);
                if (!notice.empty()) (void)shore.ring->open(notice);
            }
        }
    }
    bool obeys(std::uint32_t id) {
        auto sealed = shore.ring->seal(command(id));
        if (!sealed) return false;
        auto opened = boat.ring->open(radio, *sealed);
        return opened && !opened->empty();
    }
};

} // namespace

TEST_CASE("rekey: the boat accepts both keys until the first packet under the new one") {
    pair both;
    shore_side other; // the node that has the next key later
    other.lane = lane::secondary;
    other.file.now = a_key();
    other.start();
    REQUIRE(other.ring->open(both.boat.ring->seal(radio, telemetry())));
    auto ask = other.ring->take_question();
    REQUIRE_FALSE(both.boat.ring->open(radio, ask)); // of no session
    REQUIRE(other.ring->open(both.boat.ring->take_notice(radio)));

    both.change_to(a_key(1));
    REQUIRE(both.shore.ring->open(both.boat.ring->seal(radio, telemetry())));
    auto rekey = both.shore.ring->take_question();
    REQUIRE(rekey.size() == 48);
    auto result = both.boat.ring->open(radio, rekey);
    REQUIRE(result);
    CHECK(result->empty());
    REQUIRE(both.boat.ring->keys().next);
    CHECK(both.boat.ring->keys().now.epoch == 0);
    CHECK(both.obeys(1)); // under the old one
    auto under_old = other.ring->seal(command(2)).value();
    CHECK(both.boat.ring->open(radio, under_old));
    auto late = other.ring->seal(command(3)).value();

    auto notice = both.boat.ring->take_notice(radio);
    REQUIRE_FALSE(notice.empty());
    CHECK(epoch_of(notice) == 1);
    REQUIRE(both.shore.ring->open(notice));
    CHECK(both.shore.ring->key().epoch == 1);
    CHECK(both.boat.ring->keys().now.epoch == 0); // it has not heard it yet
    CHECK(both.boat.ring->open(radio, both.shore.ring->take_question()));
    CHECK(both.boat.ring->keys().now.epoch == 1);
    CHECK_FALSE(both.boat.ring->keys().next);
    CHECK(both.obeys(4));
    CHECK_FALSE(both.boat.ring->open(radio, late));
    CHECK_FALSE(other.ring->open(both.boat.ring->seal(radio, telemetry()))); // until it has the file
    other.file.next = a_key(1);
    other.start();
    REQUIRE(other.ring->open(both.boat.ring->seal(radio, telemetry())));
    CHECK(other.ring->key().epoch == 1);
}

TEST_CASE("rekey: the change counts for all links of the boat") {
    pair both;
    shore_side gprs;
    gprs.link = links[1];
    gprs.file.now = a_key();
    gprs.start();
    both.change_to(a_key(1));
    both.talk();
    CHECK(both.boat.ring->keys().now.epoch == 1);
    auto old = gprs.ring->seal(command(1)).value();
    CHECK_FALSE(both.boat.ring->open(1, old));
    gprs.file.next = a_key(1);
    gprs.start();
    REQUIRE(gprs.ring->open(both.boat.ring->seal(1, telemetry())));
    CHECK(gprs.ring->key().epoch == 1);
}

TEST_CASE("rekey: restarts in the middle of a change lose nothing of it") {
    for (int restart_at = 0; restart_at < 4; ++restart_at) {
        pair both;
        auto restart = [&](int at) {
            if (at != restart_at) return;
            REQUIRE(both.boat.start(both.first, both.random));
            both.shore.start();
        };
        both.change_to(a_key(1));
        restart(0);
        REQUIRE(both.shore.ring->open(both.boat.ring->seal(radio, telemetry())));
        REQUIRE(both.boat.ring->open(radio, both.shore.ring->take_question()));
        restart(1);
        auto notice = both.boat.ring->take_notice(radio);
        if (!notice.empty()) REQUIRE(both.shore.ring->open(notice));
        restart(2);
        both.talk();
        restart(3);
        both.talk(2);
        CHECK(both.boat.ring->keys().now.epoch == 1);
        CHECK(both.shore.ring->key().epoch == 1);
        CHECK(both.obeys(1));
    }
}

TEST_CASE("rekey: a recovery key changes the key that somebody else has put in, and opens nothing else") {
    pair both;
    both.change_to(a_key(1, 5)); // a thief of the key
    both.talk();
    REQUIRE(both.boat.ring->keys().now.secret == a_key(1, 5).secret);
    shore_side thief = std::move(both.shore);
    thief.start();

    both.shore = shore_side();
    both.shore.file.now = a_key();
    both.shore.counters[fingerprint(a_key())] = shore_counters{77, 100};
    both.change_to(a_key(1, 6), true, 10); // of the same epoch as the thief's
    CHECK_FALSE(both.shore.ring->open(both.boat.ring->seal(radio, telemetry())));
    auto change = both.shore.ring->take_question();
    REQUIRE_FALSE(change.empty());
    CHECK(both.boat.ring->open(radio, change));
    CHECK_FALSE(both.boat.ring->open(radio, change)); // once
    // The thief's key does not change it again.
    CHECK_FALSE(both.boat.ring->open(radio, thief.ring->rekey().empty() ? change : thief.ring->rekey()));
    shore_seal by_thief(thief.ring->key(), lane::primary,
                        {both.boat.counters[fingerprint(a_key(1, 5)) + "xbee"]->of, 500},
                        [](const shore_counters&) { return ise::result<void>(); });
    CHECK_FALSE(both.boat.ring->open(radio, by_thief.rekey(a_key(2, 7)).value()));
    both.talk(2);
    CHECK(both.boat.ring->keys().now.secret == a_key(1, 6).secret);
    CHECK(both.obeys(5));
    CHECK_FALSE(both.boat.ring->open(radio, by_thief.seal(command(6)).value()));

    // Older generations, other boats, other types, flipped bits.
    CHECK_FALSE(both.boat.ring->open(radio, seal_recovery(the_recovery_key(), 10, a_key(3))));
    auto of_other = the_recovery_key();
    of_other.boat = "other";
    CHECK_FALSE(both.boat.ring->open(radio, seal_recovery(of_other, 11, a_key(3))));
    auto as_link = the_recovery_key();
    as_link.link = "recovery";
    to_boat_frame frame;
    frame.type = 0x40;
    frame.counter = 12;
    auto plain = command(7);
    frame.content.assign(plain.begin() + 2, plain.end() - 2);
    CHECK_FALSE(both.boat.ring->open(radio, seal_to_boat(as_link, no_session, frame)));
    CHECK_FALSE(open_recovery(the_recovery_key(), seal_to_boat(as_link, no_session, frame)));
    auto good = seal_recovery(the_recovery_key(), 13, a_key(3));
    for (std::size_t bit = 0; bit < good.size() * 8; ++bit) {
        auto bad = good;
        bad[bit / 8] ^= static_cast<std::byte>(1 << bit % 8);
        CHECK_FALSE(both.boat.ring->open(radio, bad));
    }
    CHECK_FALSE(both.boat.ring->keys().next);
    CHECK(both.boat.ring->open(radio, good));
    REQUIRE(both.boat.start(both.first, both.random)); // it remembers the generation
    CHECK_FALSE(both.boat.ring->open(radio, good));
    CHECK(both.boat.ring->keys().next);
}

TEST_CASE("rekey: a boat without a recovery key takes no change by one") {
    pair both;
    REQUIRE(both.boat.start(both.first, both.random, false));
    CHECK_FALSE(both.boat.ring->open(radio, seal_recovery(the_recovery_key(), 1, a_key(1))));
    CHECK_FALSE(both.boat.ring->keys().next);
}

TEST_CASE("rekey: with half of the frames lost, reboots and failing disks nobody is locked out") {
    auto seeds = from_environment("SEAL_SEEDS", 20);
    for (std::uint64_t seed = 1; seed <= seeds; ++seed) {
        INFO("seed " << seed);
        std::mt19937_64 random(seed);
        auto chance = [&](unsigned percent) { return random() % 100 < percent; };
        boat_keys first{a_key(), std::nullopt, false, 0};
        boat_side boat;
        std::array<shore_side, 4> shore; // two nodes with two links each
        radio_keys newest;
        newest.now = a_key();
        int salt = 0;
        std::uint64_t generation = 0;
        auto start_boat = [&] {
            while (!boat.start(first, random)) boat.of.fails_in = -1;
        };
        start_boat();
        for (std::size_t i = 0; i < shore.size(); ++i) {
            shore[i].link = links[i % 2];
            shore[i].lane = i < 2 ? lane::primary : lane::secondary;
            shore[i].file = newest;
            shore[i].start();
        }
        std::set<std::uint32_t> executed;
        std::vector<std::pair<std::size_t, ise::bytes>> sent;
        std::uint32_t id = 0;
        auto to_boat = [&](std::size_t link, const ise::bytes& raw) {
            auto opened = boat.ring->open(link, raw);
            if (!opened || opened->empty()) return;
            auto parsed = parse_telecommand(*opened);
            REQUIRE(parsed);
            REQUIRE(executed.insert(parsed->id).second);
        };
        auto send = [&](std::size_t link, ise::bytes raw, unsigned loss) {
            if (raw.empty()) return;
            sent.emplace_back(link, raw);
            if (!chance(loss)) to_boat(link, raw);
        };
        auto step = [&](std::size_t i, unsigned loss) {
            auto link = i % 2;
            auto& of = shore[i];
            auto heard = boat.ring->seal(link, telemetry());
            if (!chance(loss)) {
                (void)of.ring->open(heard);
                send(link, of.ring->take_question(), loss);
            }
            if (auto sealed = of.ring->seal(command(++id))) send(link, *sealed, loss);
            auto notice = boat.ring->take_notice(link);
            if (notice.empty()) return;
            for (std::size_t each = link; each < shore.size(); each += 2) { // both nodes hear it
                if (chance(loss)) continue;
                (void)shore[each].ring->open(notice);
                send(link, shore[each].ring->take_question(), loss);
            }
        };
        for (int n = 0; n < 400; ++n) {
            auto i = random() % shore.size();
            if (chance(2)) {
                if (chance(20)) boat.counters.clear();
                start_boat();
            }
            if (chance(2)) {
                if (chance(20)) shore[i].counters.clear();
                shore[i].start();
            }
            if (chance(2)) {
                auto& broken = chance(50) ? boat.of : shore[i].of;
                broken.fails_in = static_cast<int>(random() % 4);
                broken.writes_anyway = chance(50);
            }
            bool all_changed = !newest.next;
            if (newest.next) {
                all_changed = true;
                for (auto& each : shore)
                    all_changed = all_changed && each.ring->key().secret == newest.next->secret && each.file.next &&
                                  each.file.next->secret == newest.next->secret;
            }
            if (chance(3) && all_changed) { // the next change, by one key or the other
                if (newest.next) newest.now = *newest.next;
                newest.next = a_key(static_cast<std::uint8_t>((newest.now.epoch + 1) % (max_epoch + 1)), ++salt);
                newest.recovery =
                    chance(30) ? seal_recovery(the_recovery_key(), ++generation, *newest.next) : ise::bytes();
            }
            if (chance(5)) { // the file comes to a node at some time
                shore[i].file = newest;
                shore[i].start();
            }
            step(i, 50);
            if (!sent.empty()) { // what was sent comes again, also changed
                auto [link, again] = sent[random() % sent.size()];
                to_boat(link, again);
                again[random() % again.size()] ^= static_cast<std::byte>(1u << random() % 8);
                auto before = executed.size();
                to_boat(link, again);
                REQUIRE(executed.size() == before);
            }
        }
        boat.of.fails_in = -1;
        for (auto& each : shore) {
            each.of.fails_in = -1;
            each.file = newest; // it has come to all by now
            each.start();
        }
        for (int round = 0; round < 20; ++round)
            for (std::size_t i = 0; i < shore.size(); ++i) step(i, 0);
        const auto& expected = newest.next ? *newest.next : newest.now;
        CHECK(boat.ring->keys().now.secret == expected.secret);
        CHECK_FALSE(boat.ring->keys().next);
        for (std::size_t i = 0; i < shore.size(); ++i) {
            INFO("node and link " << i);
            auto before = executed.size();
            step(i, 0);
            REQUIRE(executed.size() == before + 1);
        }
    }
}

TEST_CASE("key file: a file with a next key is read as it was written, and what does not fit is refused") {
    radio_keys keys;
    keys.now = a_key(63);
    keys.next = a_key(0, 1);
    keys.recovery = seal_recovery(the_recovery_key(), 1'700'000'000, *keys.next);
    auto read = parse_keys(format_keys(keys), "radio.key");
    REQUIRE(read);
    CHECK(read->now.secret == keys.now.secret);
    REQUIRE(read->next);
    CHECK(read->next->secret == keys.next->secret);
    CHECK(read->next->epoch == 0);
    CHECK(read->recovery == keys.recovery);
    auto text = format_key(a_key(1));
    for (const auto& bad :
         {std::string("next-epoch 2\n"), "next " + std::string(64, 'a') + "\n",
          "next-epoch 1\nnext " + std::string(64, 'a') + "\n", "recovery " + std::string(96, 'a') + "\n",
          "next-epoch 2\nnext " + std::string(64, 'a') + "\nrecovery 00\n", std::string("other x\n")}) {
        auto refused = parse_keys(text + bad, "radio.key");
        REQUIRE_FALSE(refused);
        CHECK(refused.error().message().find("aaaa") == std::string::npos);
    }
    for (auto generation : {std::uint64_t{0}, std::uint64_t{1'800'000'000}, max_counter}) {
        auto of_recovery = format_recovery_key({the_recovery_key(), generation});
        auto recovery = parse_recovery_key(of_recovery, "x.recovery");
        REQUIRE(recovery);
        CHECK(recovery->key.secret == the_recovery_key().secret);
        CHECK(recovery->generation == generation);
        CHECK_FALSE(parse_keys(of_recovery, "radio.key"));
    }
    CHECK_FALSE(parse_recovery_key(text, "x.recovery"));
    for (auto bad : {"-1", "x", "", "1099511627776"})
        CHECK_FALSE(parse_recovery_key(format_recovery_key({the_recovery_key(), 0}) + "generation " + bad + "\n",
                                       "x.recovery"));
}

} // namespace rekey_test
