#include <ise/database/database.hpp>

#include <ise/core/real/environment.hpp>

#include <support/catch.hpp>
#include <support/damaged_file.hpp>

#include <filesystem>
#include <fstream>
#include <sys/stat.h>
#include <unistd.h>

namespace database_test {

using ise::database;
using namespace std::string_view_literals;

namespace {

constexpr std::string_view first_schema[] = {
    "CREATE TABLE packets (id INTEGER PRIMARY KEY, text TEXT UNIQUE, raw BLOB, value REAL)"sv};
constexpr std::string_view second_schema[] = {first_schema[0],
                                              "ALTER TABLE packets ADD COLUMN link INTEGER DEFAULT 3"sv};

/// A folder that goes with the test.
struct folder {
    std::filesystem::path path =
        std::filesystem::temp_directory_path() / ("ise-database-" + std::to_string(::getpid()));
    folder() { std::filesystem::create_directories(path); }
    ~folder() { std::filesystem::remove_all(path); }
    std::string file() const { return (path / "boat.db").string(); }
};

database opened(const std::string& file, std::span<const std::string_view> schema = first_schema) {
    auto made = database::open(file, schema);
    REQUIRE(made);
    return std::move(*made);
}

std::vector<std::byte> blob(char of) { return std::vector<std::byte>(100, std::byte{static_cast<unsigned char>(of)}); }
const std::chrono::system_clock::time_point noon{std::chrono::hours(400'000)};

std::int64_t count(database& in) { return in.query("SELECT count(*) FROM packets").value().at(0).integer(0); }

} // namespace

TEST_CASE("what was written to a database is read back by the next opening of the file") {
    folder there;
    std::vector<std::byte> raw{std::byte{0}, std::byte{0xff}};
    {
        auto db = opened(there.file());
        REQUIRE(db.execute("INSERT INTO packets(text, raw, value) VALUES (?, ?, ?)",
                           {std::string("gr\xc3\xbc\xc3\x9f"), raw, 2.5})
                    .value() == 1);
        CHECK(db.last_insert_id() == 1);
        REQUIRE(db.execute("INSERT INTO packets(raw) VALUES (?)", {std::vector<std::byte>()}));
    }
    auto db = opened(there.file());
    auto rows = db.query("SELECT text, raw, value, id FROM packets ORDER BY id").value();
    REQUIRE(rows.size() == 2);
    CHECK(rows[0].text(0) == "gr\xc3\xbc\xc3\x9f");
    CHECK(rows[0].bytes(1) == raw);
    CHECK(rows[0].real(2) == 2.5);
    CHECK(rows[1].is_null(0));
    CHECK_FALSE(rows[1].is_null(1));
    CHECK(rows[1].bytes(1).empty());
}

TEST_CASE("a transaction happens whole or not at all") {
    auto db = opened("memory:transaction");
    REQUIRE(db.begin());
    REQUIRE(db.execute("INSERT INTO packets(text) VALUES ('a')"));
    db.rollback();
    CHECK(count(db) == 0);
    REQUIRE(db.begin());
    REQUIRE(db.execute("INSERT INTO packets(text) VALUES ('a')"));
    auto twice = db.execute("INSERT INTO packets(text) VALUES ('a')");
    REQUIRE_FALSE(twice);
    CHECK(twice.error().code() == ise::errc::io_failed);
    CHECK(twice.error().message().find("UNIQUE") != std::string::npos);
    REQUIRE(db.commit());
    CHECK(count(db) == 1);
}

TEST_CASE("a function in a transaction writes everything or, if it fails or throws, nothing") {
    auto db = opened("memory:function");
    auto put = [&](const char* text) {
        return db.execute("INSERT INTO packets(text) VALUES (?)", {std::string(text)});
    };
    CHECK(db.transaction([&] { return put("a"); }).value() == 1);
    auto twice = db.transaction([&] {
        CHECK(put("b"));
        return put("a");
    });
    CHECK(twice.error().message().find("UNIQUE") != std::string::npos);
    auto throws = [&]() -> ise::result<void> {
        put("c").value();
        throw ise::error(ise::errc::refused, "no");
    };
    CHECK_THROWS_AS(db.transaction(throws), ise::error);
    CHECK(count(db) == 1);
    CHECK(db.transaction([&] { return put("d"); })); // none of them is open still
    CHECK(count(db) == 2);
}

TEST_CASE("a file grows with its schema and an older program refuses it") {
    folder there;
    REQUIRE(opened(there.file()).execute("INSERT INTO packets(text) VALUES ('a')"));
    auto grown = opened(there.file(), second_schema);
    CHECK(grown.query("SELECT link FROM packets").value().at(0).integer(0) == 3);
    auto older = database::open(there.file(), first_schema);
    REQUIRE_FALSE(older);
    CHECK(older.error().code() == ise::errc::invalid_argument);
    CHECK(older.error().message().find(there.file()) != std::string::npos);
}

TEST_CASE("a database in memory is shared by its openings and goes with the last") {
    {
        auto held = opened("memory:disk");
        REQUIRE(opened("memory:disk").execute("INSERT INTO packets(text) VALUES ('a')"));
        CHECK(count(held) == 1);
    }
    auto again = opened("memory:disk");
    CHECK(count(again) == 0);
}

TEST_CASE("a database that another user could replace is refused") {
    if (::geteuid() != 0) return; // only root can give a folder away
    std::string folder = "/tmp/ise-storage-XXXXXX";
    REQUIRE(::mkdtemp(folder.data()));
    auto file = folder + "/boat.db";
    REQUIRE(database::open(file, first_schema));
    REQUIRE(::chown(file.c_str(), 54321, 54321) == 0);
    CHECK(database::open(file, first_schema).error().code() == ise::errc::unauthorized);
    REQUIRE(::chown(file.c_str(), 0, 0) == 0);
    REQUIRE(::chown(folder.c_str(), 54321, 54321) == 0);
    auto refused = database::open(folder + "/new.db", first_schema);
    CHECK(refused.error().code() == ise::errc::unauthorized);
    CHECK(refused.error().message().find("new.db") != std::string::npos);
    std::filesystem::remove_all(folder);
}

TEST_CASE("a database that cannot be opened says which file and why") {
    auto refused = database::open("/nowhere/at/all/boat.db", first_schema);
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::io_failed);
    CHECK(refused.error().message().find("/nowhere/at/all/boat.db") != std::string::npos);

    folder there;
    {
        std::ofstream(there.file())
            << "this is no database, and it is longer than a header of one would have to be, is it not?";
    }
    auto foreign = database::open(there.file(), first_schema);
    REQUIRE_FALSE(foreign);
    CHECK(foreign.error().code() == ise::errc::malformed);
}

TEST_CASE("a database file and its log belong to their owner alone, also one that was open to others before") {
    folder there;
    auto mode = [&](const char* part) {
        return std::filesystem::status(there.file() + part).permissions() & std::filesystem::perms::all;
    };
    constexpr auto owner = std::filesystem::perms::owner_read | std::filesystem::perms::owner_write;
    auto before = ::umask(0);
    {
        auto db = opened(there.file());
        REQUIRE(db.execute("INSERT INTO packets(text) VALUES ('a')"));
        CHECK(mode("") == owner);
        CHECK(mode("-wal") == owner);
        CHECK(mode("-shm") == owner);
        for (const auto* part : {"", "-wal", "-shm"})
            std::filesystem::permissions(there.file() + part, owner | std::filesystem::perms::others_read);
        std::filesystem::copy_file(there.file(), there.file() + ".kept");
        std::filesystem::copy_file(there.file() + "-wal", there.file() + ".kept-wal");
    }
    std::filesystem::permissions(there.file() + ".kept", owner | std::filesystem::perms::others_read);
    std::filesystem::permissions(there.file() + ".kept-wal", owner | std::filesystem::perms::others_read);
    auto again = opened(there.file() + ".kept");
    CHECK(count(again) == 1);
    CHECK(mode(".kept") == owner);
    CHECK(mode(".kept-wal") == owner);
    ::umask(before);
}

TEST_CASE("a copy of a database holds what it held then, and can be put back while the database is open") {
    auto held = opened("memory:copied"), backup = opened("memory:backup");
    REQUIRE(held.execute("INSERT INTO packets(text) VALUES ('a')"));
    REQUIRE(database::copy("memory:copied", "memory:backup"));
    REQUIRE(held.execute("INSERT INTO packets(text) VALUES ('b')"));
    CHECK(count(backup) == 1);
    REQUIRE(database::copy("memory:backup", "memory:copied"));
    CHECK(count(held) == 1);
    CHECK_FALSE(database::copy("/nowhere/at/all.db", "memory:copied"));
}

TEST_CASE("a damaged database is replaced when a call meets the damage, and what can be read is kept") {
    damaged_file::folder disk("replaced");
    {
        auto db = opened(disk.file());
        for (int i = 0; i < 400; ++i)
            REQUIRE(db.execute("INSERT INTO packets(raw) VALUES (?)", {blob(i < 150 || i > 250 ? 'a' : 'b')}));
    }
    damaged_file::overwrite_pages_with(disk.file(), blob('b'));
    ise::real_environment env;
    damaged_file::log_lines log;
    ise::when_damaged how(ise::logger(env, "atirma/boat", log.sink()), [] { return noon; });
    int begun = 0;
    how.begun = [&](database& fresh, const std::string& aside) {
        ++begun;
        CHECK(aside == disk.set_aside().at(0));
        CHECK(count(fresh) > 200);
    };
    auto db = database::open(disk.file(), first_schema, ise::when_damaged::keeping_readable(how)).value();
    CHECK(begun == 0);
    SECTION("by a query, which is made once more") {
        auto rows = db.query("SELECT raw FROM packets");
        REQUIRE(rows);
        for (const auto& row : *rows) CHECK(row.bytes(0) == blob('a'));
    }
    SECTION("by a write, which is made once more") {
        auto changed = db.execute("UPDATE packets SET value = 1");
        REQUIRE(changed);
        CHECK(*changed == count(db));
    }
    SECTION("within a transaction, of which nothing is kept") {
        REQUIRE(db.begin());
        REQUIRE(db.execute("INSERT INTO packets(text) VALUES ('lost')"));
        auto met = db.execute("UPDATE packets SET value = 1");
        REQUIRE_FALSE(met);
        CHECK(met.error().code() == ise::errc::malformed);
        db.rollback();
        CHECK(db.query("SELECT 1 FROM packets WHERE text = 'lost'").value().empty());
        REQUIRE(db.execute("INSERT INTO packets(text) VALUES ('kept')"));
    }
    CHECK(begun == 1);
    CHECK(count(db) > 200);
    CHECK(log.errors.find(disk.set_aside().at(0)) != std::string::npos);
}

TEST_CASE("a file that is no database is replaced when it is opened, where its user asked for it") {
    damaged_file::folder disk("opening");
    damaged_file::write_garbage(disk.file());
    CHECK(database::open(disk.file(), first_schema).error().code() == ise::errc::malformed);
    CHECK(disk.set_aside().empty());
    ise::when_damaged how(ise::logger(), [] { return noon; });
    auto db = database::open(disk.file(), first_schema, how);
    REQUIRE(db);
    CHECK(count(*db) == 0);
    CHECK(disk.set_aside().size() == 1);
}

TEST_CASE("a database that is set aside keeps everything under another name, and makes room for a new one") {
    folder there;
    ise::real_environment env;
    const ise::failure why(ise::errc::malformed, "page 7 is torn");
    std::string aside;
    for (int round = 0; round < 2; ++round) {
        {
            auto db = opened(there.file());
            CHECK(count(db) == 0);
            REQUIRE(db.execute("INSERT INTO packets(text) VALUES ('a')"));
            db.close();
            CHECK_FALSE(db.is_open());
            auto closed = db.query("SELECT 1");
            REQUIRE_FALSE(closed);
            CHECK(closed.error().code() == ise::errc::io_failed);
        }
        damaged_file::log_lines log;
        auto moved = ise::set_aside(there.file(), why, noon, ise::logger(env, "atirma/boat", log.sink()));
        REQUIRE(moved);
        CHECK(*moved != aside);
        CHECK(moved->find(there.file() + ".damaged-") == 0);
        CHECK(log.errors.find(*moved) != std::string::npos);
        CHECK(log.errors.find("page 7 is torn") != std::string::npos);
        aside = *moved;
        auto kept = opened(aside);
        CHECK(count(kept) == 1);
    }
    CHECK_FALSE(ise::set_aside(there.file() + "/nothing/there", why, noon, ise::logger()));
}

TEST_CASE("the sum of a row differs where a bit, a type or the place of a byte differs") {
    auto db = opened("memory:sums");
    auto sum = [&](const std::string& values) {
        return db.query("SELECT row_sum(" + values + ")").value().at(0).integer(0);
    };
    CHECK(sum("1, 'ab', x'00', 2.5, NULL") == sum("1, 'ab', x'00', 2.5, NULL"));
    CHECK(sum("1") != sum("2"));
    CHECK(sum("1") != sum("'1'"));
    CHECK(sum("'ab', 'c'") != sum("'a', 'bc'"));
    CHECK(sum("NULL, 1") != sum("1, NULL"));
    CHECK(sum("x'00'") != sum("x'0000'"));
}

TEST_CASE("a full disk is told and what was there stays") {
    folder there;
    auto db = opened(there.file());
    REQUIRE(db.execute("INSERT INTO packets(text) VALUES ('kept')"));
    REQUIRE(db.query("PRAGMA max_page_count=8")); // as full as a disk can be made here without one of its own
    std::vector<std::byte> big(100'000);
    auto refused = db.execute("INSERT INTO packets(raw) VALUES (?)", {big});
    REQUIRE_FALSE(refused);
    CHECK(refused.error().message().find("full") != std::string::npos);
    CHECK(count(db) == 1);
}

} // namespace database_test
