#include <components/seal_store/seal_store.hpp>

#include <fmt/format.h>

#include <string_view>
#include <utility>

namespace atirma::seal {
namespace {

constexpr std::size_t max_key_file = 4096;
// A file holds counters of several keys: those of an earlier key are of no use to the next one.
constexpr std::array<std::string_view, 1> boat_schema{
    "CREATE TABLE accepted(of TEXT NOT NULL, link INTEGER NOT NULL, lane INTEGER NOT NULL, session INTEGER NOT NULL, "
    "highest INTEGER NOT NULL, seen INTEGER NOT NULL, PRIMARY KEY(of, link, lane))"};
constexpr std::array<std::string_view, 1> shore_schema{
    "CREATE TABLE reserved(of TEXT PRIMARY KEY, session INTEGER NOT NULL, until INTEGER NOT NULL)"};

ise::result<radio_key> read_key(ise::environment& env, const std::string& file) {
    auto text = env.read_secret(file, max_key_file);
    if (!text) return text.error();
    return parse_key(*text, file);
}

// A virtual world has its disks in memory.
std::string place(const ise::environment& env, std::string file) {
    return env.is_virtual() ? "memory:" + std::move(file) : std::move(file);
}

ise::result<std::optional<boat_counters>> kept_of(database& disk, const std::string& of, link_id link) {
    auto rows = disk.query("SELECT lane, session, highest, seen FROM accepted WHERE of = ? AND link = ?",
                           {of, static_cast<std::int64_t>(link)});
    if (!rows) return rows.error();
    if (rows->size() != 2) return std::optional<boat_counters>();
    boat_counters made;
    for (const auto& row : *rows) {
        auto lane = row.integer(0);
        if (lane < 0 || lane > 1) return std::optional<boat_counters>();
        auto of_row = static_cast<session>(row.integer(1));
        if (made.of != no_session && of_row != made.of) return std::optional<boat_counters>();
        made.of = of_row;
        auto& into = made.lanes[static_cast<std::size_t>(lane)];
        into.highest = static_cast<std::uint64_t>(row.integer(2));
        into.seen = static_cast<std::uint64_t>(row.integer(3));
    }
    return std::optional(made);
}

ise::failure changed_by_another(const database& disk, std::string_view remedy) {
    return ise::failure(ise::errc::refused,
                        fmt::format("another process uses the counters in {}: {}", disk.file(), remedy));
}

// Only on top of what this process knows, or tried to write before: two that have the file open do not both use it.
class kept_counters {
public:
    kept_counters(database& disk, std::string of, link_id link, boat_counters known)
        : disk_(disk), of_(std::move(of)), link_(static_cast<std::int64_t>(link)), known_(known), tried_(known) {}

    ise::result<void> operator()(const boat_counters& now) {
        auto before = std::exchange(tried_, now);
        auto put = disk_.transaction([&] {
            ise::result<void> each;
            for (std::size_t lane = 0; each && lane < now.lanes.size(); ++lane) each = put_lane(lane, before, now);
            return each;
        });
        if (put) known_ = now;
        return put;
    }

private:
    ise::result<void> put_lane(std::size_t lane, const boat_counters& before, const boat_counters& now) {
        auto number = [](std::uint64_t value) { return static_cast<std::int64_t>(value); };
        auto changed =
            disk_.execute("INSERT INTO accepted VALUES(?, ?, ?, ?, ?, ?) ON CONFLICT(of, link, lane) DO UPDATE SET "
                          "session = excluded.session, highest = excluded.highest, seen = excluded.seen "
                          "WHERE (session = ? AND highest = ? AND seen = ?) OR (session = ? AND highest = ? AND seen = ?)",
                          {of_, link_, static_cast<std::int64_t>(lane), number(now.of), number(now.lanes[lane].highest),
                           number(now.lanes[lane].seen), number(known_.of), number(known_.lanes[lane].highest),
                           number(known_.lanes[lane].seen), number(before.of), number(before.lanes[lane].highest),
                           number(before.lanes[lane].seen)});
        if (!changed) return changed.error();
        if (*changed == 0) return changed_by_another(disk_, "stop one of the two boats");
        return {};
    }

    database& disk_;
    std::string of_;
    std::int64_t link_;
    boat_counters known_, tried_;
};

class kept_reservation {
public:
    kept_reservation(database& disk, std::string of, shore_counters known)
        : disk_(disk), of_(std::move(of)), known_(known), tried_(known) {}

