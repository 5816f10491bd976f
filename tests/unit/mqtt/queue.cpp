// What waits for the broker, and which requests were executed: over lives, on a full and on a damaged disk.
#include <components/mqtt_bridge/call_journal.hpp>
#include <components/mqtt_bridge/outgoing_queue.hpp>

#include <support/catch.hpp>
#include <support/damaged_file.hpp>

#include <algorithm>
#include <filesystem>
#include <fstream>
#include <string>
#include <vector>

namespace {

using namespace ise::mqtt;
using namespace std::chrono_literals;
using ise::database;

const ise::wall_time noon{std::chrono::hours(24 * 365 * 50)};
const ise::time_point later = ise::time_point::max();

/// One life of a queue on a file.
struct life {
    explicit life(const std::string& file, queue_limits limits = queue_limits())
        : db(database::open(file, bridge_schema).value()), queue(outgoing_queue::open(db, limits).value()) {}
    void push(int first, int last, std::size_t bytes = 0) {
        for (int n = first; n <= last; ++n) {
            queued_message one;
            one.topic = "t";
            one.payload = std::to_string(n) + std::string(bytes, ' ');
            one.published = noon + std::chrono::seconds(n);
            queue.push(std::move(one), {}, noon);
        }
    }
    /// Sends and confirms what there is, in order.
    std::vector<int> send_all(std::vector<std::uint64_t>* numbers = nullptr) {
        std::vector<int> made;
        while (const auto* one = queue.next()) {
            auto number = one->what.number;
            made.push_back(std::stoi(one->what.payload));
            CHECK(one->what.published == noon + std::chrono::seconds(made.back()));
            if (numbers) numbers->push_back(number);
            queue.sent(number);
            queue.done(number);
        }
        return made;
    }
    database db;
    outgoing_queue queue;
};

std::vector<int> from_to(int first, int last) {
    std::vector<int> made;
    for (int n = first; n <= last; ++n) made.push_back(n);
    return made;
}

} // namespace

TEST_CASE("queue: what is confirmed at once never comes to the disk, and the order is that of publication") {
    life one("memory:mqtt-quick");
    one.push(1, 1000);
    std::vector<std::uint64_t> numbers;
    CHECK(one.send_all(&numbers) == from_to(1, 1000));
    CHECK(std::is_sorted(numbers.begin(), numbers.end()));
    REQUIRE(one.queue.store(later));
    CHECK(one.queue.disk_bytes() == 0);
    CHECK(one.queue.waiting() == 0);
}

TEST_CASE("queue: a later life sends what an earlier one stored, once and in order, with numbers that grow") {
    damaged_file::folder disk("mqtt");
    const auto file = disk.file();
    std::vector<std::uint64_t> numbers;
    {
        life first(file);
        first.push(1, 700);
        REQUIRE(first.queue.store(later));
        first.push(701, 900);
        REQUIRE(first.queue.store(later));
        for (int n = 1; n <= 100; ++n) { // in flight: some are confirmed, and not removed yet
            auto number = first.queue.next()->what.number;
            first.queue.sent(number);
            if (n <= 50) first.queue.done(number);
            if (n <= 50) numbers.push_back(number);
        }
        REQUIRE(first.queue.store(later));
        first.push(901, 950); // lost with this life: not stored
    }
    life second(file);
    CHECK(second.queue.waiting() == 850);
    second.push(1001, 1100);
    auto sent = second.send_all(&numbers);
    auto wanted = from_to(51, 900);
    for (int n = 1001; n <= 1100; ++n) wanted.push_back(n);
    CHECK(sent == wanted);
    CHECK(std::is_sorted(numbers.begin(), numbers.end()));
    CHECK(std::adjacent_find(numbers.begin(), numbers.end()) == numbers.end());
    REQUIRE(second.queue.store(later));
    CHECK(second.queue.disk_bytes() == 0);
}

TEST_CASE("queue: what was sent over a connection that ended is sent again, marked, and nothing overtakes it") {
    life one("memory:mqtt-again");
    one.push(1, 10);
    for (int n = 0; n < 10; ++n) one.queue.sent(one.queue.next()->what.number);
    CHECK(one.queue.next() == nullptr);
    one.queue.lost();
    const auto* first = one.queue.next();
    REQUIRE(first);
    CHECK(first->sent_before);
    const auto number = first->what.number;
    one.queue.sent(number);
    one.queue.again(number);
    CHECK(one.queue.next()->what.number == number);
    one.push(11, 12);
    CHECK(one.send_all() == from_to(1, 12));
}

TEST_CASE("queue: at most a window is in flight") {
    queue_limits limits;
    limits.window = 16;
    life one("memory:mqtt-window", limits);
    one.push(1, 100);
    int sent = 0;
    while (const auto* next = one.queue.next()) one.queue.sent(next->what.number), ++sent;
    CHECK(sent == 16);
}

TEST_CASE("queue: beyond its room on disk the oldest go, and are counted") {
    queue_limits limits;
    limits.disk_bytes = 100'000;
    life one("memory:mqtt-bounded", limits);
    for (int n = 1; n <= 500; ++n) {
        one.push(n, n, 1000);
        REQUIRE(one.queue.store(later));
        CHECK(one.queue.disk_bytes() <= limits.disk_bytes);
    }
    const auto kept = static_cast<int>(one.queue.waiting());
    CHECK(kept > 50);
    CHECK(one.queue.dropped() == static_cast<std::uint64_t>(500 - kept));
    CHECK(one.send_all() == from_to(500 - kept + 1, 500));
}

