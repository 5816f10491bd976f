#include <components/seal_store/seal_store.hpp>

#include <fmt/format.h>

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

ise::result<void> done(const ise::result<std::int64_t>& changed) {
    if (!changed) return changed.error();
    return {};
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

ise::result<void> keep(database& disk, const std::string& of, link_id link, const boat_counters& now) {
    return disk.transaction([&] {
        ise::result<void> put;
        for (std::size_t lane = 0; put && lane < now.lanes.size(); ++lane)
            put = done(
                disk.execute("INSERT OR REPLACE INTO accepted VALUES(?, ?, ?, ?, ?, ?)",
                             {of, static_cast<std::int64_t>(link), static_cast<std::int64_t>(lane),
                              static_cast<std::int64_t>(now.of), static_cast<std::int64_t>(now.lanes[lane].highest),
                              static_cast<std::int64_t>(now.lanes[lane].seen)}));
        return put;
    });
}

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
        made->seals_[i].emplace(
            std::move(mine), *kept, env.random(),
            [self = made.get(), of, link](const boat_counters& now) { return keep(self->disk_, of, link, now); });
        if (*kept) continue;
        // So that the notice of this start holds after the next one, too.
        if (auto put = keep(made->disk_, of, link, made->seals_[i]->counters()); !put) return put.error();
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
                       [self = made.get(), of](const shore_counters& now) {
                           return done(self->disk_.execute(
                               "INSERT OR REPLACE INTO reserved VALUES(?, ?, ?)",
                               {of, static_cast<std::int64_t>(now.of), static_cast<std::int64_t>(now.reserved)}));
                       });
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