    ise::result<void> operator()(const shore_counters& now) {
        auto before = std::exchange(tried_, now);
        auto number = [](std::uint64_t value) { return static_cast<std::int64_t>(value); };
        auto changed = disk_.execute(
            "INSERT INTO reserved VALUES(?, ?, ?) ON CONFLICT(of) DO UPDATE SET session = excluded.session, "
            "until = excluded.until WHERE (session = ? AND until = ?) OR (session = ? AND until = ?)",
            {of_, number(now.of), number(now.reserved), number(known_.of), number(known_.reserved), number(before.of),
             number(before.reserved)});
        if (!changed) return changed.error();
        if (*changed == 0)
            return changed_by_another(disk_, "stop one of the two proxies, or give one of them radio-secondary");
        known_ = now;
        return {};
    }

private:
    database& disk_;
    std::string of_;
    shore_counters known_, tried_;
};

} // namespace

ise::result<std::unique_ptr<boat_links>> boat_links::open(ise::environment& env, const std::string& key_file,
                                                          when_damaged how) {
    auto key = read_key(env, key_file);
    if (!key) return key.error();
    auto disk = database::open(place(env, key_file + ".boat.db"), boat_schema, std::move(how));
    if (!disk) return disk.error();
    std::unique_ptr<boat_links> made(new boat_links(std::move(*disk)));
    auto of = fingerprint(*key);
    for (std::size_t i = 0; i < link_count; ++i) {
        auto link = static_cast<link_id>(i);
        auto kept = kept_of(made->disk_, of, link);
        if (!kept) return kept.error();
        auto mine = *key;
        mine.link = name_of(link);
        auto random = env.random();
        boat_seal fresh(mine, *kept, random, nullptr);
        kept_counters keeper(made->disk_, of, link, fresh.counters());
        // So that the notice of this start holds after the next one, too.
        if (!*kept) {
            if (auto put = keeper(fresh.counters()); !put) return put.error();
        }
        made->seals_[i].emplace(std::move(mine), *kept, random, std::move(keeper));
    }
    return made;
}

ise::bytes boat_links::take_notice(link_id link, ise::time_point now, ise::duration every) {
    auto i = static_cast<std::size_t>(link);
    if (of(link).take_notice_due()) due_[i] = true;
    if (!due_[i] || (told_at_[i] && now - *told_at_[i] < every)) return {};
    due_[i] = false;
    told_at_[i] = now;
    return of(link).notice();
}

ise::result<std::unique_ptr<shore_link>> shore_link::open(ise::environment& env, const std::string& key_file,
                                                          link_id link, bool secondary, when_damaged how) {
    auto key = read_key(env, key_file);
    if (!key) return key.error();
    auto disk =
        database::open(place(env, fmt::format("{}.{}{}.db", key_file, name_of(link), secondary ? ".secondary" : "")),
                       shore_schema, std::move(how));
    if (!disk) return disk.error();
    std::unique_ptr<shore_link> made(new shore_link(std::move(*disk)));
    auto of = fingerprint(*key);
    auto rows = made->disk_.query("SELECT session, until FROM reserved WHERE of = ?", {of});
    if (!rows) return rows.error();
    shore_counters kept;
    if (!rows->empty()) {
        kept.of = static_cast<session>(rows->front().integer(0));
        kept.reserved = static_cast<std::uint64_t>(rows->front().integer(1));
    }
    key->link = name_of(link);
    made->end_.emplace(std::move(*key), secondary ? lane::secondary : lane::primary, kept,
                       kept_reservation(made->disk_, of, kept));
    return made;
}

std::unique_ptr<shore_link> shore_link::open_for(ise::component& proxy, const std::string& key_file, link_id link,
                                                 bool secondary) {
    if (key_file.empty()) {
        proxy.log().warning(
            "the radio is not sealed: whoever can send on this link is taken for the boat (set radio-key)", {});
        return nullptr;
    }
    when_damaged damaged(proxy.log(),
                         [&proxy] { return std::chrono::floor<std::chrono::system_clock::duration>(proxy.wall()); });
    auto made = std::move(open(proxy.env(), key_file, link, secondary, std::move(damaged)).value());
    proxy.log().info("the radio is sealed", {{"boat", made->key().boat}, {"key", fingerprint(made->key())}});
    return made;
}

} // namespace atirma::seal
