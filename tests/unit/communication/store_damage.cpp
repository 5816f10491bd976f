// What the disk changed is not taken for what was kept.
#include "stores.hpp"

#include <components/communication_node/store_check.hpp>

#include <fstream>
#include <sqlite3.h>

namespace store_damage_test {

using namespace store_test;
using ise_test::Contains;

namespace {

void change(const std::string& file, const std::string& sql) {
    sqlite3* raw = nullptr;
    REQUIRE(sqlite3_open(file.c_str(), &raw) == SQLITE_OK);
    CHECK(sqlite3_exec(raw, sql.c_str(), nullptr, nullptr, nullptr) == SQLITE_OK);
    sqlite3_close(raw);
}

// As a program before there were checksums and lives left it.
void make_old(const std::string& file) {
    constexpr std::string_view schema[] = {
        "CREATE TABLE meta(name TEXT PRIMARY KEY, value INTEGER NOT NULL) WITHOUT ROWID;"
        "CREATE TABLE packets(position INTEGER PRIMARY KEY, boot INTEGER NOT NULL, sequence INTEGER NOT NULL, "
        "measured INTEGER NOT NULL,"
        " link INTEGER NOT NULL, received INTEGER NOT NULL, history INTEGER NOT NULL, kind INTEGER NOT NULL, raw "
        "BLOB NOT NULL,"
        " peer_position INTEGER, UNIQUE(boot, sequence, measured));"
        "CREATE INDEX packets_by_time ON packets(measured);"
        "CREATE INDEX packets_by_kind ON packets(kind, history, measured);"
        "CREATE INDEX packets_at_peer ON packets(peer_position);"
        "CREATE TABLE commands(number INTEGER PRIMARY KEY AUTOINCREMENT, id INTEGER NOT NULL UNIQUE, position "
        "INTEGER NOT NULL, open INTEGER NOT NULL,"
        " asked_by TEXT NOT NULL, changed INTEGER NOT NULL, record TEXT NOT NULL);"
        "CREATE INDEX commands_by_change ON commands(position);"
        "CREATE TABLE authority(epoch INTEGER PRIMARY KEY, change INTEGER NOT NULL, state TEXT NOT NULL)"};
    auto old = ise::database::open(file, schema);
    REQUIRE(old);
    REQUIRE(old->execute("INSERT INTO meta VALUES('store', 4711), ('head', 3), ('commands_head', 1), ('peer', 9), "
                         "('peer_packets', 5), ('peer_commands', 0)"));
    for (const auto& p : packets(1, 3))
        REQUIRE(old->execute("INSERT INTO packets(boot, sequence, measured, link, received, history, kind, raw, "
                             "peer_position) VALUES(?, ?, ?, 0, 0, 0, 1, ?, ?)",
                             {std::int64_t{p.boot}, std::int64_t{p.sequence},
                              std::int64_t{p.measured_at.time_since_epoch().count()}, p.raw,
                              std::int64_t{p.sequence + 2}}));
    REQUIRE(
        old->execute("INSERT INTO commands(id, position, open, asked_by, changed, record) VALUES(7, 1, 1, 'ana', 0, "
                     "'{\"status\":{\"id\":7}}')"));
    REQUIRE(old->execute("INSERT INTO authority VALUES(6, 1, '{\"holder\":\"ana\",\"epoch\":6}')"));
}

} // namespace

TEST_CASE("node store: a packet that the disk changed is refused wherever it is read, and told by its position") {
    folder there;
    {
        auto store = opened(there.file(), 100);
        store.add(packets(1, 5)).value();
    }
    CHECK(check_store(there.file())->sound);
    auto column = GENERATE(as<std::string>(), "raw = x'010104'", "measured = measured + 64", "received = received + 1",
                           "link = 2", "boot = 4", "peer_position = 3");
    CAPTURE(column);
    change(there.file(), "UPDATE packets SET " + column + " WHERE position = 3");
    auto checked = check_store(there.file());
    REQUIRE(checked);
    CHECK_FALSE(checked->sound);
    CHECK_THAT(checked->text, Contains("1 packets differ from their checksums, at positions 3\n"));
    auto store = opened(there.file(), 200);
    CHECK(store.packets(0, 2, 10).value().size() == 2);
    for (const auto& why : {store.packets(0, 5, 10).error(), store.page_after(1, 0, 0, 10).error(),
                            store.track(track_request(), 5).error()}) {
        CHECK(why.code() == ise::errc::malformed);
        CHECK_THAT(why.message(), Contains(there.file()) && Contains("packet 3 is damaged"));
    }
    CHECK(store.packets(3, 5, 10).value().size() == 2);
}

TEST_CASE("node store: what is known of a damaged packet does not become sound by being written again") {
    folder there;
    auto b = opened("memory:again-b", 200);
    auto a = opened(there.file(), 100);
    a.add(packets(1, 3)).value();
    CHECK(pull(b, a) == 3);
    change(there.file(), "UPDATE packets SET raw = x'0101' WHERE position = 2");
    auto shared = b.shared(a.known_of_peer());
    auto page = b.page_after(a.number(), shared.packets, shared.commands, 100).value();
    auto applied = a.apply(page, {}, false);
    REQUIRE_FALSE(applied);
    CHECK(applied.error().code() == ise::errc::malformed);
    CHECK_FALSE(check_store(there.file())->sound);
}

TEST_CASE("node store: telecommands, authority and positions that the disk changed are refused as well") {
    folder there;
    {
        auto store = opened(there.file(), 100);
        auto one = record(1);
        REQUIRE(store.put(std::span(&one, 1)));
        authority_state held;
        held.holder = "ana";
        held.epoch = 6;
        REQUIRE(store.put(held, 1));
        store.add(packets(1, 1)).value();
    }
    SECTION("a telecommand") {
        change(there.file(), "UPDATE commands SET open = 0");
        CHECK(opened(there.file(), 1).command(1).error().code() == ise::errc::malformed);
    }
    SECTION("the authority") {
        change(there.file(), "UPDATE authority SET change = 9");
        CHECK(opened(there.file(), 1).remembered().error().code() == ise::errc::malformed);
    }
    SECTION("how far it is") {
        change(there.file(), "UPDATE meta SET value = 17 WHERE name = 'head'");
        CHECK(sqlite_store::open(there.file(), 1).error().code() == ise::errc::malformed);
    }
    CHECK_FALSE(check_store(there.file())->sound);
}

TEST_CASE("node store: a file without checksums is taken over whole, and its packets get theirs") {
    folder there;
    make_old(there.file());
    auto before = check_store(there.file());
    REQUIRE(before);
    CHECK(before->sound);
    CHECK_THAT(before->text, Contains("3 packets have no checksum yet"));
    {
        auto store = opened(there.file(), 300);
        CHECK(store.number() == 301);
        CHECK(store.origin() == 4711);
        CHECK(store.head() == 3);
        CHECK(store.peer().packets == 5);
        CHECK(store.command(7).value()->status.id == 7);
        CHECK(store.remembered()->authority.first.holder == "ana");
        // What the other node knew of it before goes on.
        store_part known;
        known.store = 4711;
        known.packets = 2;
        CHECK(store.shared(known).packets == 2);
        CHECK(sequences(store.packets(0, 10, 10).value()) == numbers{1, 2, 3});
        CHECK(store.seal().value() == 3);
        CHECK(store.seal().value() == 0);
        CHECK(store.packets(0, 10, 10).value().at(0).peer_position == 3);
        auto other = packet(2);
        other.raw.back() = std::byte{99};
        CHECK(store.add(std::span(&other, 1)).value().fresh == 1);
        CHECK(store.add(packets(1, 3)).value().fresh == 0);
        CHECK(sequences(store.packets(0, 10, 10).value()) == numbers{1, 2, 3, 2});
    }
    auto after = check_store(there.file());
    CHECK(after->sound);
    CHECK_THAT(after->text, !Contains("no checksum yet"));
    change(there.file(), "UPDATE packets SET raw = x'0101' WHERE position = 2");
    CHECK_FALSE(check_store(there.file())->sound);
}

TEST_CASE("node store: a file that told packets by their numbers only is taken over with its checksums") {
    folder there;
    { // as the program before this one left it
        auto store = opened(there.file(), 100);
        store.add(packets(1, 3)).value();
    }
    change(there.file(),
           "CREATE TABLE before(position INTEGER PRIMARY KEY, boot INTEGER NOT NULL, sequence INTEGER NOT NULL, "
           "measured INTEGER NOT NULL, link INTEGER NOT NULL, received INTEGER NOT NULL, history INTEGER NOT NULL, "
           "kind INTEGER NOT NULL, raw BLOB NOT NULL, peer_position INTEGER, sum INTEGER, "
           "UNIQUE(boot, sequence, measured));"
           "INSERT INTO before SELECT * FROM packets; DROP TABLE packets; ALTER TABLE before RENAME TO packets;"
           "CREATE INDEX packets_by_time ON packets(measured);"
           "CREATE INDEX packets_by_kind ON packets(kind, history, measured);"
           "CREATE INDEX packets_at_peer ON packets(peer_position);"
           "CREATE INDEX packets_without_sum ON packets(position) WHERE sum IS NULL; PRAGMA user_version = 2");
    bool damaged = GENERATE(false, true);
    if (damaged) change(there.file(), "UPDATE packets SET link = 2 WHERE position = 2");
    auto store = opened(there.file(), 200);
    auto other = packet(1);
    other.raw.back() = std::byte{99};
    CHECK(store.add(std::span(&other, 1)).value().last == 4);
    CHECK(store.packets(2, 10, 10).value().size() == 2);
    CHECK(store.packets(0, 10, 10).has_value() != damaged); // migration makes nothing sound
    auto checked = check_store(there.file());
    REQUIRE(checked);
    CHECK(checked->sound != damaged);
    CHECK_THAT(checked->text, !Contains("no checksum yet"));
}

TEST_CASE("node store: of a file with a broken page everything else is read") {
    folder there;
    constexpr std::uint32_t many = 3000;
    {
        auto store = opened(there.file(), 100);
        store.add(packets(1, many)).value();
        auto one = record(1);
        REQUIRE(store.put(std::span(&one, 1)));
    }
    auto pages = std::filesystem::file_size(there.file()) / 4096;
    std::string noise(4096, '\x5a');
    {
        std::fstream disk(there.file(), std::ios::in | std::ios::out | std::ios::binary);
        auto leaf =
            ise::database::open_to_read(there.file())
                ->query("SELECT pageno FROM dbstat WHERE name = 'packets' AND pagetype = 'leaf' LIMIT 1 OFFSET 20");
        auto page = leaf ? leaf->at(0).integer(0) : static_cast<std::int64_t>(pages / 2);
        disk.seekp((page - 1) * 4096);
        disk.write(noise.data(), 4096);
    }
    auto reader = store_reader::open(there.file());
    REQUIRE(reader);
    std::size_t read = 0;
    for (auto some = reader->next_packets(256); !some.empty(); some = reader->next_packets(256)) read += some.size();
    CHECK(read > many - 300);
    CHECK(read < many);
    CHECK(reader->next_commands(10).size() == 1);
    CHECK_FALSE(reader->found().unreadable.empty());
    CHECK_FALSE(check_store(there.file())->sound);
}

TEST_CASE("node store: a file that is no store of a node is named as that") {
    folder there;
    CHECK(check_store(there.file()).error().code() == ise::errc::io_failed);
    CHECK_FALSE(std::filesystem::exists(there.file()));
    change(there.file(), "CREATE TABLE something(x)");
    CHECK_THAT(check_store(there.file()).error().message(), Contains("is not a store of a communication node"));
    std::ofstream(there.backup()) << std::string(5000, 'x');
    CHECK(check_store(there.backup()).error().code() == ise::errc::malformed);
}

} // namespace store_damage_test
