// A communication node's store in SQLite and in PostgreSQL in the same run: how fast packets come in, and how long the
// track of a day takes. usage: bench_store URL FOLDER [BOATS [PACKETS_A_DAY]]. The database is empty.
#include <components/communication_node/postgres_backfill.hpp>
#include <components/communication_node/postgres_store.hpp>
#include <components/communication_node/postgres_tools.hpp>
#include <components/communication_node/sqlite_store.hpp>

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <filesystem>
#include <stdexcept>

namespace {

using namespace atirma;
using namespace std::chrono_literals;
using watch = std::chrono::steady_clock;

constexpr std::size_t batch = 20'000, rows = 200'000, raw_bytes = 100;
constexpr int days = 365;
const utc_time start{std::chrono::sys_days{std::chrono::January / 1 / 2025}};

double seconds(watch::time_point since) { return std::chrono::duration<double>(watch::now() - since).count(); }

telemetry_packet packet(std::uint16_t boot, std::uint32_t sequence, utc_time at) {
    telemetry_packet made;
    made.link = link_id::gprs;
    made.boot = boot;
    made.sequence = sequence;
    made.measured_at = at;
    made.received_at = at + 1s;
    made.raw.resize(raw_bytes, std::byte{static_cast<unsigned char>(sequence * 31)});
    made.raw[0] = made.raw[1] = std::byte{1};
    return made;
}

std::vector<telemetry_packet> packets(std::uint16_t boot, std::uint32_t first, std::size_t count, utc_time from,
                                      std::chrono::milliseconds every) {
    std::vector<telemetry_packet> made;
    for (std::size_t i = 0; i < count; ++i)
        made.push_back(packet(boot, first + static_cast<std::uint32_t>(i), from + every * static_cast<int>(i)));
    return made;
}

void say(const std::string& line) {
    std::puts(line.c_str());
    std::fflush(stdout);
}

/// Lines as COPY takes them, with nothing else: what the server alone can do.
double copy_alone(postgres_session& to, const std::string& from_query) {
    to.run_script("CREATE TABLE IF NOT EXISTS atirma.bench_copy (LIKE atirma.packets INCLUDING ALL); TRUNCATE "
                  "atirma.bench_copy")
        .value();
    double taken = 0;
    for (std::size_t at = 0; at < rows; at += batch) {
        auto lines =
            to.query(fmt::format("SELECT string_agg(concat_ws(E'\\t', boat, boot, sequence, measured, position, "
                                 "received, link, kind, history, '\\' || raw::text), E'\\n') FROM ({} ORDER BY "
                                 "position LIMIT {} OFFSET {}) x",
                                 from_query, batch, at))
                .value();
        auto began = watch::now();
        to.copy_in("COPY atirma.bench_copy FROM STDIN", text_of(lines.at(0), 0) + "\n").value();
        taken += seconds(began);
    }
    to.run_script("DROP TABLE atirma.bench_copy").value();
    return static_cast<double>(rows) / taken;
}

void backfill(const std::string& url, const std::string& folder) {
    auto session = postgres_session::open(url).value();
    postgres_backfill into(session, "bench");
    double postgres = 0, sqlite = 0;
    auto file = sqlite_store::open(folder + "/bench.db", 1).value();
    for (std::size_t at = 0; at < rows; at += batch) {
        auto some = packets(1, static_cast<std::uint32_t>(at), batch, start + at * 1s, 1s);
        auto began = watch::now();
        into.add(some).value();
        postgres += seconds(began);
        began = watch::now();
        file.add(some).value();
        sqlite += seconds(began);
    }
    auto alone =
        copy_alone(session, "SELECT * FROM atirma.packets WHERE boat = (SELECT number FROM atirma.boats WHERE boat "
                            "= 'bench')");
    say(fmt::format(
        "backfill of {} packets of {} bytes, {} a transaction: PostgreSQL {:.0f}/s ({:.0f} % of COPY alone, "
        "{:.0f}/s), SQLite {:.0f}/s",
        rows, raw_bytes, batch, rows / postgres, 100 * rows / postgres / alone, alone, rows / sqlite));
}

/// Each boat has a packet an hour through the year, and all of one day; the boats' packets lie among each other.
void fill_year(const std::string& url, int boats, int a_day, int the_day) {
    auto session = postgres_session::open(url).value();
    std::vector<postgres_backfill> of;
    for (int boat = 0; boat < boats; ++boat) of.emplace_back(session, fmt::format("boat-{}", boat + 1));
    auto began = watch::now();
    std::uint64_t count = 0;
    for (int month = 0; month < days; month += 15)
        for (int boat = 0; boat < boats; ++boat) {
            auto some = packets(1, static_cast<std::uint32_t>(month) * 24, 15 * 24, start + month * 24h, 1h);
            count += of[static_cast<std::size_t>(boat)].add(some).value();
        }
    auto every = std::chrono::milliseconds(24h) / a_day;
    for (int part = 0; part < 24; ++part)
        for (int boat = 0; boat < boats; ++boat) {
            auto some = packets(2, static_cast<std::uint32_t>(part * (a_day / 24)),
                                static_cast<std::size_t>(a_day / 24), start + the_day * 24h + part * 1h + 1ms, every);
            count += of[static_cast<std::size_t>(boat)].add(some).value();
        }
    say(fmt::format("{} packets of {} boats in {:.0f} s", count, boats, seconds(began)));
    session.run_script("ANALYZE atirma.packets").value();
    session.run_script("VACUUM atirma.packets").value();
}

/// As a client fetches it: page after page.
class reader final : public ise::component {
public:
    reader(std::string url, std::string boat, int the_day, int& pages, std::size_t& found, double& taken)
        : url_(std::move(url)), boat_(std::move(boat)), day_(the_day), pages_(pages), found_(found), taken_(taken) {}

private:
    ise::task<> run() override {
        postgres_store_options options;
        options.url = url_;
        options.boat = boat_;
        options.node = "bench";
        postgres_store store(on(), options);
        auto known = co_await store.opened();
        if (!known) throw ise::error(known.error());
        track_request request;
        request.from = start + day_ * 24h;
        request.until = start + (day_ + 1) * 24h;
        request.max_packets = 1000;
        auto began = watch::now();
        for (bool more = true; more;) {
            store_answer<track_page> answer(on());
            store.track(request, store.head(), answer.here());
            auto page = co_await answer.get();
            if (!page) throw ise::error(page.error());
            found_ += page->packets.size();
            ++pages_;
            request.seen = page->seen;
            more = page->more;
        }
        taken_ = seconds(began);
        stop();
    }

