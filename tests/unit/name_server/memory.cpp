// What a name server knows of the one before: whose names were granted, and up to which epoch.
#include "system.hpp"

#include <ise/core/real/environment.hpp>
#include <ise/name_server/server_memory.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <cstdio>
#include <filesystem>
#include <fstream>

#include <sys/stat.h>

namespace memory_test {

using namespace names_test;
using ise::naming::verdict;

namespace {

constexpr ise::time_point start{1h};
const ise::wall_time noon = std::chrono::sys_days(std::chrono::year(2026) / 6 / 1) + 12h;

// A registry in each of its lives, and the nodes that talk to it.
struct lives {
    void begin(ise::wall_time wall, bool remembers = true) {
        if (names) memory.epochs_below = names->last_epoch() + 1;
        if (!remembers) memory = ise::registry_memory();
        if (!memory.of_former) memory.secret = {++secrets, 7};
        ise::registry_options options;
        options.recovery = first ? 0s : 2s;
        names.emplace(options, ++incarnation, now, wall, memory);
        memory.of_former = true;
        first = false;
    }
    void pass(ise::duration time) {
        for (auto end = now + time; now < end;) {
            now = std::min(end, now + names->tick());
            names->advance(now);
        }
    }
    ise::naming::register_request request_of(std::uint64_t node, const std::string& path, std::uint64_t epoch = 0,
                                             std::uint64_t proof = 0) {
        ise::naming::register_request request;
        request.node.lease_key = node;
        request.lease = 2s;
        auto& claim = request.components.emplace_back();
        claim.path = path;
        claim.incarnation = node * 10;
        claim.epoch = epoch;
        claim.proof = proof;
        return request;
    }
    ise::naming::grant claim(std::uint64_t node, const std::string& path) {
        return names->enroll(request_of(node, path), now).grants.at(0);
    }
    // Comes back with what it was granted.
    ise::naming::grant show(std::uint64_t node, const ise::naming::grant& held) {
        return names->enroll(request_of(node, held.path, held.epoch, held.proof), now).grants.at(0);
    }
    // Shows an epoch with any proof.
    ise::naming::grant forge(const std::string& path, std::uint64_t epoch, std::uint64_t proof = 1) {
        return names->enroll(request_of(66, path, epoch, proof), now).grants.at(0);
    }

