// Keys and counters in files: whatever the disk does, the boat accepts no packet twice and the shore uses no counter
// twice.
#include "failing_disk.hpp"

#include <components/boat/telecommand.hpp>
#include <components/seal/key_file.hpp>
#include <components/seal_store/seal_store.hpp>

#include <ise/core/real/environment.hpp>

#include <support/catch.hpp>

#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <set>
#include <sstream>
#include <sys/stat.h>
#include <sys/wait.h>
#include <unistd.h>

namespace seal_store_test {

using namespace atirma;
using namespace atirma::seal;
using namespace std::chrono_literals;

namespace {

constexpr auto radio = link_id::xbee;

radio_key a_key(int salt = 0) {
    radio_key made;
    made.boat = "atirma";
    made.secret.fill(static_cast<std::byte>(salt + 1));
    return made;
}

ise::bytes command(std::uint32_t id) {
    telecommand made;
    made.id = id;
    made.sent_at = utc_time(1'700'000'000'000ms);
    made.command = commands::ping{};
    made.valid_for = 60s;
    return encode_telecommand(made);
}

void write_text(const std::string& file, const std::string& text) { std::ofstream(file, std::ios::binary) << text; }

/// A folder in memory where there is one: the sweeps wait for thousands of fsyncs otherwise.
struct folder {
    folder() { std::filesystem::create_directories(path); }
    ~folder() { std::filesystem::remove_all(path); }
    folder(const folder&) = delete;
    folder& operator=(const folder&) = delete;
    std::filesystem::path path = (std::filesystem::exists("/dev/shm") ? std::filesystem::path("/dev/shm")
                                                                      : std::filesystem::temp_directory_path()) /
                                 ("ise-seal-store-" + std::to_string(::getpid()));
};

/// A key of boat and shore in a folder of this test.
struct quay {
    quay() { put(a_key()); }
    void put(const radio_key& key) {
        write_text(key_file(), format_key(key));
        ::chmod(key_file().c_str(), 0600);
    }
    std::string key_file() const { return (there.path / "radio.key").string(); }
    std::string boat_file() const { return key_file() + ".boat.db"; }
    std::string shore_file() const { return key_file() + ".xbee.db"; }