    std::string url_, boat_;
    int day_;
    int& pages_;
    std::size_t& found_;
    double& taken_;
};

void track(const std::string& url, const std::string& folder, int boats, int a_day, int the_day) {
    std::vector<double> taken;
    std::size_t found = 0;
    int pages = 0;
    for (int run = 0; run < 7; ++run) {
        ise::real_environment world;
        ise::node_options options;
        options.name = "bench";
        ise::node node(world, options);
        ise::component_options anonymous;
        anonymous.listens = false;
        anonymous.registers = false;
        double one = 0;
        pages = 0;
        found = 0;
        node.launch(
            "", std::make_unique<reader>(url, fmt::format("boat-{}", run * boats / 7 + 1), the_day, pages, found, one),
            std::move(anonymous));
        if (ise::run_until_signal(node) != 0) throw std::runtime_error("the track was not read");
        taken.push_back(one);
    }
    // SQLite holds one boat a file.
    auto file = sqlite_store::open(folder + "/year.db", 1).value();
    for (int day = 0; day < days; day += 15)
        file.add(packets(1, static_cast<std::uint32_t>(day) * 24, 15 * 24, start + day * 24h, 1h)).value();
    auto every = std::chrono::milliseconds(24h) / a_day;
    file.add(packets(2, 0, static_cast<std::size_t>(a_day), start + the_day * 24h + 1ms, every)).value();
    track_request request;
    request.from = start + the_day * 24h;
    request.until = start + (the_day + 1) * 24h;
    request.max_packets = 1000;
    auto began = watch::now();
    std::size_t in_file = 0;
    for (bool more = true; more;) {
        auto page = file.track(request, file.head()).value();
        in_file += page.packets.size();
        request.seen = page.seen;
        more = page.more;
    }
    auto sqlite = seconds(began);
    std::ranges::sort(taken);
    say(fmt::format(
        "a day's track of one of {} boats, {} packets in {} pages: PostgreSQL {:.0f} ms (slowest of 7 boats {:.0f} "
        "ms), SQLite with that boat alone {:.0f} ms ({} packets)",
        boats, found, pages, 1000 * taken[3], 1000 * taken.back(), 1000 * sqlite, in_file));
}

} // namespace

int main(int count, char** words) {
    if (count < 3) {
        std::fputs("usage: bench_store URL FOLDER [BOATS [PACKETS_A_DAY]]\n", stderr);
        return 2;
    }
    std::string url = words[1], folder = words[2];
    int boats = count > 3 ? std::stoi(words[3]) : 300, a_day = count > 4 ? std::stoi(words[4]) : 17'280, the_day = 200;
    try {
        say(migrate_database(url).value());
        backfill(url, folder);
        fill_year(url, boats, a_day, the_day);
        track(url, folder, boats, a_day, the_day);
    } catch (const std::exception& why) {
        std::fprintf(stderr, "bench_store: %s\n", why.what());
        return 1;
    }
    return 0;
}