    ise::time_point now = start;
    std::optional<ise::registry> names;
    ise::registry_memory memory;
    std::uint64_t secrets = 0, incarnation = 0;
    bool first = true;
};

// Of a name server in the virtual world: lies on its host's disk, so to speak.
struct disk final : ise::server_memory {
    std::optional<ise::registry_memory> kept;
    ise::result<std::optional<ise::registry_memory>> load() override {
        auto found = kept;
        if (found) found->of_former = true;
        return found;
    }
    ise::result<void> keep(const ise::registry_memory& what) override {
        kept = what;
        return {};
    }
};

} // namespace

TEST_CASE("memory: after a restart a held name is its holder's, whoever shows the next epoch, before or after it") {
    lives it;
    it.begin(noon);
    auto held = it.claim(1, "boat");
    it.begin(noon + 10s);
    auto above = GENERATE(std::uint64_t{0}, std::uint64_t{1}, std::uint64_t{1'000'000'000});
    CAPTURE(above);
    auto early = it.forge("boat", held.epoch + above);
    CHECK(early.what == verdict::wait);
    CHECK(it.forge("boat", held.epoch, held.proof).what == verdict::wait); // overheard: it is of use to that node only
    it.pass(1s);
    CHECK(it.show(1, held).what == verdict::granted);
    CHECK(it.forge("boat", held.epoch + above).what == verdict::superseded);
    it.pass(900ms);
    it.names->renew({1}, it.now);
    it.pass(900ms);
    CHECK(it.forge("boat", held.epoch + above).what == verdict::superseded);
    CHECK(it.names->renew({1}, it.now).lost.empty());
    CHECK(it.names->resolve("boat", it.now).value().epoch == held.epoch);
}

TEST_CASE("memory: of two that can show a grant the later one has the name, in either order") {
    lives it;
    it.begin(noon);
    auto earlier = it.claim(1, "boat");
    it.pass(5s);
    auto later = it.claim(2, "boat");
    bool clock_went_back = GENERATE(false, true);
    it.begin(clock_went_back ? noon - std::chrono::days(1) : noon + 10s);
    if (GENERATE(false, true)) {
        CHECK(it.show(1, earlier).what == verdict::granted);
        CHECK(it.show(2, later).what == verdict::granted);
        CHECK(it.names->renew({1}, it.now).lost.size() == 1);
    } else {
        CHECK(it.show(2, later).what == verdict::granted);
        CHECK(it.show(1, earlier).what == verdict::superseded);
    }
    CHECK(it.names->resolve("boat", it.now).value().epoch == later.epoch);
}

TEST_CASE("memory: who cannot show its grant waits out the recovery, and is a newcomer then") {
    lives it;
    it.begin(noon);
    auto held = it.claim(1, "boat");
    it.begin(noon + 10s);
    held.proof = 0; // of an earlier version
    CHECK(it.show(1, held).what == verdict::wait);
    it.pass(2s);
    auto back = it.show(1, held);
    CHECK(back.what == verdict::granted);
    CHECK(back.epoch > held.epoch);
}

TEST_CASE("memory: an epoch of a name that is free is its last holder's only") {
    lives it;
    it.begin(noon);
    auto held = it.claim(1, "boat");
    it.pass(5s); // its lease is over
    SECTION("that comes back") { CHECK(it.show(1, held).epoch == held.epoch); }
    SECTION("and not of one that has read it in a list") { CHECK(it.forge("boat", held.epoch).epoch > held.epoch); }
}

TEST_CASE("memory: without it nobody can show a former grant, and with it epochs survive a clock that goes back") {
    lives it;
    it.begin(noon);
    auto held = it.claim(1, "boat");
    it.names->withdraw(ise::naming::withdraw_request{1, {{"boat", 10}}}, it.now);
    bool remembers = GENERATE(true, false);
    it.begin(noon - std::chrono::days(1), remembers);
    it.pass(2s); // nobody comes back
    auto next = it.claim(2, "boat");
    CHECK((next.epoch > held.epoch) == remembers);
}

TEST_CASE("memory: without it, and with a clock that goes back, the later of two former grants wins all the same") {
    lives it;
    it.begin(noon);
    auto earlier = it.claim(1, "boat");
    it.pass(5s);
    auto later = it.claim(2, "boat");
    it.begin(noon - std::chrono::days(1), false);
    CHECK(it.show(1, earlier).what == verdict::granted);
    CHECK(it.show(2, later).what == verdict::granted);
    CHECK(it.names->resolve("boat", it.now).value().epoch == later.epoch);
    it.pass(1s);
    it.names->renew({2}, it.now);
    it.pass(1s);
    CHECK(it.claim(3, "buoy").epoch > later.epoch);
}

TEST_CASE("memory: a name server keeps it ahead of what it grants, and the next one goes on from there") {
    auto kept = std::make_shared<disk>();
    names_test::system it(true, 1, ise::registry_limits(), kept);
    it.start_doubler("boat", "atirma/doubler");
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    REQUIRE(kept->kept);
    auto before = *kept->kept;
    auto epoch = it.epoch_of("atirma/doubler");
    CHECK(before.epochs_below > epoch);

    // A thief that is there before the holder is back.
    it.world.net().partition("boat", "ns");
    it.restart_server();
    verdict thief = verdict::granted;
    bool answered = false;
    it.start_body("elsewhere", "thief", [&](ise::component& self) -> ise::task<> {
        ise::naming::register_request request;
        request.node.lease_key = 99;
        request.lease = 2s;
        ise::naming::component_claim claim;
        claim.path = "atirma/doubler";
        claim.epoch = epoch + 1;
        request.components.push_back(claim);
        auto server = name_server_of(self);
        auto answer = co_await server.try_call(ise::naming::enroll, request, 1s);
        if (answer) thief = answer->grants.at(0).what;
        answered = answer.has_value();
    });
    REQUIRE(it.world.run_until([&] { return answered; }, 5s));
    CHECK(thief == verdict::wait);
    it.world.net().heal("boat", "ns");
    REQUIRE(it.world.run_until([&] { return it.holds("atirma/doubler"); }, 5s));
    it.world.run_for(5s);
    CHECK(it.epoch_of("atirma/doubler") == epoch);
    CHECK(kept->kept->secret == before.secret);
    CHECK(kept->kept->epochs_below > before.epochs_below);
}

TEST_CASE("memory: the file is whole, its user's own, and refused where it is not") {
    ise::real_environment env;
    auto folder = std::filesystem::temp_directory_path() / fmt::format("ise-memory-{:016x}", env.random());
    struct leaving {
        std::filesystem::path what;
        ~leaving() { std::filesystem::remove_all(what); }
    } guard{folder};
    auto path = (folder / "deep" / "names.json").string();
    ise::state_file file(env, path);
    REQUIRE(file.load());
    CHECK_FALSE(file.load().value());
    CHECK(file.probe());
    ise::registry_memory memory;
    memory.secret = {~std::uint64_t{0}, 5};
    memory.epochs_below = 1'780'000'000'000'001;
    REQUIRE(file.keep(memory));
    auto read = file.load().value();
    REQUIRE(read);
    CHECK(read->secret == memory.secret);
    CHECK(read->epochs_below == memory.epochs_below);
    CHECK(read->of_former);
    struct stat about {};
    REQUIRE(::stat(path.c_str(), &about) == 0);
    CHECK((about.st_mode & 0777) == 0600);

    SECTION("one that others can read") {
        ::chmod(path.c_str(), 0644);
        CHECK(file.load().error().code() == ise::errc::unauthorized);
        CHECK(file.probe().error().code() == ise::errc::unauthorized);
    }
    SECTION("one that others can replace") {
        ::chmod((folder / "deep").c_str(), 0777);
        CHECK(file.load().error().code() == ise::errc::unauthorized);
        CHECK(file.keep(memory).error().code() == ise::errc::unauthorized);
    }
    SECTION("a link that others left where the new one is written") {
        auto victim = (folder / "victim").string();
        std::ofstream(victim) << "mine";
        std::filesystem::create_symlink(victim, path + ".new");
        REQUIRE(file.keep(memory));
        std::string content;
        std::ifstream(victim) >> content;
        CHECK(content == "mine");
        CHECK(file.load().value());
    }
    SECTION("one that is none") {
        std::ofstream(path) << "{";
        ::chmod(path.c_str(), 0600);
        CHECK(file.load().error().code() == ise::errc::malformed);
    }
}

} // namespace memory_test
