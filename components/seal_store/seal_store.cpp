#include <components/seal/key_file.hpp>
#include <components/seal_store/seal_store.hpp>

#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>
#include <vector>

namespace atirma::seal {
namespace {

constexpr std::size_t max_key_file = 4096;
// A file holds counters of several keys: those of an earlier key are of no use to the next one.
constexpr std::array<std::string_view, 1> boat_schema{
    "CREATE TABLE accepted(of TEXT NOT NULL, link INTEGER NOT NULL, lane INTEGER NOT NULL, session INTEGER NOT NULL, "
    "highest INTEGER NOT NULL, seen INTEGER NOT NULL, PRIMARY KEY(of, link, lane))"};
constexpr std::array<std::string_view, 1> shore_schema{
    "CREATE TABLE reserved(of TEXT PRIMARY KEY, session INTEGER NOT NULL, until INTEGER NOT NULL)"};

// Its own file, which is written with each change of the key only: what damages the counters leaves the keys.
constexpr std::array<std::string_view, 1> keys_schema{
    "CREATE TABLE keys(of TEXT PRIMARY KEY, keys TEXT NOT NULL, next_by_recovery INTEGER NOT NULL, "
    "recovered INTEGER NOT NULL)"};

ise::result<radio_keys> read_keys(ise::environment& env, const std::string& file) {
    auto text = env.read_secret(file, max_key_file);
    if (!text) return text.error();
    return parse_keys(*text, file);
}

// Beside the boat's key file. Nothing: there is none.
ise::result<std::optional<radio_key>> read_recovery(ise::environment& env, const std::string& key_file,
                                                    const std::string& boat) {
    auto file = key_file + ".recovery";
    if (!env.read_file(file, max_key_file)) return std::optional<radio_key>();
    auto text = env.read_secret(file, max_key_file);
    if (!text) return text.error();
    auto key = parse_recovery_key(*text, file);
    if (!key) return key.error();
    if (key->key.boat != boat)
        return ise::failure(ise::errc::malformed,
                            fmt::format("{} is of the boat {}, and {} of {}", file, key->key.boat, key_file, boat));
    return std::optional(std::move(key->key));
}

// What the boat has learnt of its keys since its file was made, else what is in the file.
ise::result<boat_keys> known_keys(ise::database& disk, const radio_keys& of_file) {
    boat_keys made;
    made.now = of_file.now;
    made.next = of_file.next;
    auto rows =
        disk.query("SELECT keys, next_by_recovery, recovered FROM keys WHERE of = ?", {fingerprint(of_file.now)});
    if (!rows) return rows.error();
    if (rows->empty()) return made;
    const auto& row = rows->front();
    auto kept = parse_keys(row.text(0), disk.file());
    if (!kept) return kept.error();
    made.now = kept->now;
    made.next = kept->next;
    made.next_by_recovery = row.integer(1) != 0;
    made.recovered = static_cast<std::uint64_t>(row.integer(2));
    return made;
}

ise::result<void> keep_keys(ise::database& disk, const std::string& of, const boat_keys& now) {
    auto put = disk.execute("INSERT OR REPLACE INTO keys VALUES(?, ?, ?, ?)",
                            {of, format_keys({now.now, now.next, {}}), std::int64_t{now.next_by_recovery},
                             static_cast<std::int64_t>(now.recovered)});
    if (!put) return put.error();
    return {};
}

// A virtual world has its disks in memory.
std::string place(const ise::environment& env, std::string file) {
    return env.is_virtual() ? "memory:" + std::move(file) : std::move(file);
}

ise::result<std::optional<boat_counters>> kept_of(ise::database& disk, const std::string& of, link_id link) {
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

ise::failure changed_by_another(const ise::database& disk, std::string_view remedy) {
    return ise::failure(ise::errc::refused,
                        fmt::format("another process uses the counters in {}: {}", disk.file(), remedy));
}

// Only on top of what this process knows, or tried to write before: two that have the file open do not both use it.
class kept_counters {
public:
    kept_counters(ise::database& disk, std::string of, link_id link, boat_counters known)
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
        auto changed = disk_.execute(
            "INSERT INTO accepted VALUES(?, ?, ?, ?, ?, ?) ON CONFLICT(of, link, lane) DO UPDATE SET "
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

    ise::database& disk_;
    std::string of_;
    std::int64_t link_;
    boat_counters known_, tried_;
};

class kept_reservation {
public:
    kept_reservation(ise::database& disk, std::string of, shore_counters known)
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
    ise::database& disk_;
    std::string of_;
    shore_counters known_, tried_;
};

} // namespace

ise::result<std::unique_ptr<boat_links>> boat_links::open(ise::environment& env, const std::string& key_file,
                                                          ise::when_damaged how) {
    auto of_file = read_keys(env, key_file);
    if (!of_file) return of_file.error();
    auto recovery = read_recovery(env, key_file, of_file->now.boat);
    if (!recovery) return recovery.error();
    auto key_disk = ise::database::open(place(env, key_file + ".keys.db"), keys_schema, how);
    if (!key_disk) return key_disk.error();
    auto disk = ise::database::open(place(env, key_file + ".boat.db"), boat_schema, std::move(how));
    if (!disk) return disk.error();
    std::unique_ptr<boat_links> made(new boat_links(std::move(*disk), std::move(*key_disk)));
    auto keys = known_keys(made->key_disk_, *of_file);
    if (!keys) return keys.error();
    std::vector<std::string> names;
    for (std::size_t i = 0; i < link_count; ++i) names.emplace_back(name_of(static_cast<link_id>(i)));
    auto end_of = [&env, self = made.get(), names](const radio_key& key) -> ise::result<boat_seal> {
        auto of = fingerprint(key);
        auto link = static_cast<link_id>(std::ranges::find(names, key.link) - names.begin());
        auto kept = kept_of(self->disk_, of, link);
        if (!kept) return kept.error();
        auto random = env.random();
        boat_seal fresh(key, *kept, random, nullptr);
        kept_counters keeper(self->disk_, of, link, fresh.counters());
        // So that the notice of this start holds after the next one, too.
        if (!*kept) {
            if (auto put = keeper(fresh.counters()); !put) return put.error();
        }
        return boat_seal(key, *kept, random, std::move(keeper));
    };
    auto keep = [self = made.get(), of = fingerprint(of_file->now)](const boat_keys& now) {
        return keep_keys(self->key_disk_, of, now);
    };
    auto ring = boat_ring::make(std::move(*keys), std::move(*recovery), std::move(names), end_of, keep);
    if (!ring) return ring.error();
    made->ring_.emplace(std::move(*ring));
    return made;
}

ise::bytes boat_links::take_notice(link_id link, ise::time_point now, ise::duration every) {
    auto i = static_cast<std::size_t>(link);
    if (!ring_->notice_due(i) || (told_at_[i] && now - *told_at_[i] < every)) return {};
    told_at_[i] = now;
    return ring_->take_notice(i);
}

ise::result<std::unique_ptr<shore_link>> shore_link::open(ise::environment& env, const std::string& key_file,
                                                          link_id link, bool secondary, ise::when_damaged how) {
    auto keys = read_keys(env, key_file);
    if (!keys) return keys.error();
    auto disk = ise::database::open(
        place(env, fmt::format("{}.{}{}.db", key_file, name_of(link), secondary ? ".secondary" : "")), shore_schema,
        std::move(how));
    if (!disk) return disk.error();
    std::unique_ptr<shore_link> made(new shore_link(env, std::move(*disk)));
    bool known = false; // whether the link was used with that key
    auto end_of = [&](radio_key key) -> ise::result<shore_seal> {
        auto of = fingerprint(key);
        auto rows = made->disk_.query("SELECT session, until FROM reserved WHERE of = ?", {of});
        if (!rows) return rows.error();
        known = !rows->empty();
        shore_counters kept;
        if (known) {
            kept.of = static_cast<session>(rows->front().integer(0));
            kept.reserved = static_cast<std::uint64_t>(rows->front().integer(1));
        }
        key.link = name_of(link);
        return shore_seal(std::move(key), secondary ? lane::secondary : lane::primary, kept,
                          kept_reservation(made->disk_, of, kept));
    };
    auto now = end_of(keys->now);
    if (!now) return now.error();
    if (!keys->next) {
        made->ring_.emplace(std::move(*now));
        return made;
    }
    auto next = end_of(*keys->next);
    if (!next) return next.error();
    made->ring_.emplace(std::move(*now), std::move(*next), std::move(keys->recovery), known);
    return made;
}

ise::result<ise::bytes> shore_link::open(ise::bytes_view raw) {
    auto opened = ring_->open(raw);
    if (opened) verified_at_ = std::chrono::floor<std::chrono::milliseconds>(env_.wall());
    else ++refused_;
    return opened;
}

link_seal shore_link::report(const std::unique_ptr<shore_link>& of) {
    link_seal made;
    if (!of) return made;
    made.sealed = true;
    made.epoch = of->key().epoch;
    made.key = fingerprint(of->key());
    if (const auto* next = of->ring_->next_key()) made.next_epoch = next->epoch;
    made.verified_at = of->verified_at_;
    made.refused = of->refused_;
    return made;
}

std::unique_ptr<shore_link> shore_link::open_for(ise::component& proxy, const std::string& key_file, link_id link,
                                                 bool secondary) {
    if (key_file.empty()) {
        proxy.log().warning(
            "the radio is not sealed: whoever can send on this link is taken for the boat (set radio-key)", {});
        ise::caution open;
        open.message = fmt::format("telecommands over {} are not sealed: anybody with a radio can command the boat and "
                                   "send telemetry in its name",
                                   name_of(link));
        open.advice = make_a_key;
        proxy.services().warn_of(std::move(open));
        return nullptr;
    }
    ise::when_damaged damaged(
        proxy.log(), [&proxy] { return std::chrono::floor<std::chrono::system_clock::duration>(proxy.wall()); });
    auto made = std::move(open(proxy.env(), key_file, link, secondary, std::move(damaged)).value());
    proxy.log().info("the radio is sealed", {{"boat", made->key().boat}, {"key", fingerprint(made->key())}});
    return made;
}

} // namespace atirma::seal