TEST_CASE("queue: a full disk loses nothing as long as there is memory, then the newest, which are counted") {
    queue_limits limits;
    limits.memory_bytes = 100'000;
    life one("memory:mqtt-full", limits);
    REQUIRE(one.db.query("PRAGMA max_page_count=16"));
    one.push(1, 300, 1000);
    auto stored = one.queue.store(later);
    REQUIRE_FALSE(stored);
    CHECK(stored.error().message().find("full") != std::string::npos);
    const auto kept = static_cast<int>(one.queue.waiting());
    CHECK(kept > 50);
    CHECK(one.queue.dropped() == static_cast<std::uint64_t>(300 - kept));
    REQUIRE(one.db.query("PRAGMA max_page_count=100000"));
    REQUIRE(one.queue.store(later));
    one.push(1001, 1010);
    auto wanted = from_to(1, kept);
    for (int n = 1001; n <= 1010; ++n) wanted.push_back(n);
    CHECK(one.send_all() == wanted);
}

TEST_CASE("queue: what can be read of a damaged file is sent, and the queue goes on") {
    damaged_file::folder disk("mqtt");
    const auto file = disk.file();
    {
        life first(file);
        first.push(1, 2000, 200);
        REQUIRE(first.queue.store(later));
        REQUIRE(first.db.query("PRAGMA wal_checkpoint(TRUNCATE)"));
    }
    {
        std::fstream raw(file, std::ios::in | std::ios::out | std::ios::binary);
        raw.seekp(-40'000, std::ios::end);
        raw << std::string(8192, '\xee');
    }
    auto clock = [] { return std::chrono::system_clock::time_point(1h); };
    ise::when_damaged damaged(ise::logger(), clock);
    auto db = database::open(file, bridge_schema, ise::when_damaged::keeping_readable(std::move(damaged))).value();
    auto queue = outgoing_queue::open(db).value();
    std::vector<int> sent;
    while (const auto* one = queue.next()) {
        sent.push_back(std::stoi(one->what.payload));
        queue.done(one->what.number);
        if (sent.size() % 100 == 0) REQUIRE(queue.store(later));
    }
    CHECK(sent.size() > 500);
    CHECK(std::is_sorted(sent.begin(), sent.end()));
}

TEST_CASE("journal: a request is begun once, also over lives, and answered the same again") {
    damaged_file::folder disk("mqtt");
    const auto file = disk.file();
    using is = call_journal::state;
    call_outcome fine;
    fine.code = "ok";
    fine.payload = std::string("bytes\0of it", 11);
    {
        auto db = database::open(file, bridge_schema).value();
        call_journal first(db, 1, 1h);
        CHECK(first.begin("a", "t", "go", noon)->is == is::fresh);
        CHECK(first.begin("a", "t", "go", noon)->is == is::running);
        CHECK(first.begin("a", "t", "stay", noon)->is == is::other);
        CHECK(first.begin("a", "u", "go", noon)->is == is::other);
        REQUIRE(first.end("a", fine));
        CHECK(first.begin("a", "t", "go", noon)->is == is::answered);
        CHECK(first.begin("b", "t", "go", noon)->is == is::fresh);
    }
    auto db = database::open(file, bridge_schema).value();
    call_journal second(db, 2, 1h);
    auto again = second.begin("a", "t", "go", noon).value();
    CHECK(again.is == is::answered);
    CHECK(again.outcome.payload == fine.payload);
    CHECK(second.begin("b", "t", "go", noon)->is == is::interrupted);
    REQUIRE(second.tidy(noon + 59min));
    CHECK(second.begin("a", "t", "go", noon)->is == is::answered);
    REQUIRE(second.tidy(noon + 61min));
    CHECK(second.begin("a", "t", "go", noon)->is == is::fresh);
    REQUIRE(db.query("PRAGMA query_only=1")); // a disk that takes nothing
    CHECK_FALSE(second.begin("c", "t", "go", noon));
}

TEST_CASE("journal: answers have a bounded room on disk, and a request whose answer went is not executed again") {
    damaged_file::folder disk("mqtt");
    const auto file = disk.file();
    using is = call_journal::state;
    constexpr std::int64_t room = 1 << 20;
    call_outcome large;
    large.code = "ok";
    large.payload.assign(100'000, 'x');
    auto name = [](int n) { return "request " + std::to_string(n); };
    {
        auto db = database::open(file, bridge_schema).value();
        call_journal first(db, 1, 24h, room);
        for (int n = 0; n < 200; ++n) {
            CHECK(first.begin(name(n), "t", "go", noon + n * 1s)->is == is::fresh);
            REQUIRE(first.end(name(n), large));
        }
        CHECK(first.begin(name(0), "t", "go", noon)->is == is::dropped);
        CHECK(first.begin(name(199), "t", "go", noon)->outcome.payload == large.payload);
    }
    CHECK(std::filesystem::file_size(file) < 2 * room);
    auto db = database::open(file, bridge_schema).value();
    call_journal second(db, 2, 24h, room); // goes on counting
    for (int n = 200; n < 220; ++n) {
        CHECK(second.begin(name(n), "t", "go", noon + n * 1s)->is == is::fresh);
        REQUIRE(second.end(name(n), large));
    }
    CHECK(second.begin(name(199), "t", "go", noon)->is == is::dropped);
    auto kept = db.query("SELECT sum(length(payload)) FROM calls");
    CHECK(kept->front().integer(0) <= room);
}