    ise::when_damaged replacing() const {
        return ise::when_damaged(ise::logger(), [] { return std::chrono::system_clock::time_point(480'000h); });
    }
    ise::result<std::unique_ptr<boat_links>> open_boat() { return boat_links::open(env, key_file(), replacing()); }
    ise::result<std::unique_ptr<shore_link>> open_shore(bool secondary = false) {
        return shore_link::open(env, key_file(), radio, secondary, replacing());
    }
    std::unique_ptr<boat_links> boat() { return std::move(open_boat().value()); }
    std::unique_ptr<shore_link> shore() { return std::move(open_shore().value()); }

    folder there;
    ise::real_environment env;
};

void introduce(boat_links& boat, shore_link& shore) {
    auto notice = boat.take_notice(radio, ise::time_point(1h), 1s);
    if (!notice.empty()) REQUIRE(shore.open(notice));
}

std::uint64_t counter_of(const ise::bytes& sealed) {
    std::uint64_t counter = 0; // components/seal/README.md
    for (std::size_t i = 0; i < counter_size; ++i) counter |= std::to_integer<std::uint64_t>(sealed[2 + i]) << (8 * i);
    return counter;
}

// SEAL_CUTS: at so many places; a file has some ten thousand.
std::size_t cuts() {
    const char* text = std::getenv("SEAL_CUTS"); // NOLINT: nothing sets it meanwhile
    return text ? std::max<std::size_t>(1, std::strtoull(text, nullptr, 10)) : 200;
}

std::string bytes_of(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), std::istreambuf_iterator<char>());
}

} // namespace

TEST_CASE("seal store: a restart of boat and shore keeps session and counters") {
    quay at;
    std::vector<ise::bytes> sealed;
    {
        auto boat = at.boat();
        auto shore = at.shore();
        introduce(*boat, *shore);
        for (std::uint32_t i = 0; i < 10; ++i) {
            sealed.push_back(shore->seal(command(i)).value());
            REQUIRE(boat->open(radio, sealed.back()));
        }
    }
    auto boat = at.boat();
    auto shore = at.shore();
    CHECK(boat->take_notice(radio, ise::time_point(1h), 1s).empty()); // it has lost nothing
    for (const auto& each : sealed) CHECK_FALSE(boat->open(radio, each));
    auto next = shore->seal(command(11)).value();
    CHECK(counter_of(next) > counter_of(sealed.back()));
    CHECK(boat->open(radio, next));
}

TEST_CASE("seal store: each link and lane has counters of its own, and a packet of one opens on no other") {
    quay at;
    auto boat = at.boat();
    auto primary = at.shore();
    auto secondary = std::move(at.open_shore(true).value());
    auto gprs = std::move(shore_link::open(at.env, at.key_file(), link_id::gprs, false).value());
    auto notice = boat->take_notice(radio, ise::time_point(1h), 1s);
    REQUIRE(primary->open(notice));
    REQUIRE(secondary->open(notice));
    CHECK_FALSE(gprs->open(notice));
    auto one = primary->seal(command(1)).value(), two = secondary->seal(command(2)).value();
    CHECK_FALSE(boat->open(link_id::gprs, one));
    CHECK(boat->open(radio, one));
    CHECK(boat->open(radio, two));
    for (auto name : {".xbee.db", ".xbee.secondary.db", ".gprs.db", ".boat.db"})
        CHECK(std::filesystem::exists(at.key_file() + name));
}

TEST_CASE("seal store: at whichever change the boat's disk fails, no packet is accepted twice") {
    for (auto how : {failing_disk::fault::io_error, failing_disk::fault::full})
        for (bool for_ever : {true, false}) {
            bool failed = true;
            for (int n = 0; failed; ++n) {
                REQUIRE(n < 500);
                quay at;
                failing_disk disk;
                std::vector<ise::bytes> sealed;
                std::set<std::size_t> accepted;
                auto shore = at.shore();
                auto offer = [&](boat_links& boat) {
                    for (std::size_t i = 0; i < sealed.size(); ++i)
                        if (boat.open(radio, sealed[i])) REQUIRE(accepted.insert(i).second);
                };
                disk.fail_at(n, how, for_ever);
                {
                    auto boat = at.open_boat();
                    for (std::uint32_t i = 0; boat && i < 4; ++i) {
                        auto notice = (*boat)->take_notice(radio, ise::time_point(1h) + i * 1s, 1s);
                        if (!notice.empty()) (void)shore->open(notice);
                        if (auto made = shore->seal(command(i))) sealed.push_back(*made);
                        offer(**boat);
                    }
                }
                failed = disk.failed();
                disk.repair();
                for (int life = 0; life < 2; ++life) {
                    auto boat = at.boat();
                    offer(*boat);
                    offer(*boat);
                    introduce(*boat, *shore);
                    sealed.push_back(shore->seal(command(9)).value());
                    if (!boat->open(radio, sealed.back())) { // it has lost its memory, and has said so by now
                        introduce(*boat, *shore);
                        sealed.push_back(shore->seal(command(9)).value());
                        REQUIRE(boat->open(radio, sealed.back()));
                    }
                    accepted.insert(sealed.size() - 1);
                    offer(*boat);
                }
            }
        }
}

TEST_CASE("seal store: at whichever change the shore's disk fails, no counter is used twice") {
    for (auto how : {failing_disk::fault::io_error, failing_disk::fault::full})
        for (bool for_ever : {true, false}) {
            bool failed = true;
            for (int n = 0; failed; ++n) {
                REQUIRE(n < 500);
                quay at;
                failing_disk disk;
                std::set<std::uint64_t> used;
                auto use = [&](shore_link& by) {
                    for (std::uint32_t i = 0; i < 150; ++i)
                        if (auto made = by.seal(command(i))) REQUIRE(used.insert(counter_of(*made)).second);
                };
                disk.fail_at(n, how, for_ever);
                if (auto shore = at.open_shore()) use(**shore);
                failed = disk.failed();
                disk.repair();
                for (int life = 0; life < 2; ++life) {
                    auto shore = at.shore();
                    auto before = used.size();
                    use(*shore);
                    REQUIRE(used.size() == before + 150);
                }
            }
        }
}

TEST_CASE("seal store: a link goes on once a disk that failed for a moment works again") {
    quay at;
    failing_disk disk;
    auto boat = at.boat();
    auto shore = at.shore();
    introduce(*boat, *shore);
    for (int n = 0; n < 12; ++n) {
        auto sealed = shore->seal(command(1)).value();
        disk.fail_at(n, failing_disk::fault::io_error, false);
        auto opened = boat->open(radio, sealed);
        disk.repair();
        if (!opened) CHECK(opened.error().message().find(at.boat_file()) != std::string::npos);
        REQUIRE(boat->open(radio, shore->seal(command(2)).value()));
        if (opened) CHECK_FALSE(boat->open(radio, sealed));
    }
}

TEST_CASE("seal store: a file of counters that is cut anywhere or damaged is a lost memory, and opens nothing again") {
    std::string whole;
    std::vector<ise::bytes> sealed;
    quay at;
    {
        auto boat = at.boat();
        auto shore = at.shore();
        introduce(*boat, *shore);
        for (std::uint32_t i = 0; i < 3; ++i) {
            sealed.push_back(shore->seal(command(i)).value());
            REQUIRE(boat->open(radio, sealed.back()));
        }
    }
    REQUIRE_FALSE(std::filesystem::exists(at.boat_file() + "-wal"));
    whole = bytes_of(at.boat_file());
    auto step = std::max<std::size_t>(1, whole.size() / cuts());
    auto tried = [&](const std::string& content) {
        for (const auto& each : std::filesystem::directory_iterator(at.there.path))
            if (each.path().string().starts_with(at.boat_file())) std::filesystem::remove(each.path());
        write_text(at.boat_file(), content);
        auto boat = at.open_boat();
        if (!boat) {
            CHECK_FALSE(boat.error().message().empty());
            return;
        }
        for (const auto& each : sealed) REQUIRE_FALSE((*boat)->open(radio, each));
    };
    for (std::size_t size = 0; size < whole.size(); size += step) tried(whole.substr(0, size));
    tried(whole.substr(0, whole.size() - 1));
    tried(std::string(5000, 'g'));
    for (std::size_t page = 0; page < whole.size(); page += 4096) {
        auto bad = whole;
        bad.replace(page, 4096, 4096, 'x');
        tried(bad);
    }
}

TEST_CASE("seal store: a second process at the same counters is refused, and says what to do") {
    quay at;
    auto boat = at.boat();
    auto shore = at.shore();
    introduce(*boat, *shore);
    REQUIRE(boat->open(radio, shore->seal(command(0)).value()));
    int out[2];
    REQUIRE(::pipe(out) == 0);
    auto child = ::fork();
    REQUIRE(child >= 0);
    if (child == 0) { // it has them open from its own start on
        quay* there = &at;
        std::string used;
        auto other = there->open_shore();
        for (std::uint32_t i = 0; other && i < 100; ++i)
            if (auto made = (*other)->seal(command(i))) used += std::to_string(counter_of(*made)) + "\n";
        bool reported = ::write(out[1], used.data(), used.size()) == static_cast<ssize_t>(used.size());
        ::_exit(reported ? 0 : 1);
    }
    ::close(out[1]);
    std::string text;
    for (char buffer[512];;) {
        auto got = ::read(out[0], buffer, sizeof buffer);
        if (got <= 0) break;
        text.append(buffer, static_cast<std::size_t>(got));
    }
    ::close(out[0]);
    int status = 0;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(status == 0);
    std::set<std::uint64_t> used;
    std::istringstream lines(text);
    for (std::uint64_t one = 0; lines >> one;) REQUIRE(used.insert(one).second);
    CHECK(used.size() == 100);
    std::string why;
    for (std::uint32_t i = 0; i < 100; ++i) {
        auto made = shore->seal(command(i));
        if (made) REQUIRE(used.insert(counter_of(*made)).second);
        else why = made.error().message();
    }
    CHECK(why.find("radio-secondary") != std::string::npos);

    auto twin = at.boat();
    auto fresh = at.shore();
    introduce(*boat, *fresh);
    auto sealed = fresh->seal(command(5)).value();
    bool first = static_cast<bool>(boat->open(radio, sealed)), second = static_cast<bool>(twin->open(radio, sealed));
    CHECK(first);
    CHECK_FALSE(second);
}

TEST_CASE("seal store: a key file is refused if others may read it, it is missing, or it is none") {
    quay at;
    auto why = [&] {
        auto boat = at.open_boat();
        auto shore = at.open_shore();
        REQUIRE_FALSE(boat);
        REQUIRE_FALSE(shore);
        CHECK(boat.error().message().find(at.key_file()) != std::string::npos);
        CHECK(boat.error().message() == shore.error().message());
        return boat.error();
    };
    ::chmod(at.key_file().c_str(), 0644);
    CHECK(why().message().find("others") != std::string::npos);
    write_text(at.key_file(), "");
    ::chmod(at.key_file().c_str(), 0600);
    CHECK(why().code() == ise::errc::malformed);
    auto text = format_key(a_key());
    for (std::size_t size = 0; size + 2 < text.size(); ++size) { // cut: never a shorter key
        write_text(at.key_file(), text.substr(0, size));
        CHECK(why().code() == ise::errc::malformed);
    }
    std::filesystem::remove(at.key_file());
    why();
    CHECK_FALSE(std::filesystem::exists(at.boat_file()));
}

TEST_CASE("seal store: files of counters belong to their owner alone") {
    quay at;
    auto boat = at.boat();
    auto shore = at.shore();
    introduce(*boat, *shore);
    for (const auto& each : std::filesystem::directory_iterator(at.there.path)) {
        struct stat found {};
        REQUIRE(::stat(each.path().c_str(), &found) == 0);
        INFO(each.path());
        CHECK((found.st_mode & 0777) == 0600);
    }
}

TEST_CASE("seal store: another key begins a session of its own, and counters of the former one stay") {
    quay at;
    auto boat = at.boat();
    auto shore = at.shore();
    introduce(*boat, *shore);
    auto sealed = shore->seal(command(1)).value();
    REQUIRE(boat->open(radio, sealed));
    boat.reset();
    at.put(a_key(7));
    boat = at.boat();
    CHECK_FALSE(boat->open(radio, sealed));
    boat.reset();
    at.put(a_key());
    boat = at.boat();
    CHECK_FALSE(boat->open(radio, sealed));
    CHECK(boat->open(radio, shore->seal(command(2)).value()));
}

namespace {

/// The boat says something, the shore answers, until nothing is left to say.
void talk(boat_links& boat, shore_link& shore, ise::time_point& clock) {
    acknowledgement said;
    said.id = 9;
    for (int i = 0; i < 3; ++i) {
        (void)shore.open(boat.seal(radio, encode_acknowledgement(said)));
        for (int step = 0; step < 3; ++step) {
            auto question = shore.take_question();
            if (!question.empty()) (void)boat.open(radio, question);
            auto notice = boat.take_notice(radio, clock += 10s, 5s);
            if (!notice.empty()) (void)shore.open(notice);
        }
    }
}

radio_key next_key(int salt = 50) {
    auto made = a_key(salt);
    made.epoch = 1;
    return made;
}

} // namespace

TEST_CASE("seal store: a changed key outlives restarts, also where the counters are lost") {
    quay at;
    ise::time_point now(1h);
    auto boat = at.boat();
    auto shore = at.shore();
    introduce(*boat, *shore);
    radio_keys both{a_key(), next_key(), {}};
    write_text(at.key_file() + ".shore", format_keys(both));
    ::chmod((at.key_file() + ".shore").c_str(), 0600);
    auto changing = [&] {
        return std::move(shore_link::open(at.env, at.key_file() + ".shore", radio, false, at.replacing()).value());
    };
    shore = changing();
    CHECK(shore_link::report(shore).next_epoch == std::uint8_t{1});
    CHECK(shore_link::report(shore).epoch == 0);
    talk(*boat, *shore, now);
    CHECK(boat->keys().now.epoch == 1);
    CHECK_FALSE(shore_link::report(shore).next_epoch);
    CHECK(shore_link::report(shore).epoch == 1);
    CHECK(shore_link::report(shore).key == fingerprint(next_key()));
    REQUIRE(boat->open(radio, shore->seal(command(1)).value()));
    for (bool lost : {false, true}) {
        boat.reset();
        shore.reset();
        if (lost)
            for (const auto& each : std::filesystem::directory_iterator(at.there.path))
                if (each.path().string().starts_with(at.boat_file())) std::filesystem::remove(each.path());
        boat = at.boat();
        shore = changing();
        CHECK(boat->keys().now.epoch == 1);
        CHECK(shore_link::report(shore).epoch == 1);
        talk(*boat, *shore, now);
        REQUIRE(boat->open(radio, shore->seal(command(2)).value()));
    }
    struct stat found {};
    REQUIRE(::stat((at.key_file() + ".keys.db").c_str(), &found) == 0);
    CHECK((found.st_mode & 0777) == 0600);
}

TEST_CASE("seal store: the recovery key beside the boat's key changes it, and a file of another boat is refused") {
    quay at;
    auto recovery = a_key(90);
    auto file = at.key_file() + ".recovery";
    write_text(file, format_recovery_key({recovery, 6}));
    ::chmod(file.c_str(), 0600);
    auto boat = at.boat();
    auto change = seal_recovery(recovery, 7, next_key());
    CHECK(boat->open(radio, change));
    REQUIRE(boat->keys().next);
    boat.reset();
    boat = at.boat();
    CHECK_FALSE(boat->open(link_id::gprs, change)); // kept, and once over all links
    CHECK(boat->keys().next->secret == next_key().secret);
    CHECK(boat->keys().next_by_recovery);
    boat.reset();
    recovery.boat = "another";
    write_text(file, format_recovery_key({recovery, 6}));
    auto refused = at.open_boat();
    REQUIRE_FALSE(refused);
    CHECK(refused.error().message().find(file) != std::string::npos);
    ::chmod(file.c_str(), 0644);
    CHECK_FALSE(at.open_boat());
}

TEST_CASE(
    "seal store: at whichever change of the boat's disk a change of its key fails, it ends under one of the keys") {
    bool failed = true;
    for (int n = 0; failed; ++n) {
        REQUIRE(n < 500);
        quay at;
        failing_disk disk;
        ise::time_point now(1h);
        radio_keys both{a_key(), next_key(), {}};
        write_text(at.key_file() + ".shore", format_keys(both));
        ::chmod((at.key_file() + ".shore").c_str(), 0600);
        auto shore = std::move(shore_link::open(at.env, at.key_file() + ".shore", radio, false).value());
        {
            auto boat = at.boat();
            introduce(*boat, *shore);
            disk.fail_at(n);
            talk(*boat, *shore, now);
        }
        failed = disk.failed();
        disk.repair();
        auto boat = at.boat();
        talk(*boat, *shore, now);
        talk(*boat, *shore, now);
        talk(*boat, *shore, now);
        CHECK(boat->keys().now.epoch == 1);
        REQUIRE(boat->open(radio, shore->seal(command(1)).value()));
    }
}

TEST_CASE("seal store: notices are sent once in their period at most") {
    quay at;
    auto boat = at.boat();
    ise::time_point now(1h);
    CHECK_FALSE(boat->take_notice(radio, now, 5s).empty());
    auto shore = at.shore();
    auto refused = shore->seal(command(1)).value();
    for (int i = 0; i < 100; ++i) CHECK_FALSE(boat->open(radio, refused));
    for (int i = 0; i < 4; ++i) CHECK(boat->take_notice(radio, now += 1s, 5s).empty());
    CHECK_FALSE(boat->take_notice(radio, now += 1s, 5s).empty());
    CHECK(boat->take_notice(radio, now += 60s, 5s).empty());
}

} // namespace seal_store_test
