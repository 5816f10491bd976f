#include <components/boat_simulator/boat_memory.hpp>

#include <ise/packet/codec.hpp>

#include <array>

namespace atirma {
namespace {

constexpr std::array<std::string_view, 2> schema{
    "CREATE TABLE boat(one INTEGER PRIMARY KEY CHECK(one = 1), state BLOB NOT NULL);"
    "CREATE TABLE executed(number INTEGER PRIMARY KEY AUTOINCREMENT, id INTEGER NOT NULL UNIQUE, raw BLOB NOT NULL);"
    "CREATE TABLE unacknowledged(number INTEGER PRIMARY KEY, raw BLOB NOT NULL)",
    "CREATE TABLE not_receipted(place INTEGER PRIMARY KEY AUTOINCREMENT, boot INTEGER NOT NULL, sequence INTEGER NOT "
    "NULL, raw BLOB NOT NULL, UNIQUE(boot, sequence))"};

/// A state of a program that stored the periods of all links, whether a telecommand had set them or not.
struct state_with_all_periods {
    std::uint16_t boot = 0;
    std::uint32_t authority = 0;
    waypoint home, place;
    double heading_rad = 0, speed_mps = 0, distance_m = 0;
    sailing_mode mode = sailing_mode::automatic;
    std::vector<waypoint> list;
    std::uint8_t active = 0;
    bool beacon = false;
    std::array<float, parameter_count> parameters{};
    std::array<double, link_count> telemetry_period_s{};
};

ise::result<simulator::remembered_boat> decode_state(const ise::bytes& raw) {
    auto read = ise::try_decode<simulator::remembered_boat>(raw);
    if (read) return read;
    auto old = ise::try_decode<state_with_all_periods>(raw);
    if (!old) return read.error();
    simulator::remembered_boat made{.boot = old->boot,
                                    .authority = old->authority,
                                    .home = old->home,
                                    .place = old->place,
                                    .heading_rad = old->heading_rad,
                                    .speed_mps = old->speed_mps,
                                    .distance_m = old->distance_m,
                                    .mode = old->mode,
                                    .list = std::move(old->list),
                                    .active = old->active,
                                    .beacon = old->beacon,
                                    .parameters = old->parameters};
    // Only that of the radio has no option, so only that one is certainly not an old option's.
    constexpr auto radio = static_cast<std::size_t>(link_id::xbee);
    made.telemetry_period_s[radio] = old->telemetry_period_s[radio];
    return made;
}

ise::result<void> done(const ise::result<std::int64_t>& changed) {
    if (!changed) return changed.error();
    return {};
}

} // namespace

ise::result<boat_memory> boat_memory::open(const std::string& file, ise::when_damaged how) {
    auto opened = ise::database::open(file, schema, ise::when_damaged::keeping_readable(std::move(how)));
    if (!opened) return opened.error();
    return boat_memory(std::move(*opened));
}

ise::result<std::optional<simulator::remembered_boat>> boat_memory::last() {
    auto rows = disk_.query("SELECT state FROM boat");
    if (!rows) return rows.error();
    if (rows->empty()) return std::optional<simulator::remembered_boat>();
    auto read = decode_state(rows->front().bytes(0));
    if (!read) return read.error();
    return std::optional(std::move(*read));
}

ise::result<void> boat_memory::keep(const simulator::remembered_boat& now, std::span<const acknowledgement> fresh) {
    return disk_.transaction([&] {
        auto changed = disk_.execute("INSERT OR REPLACE INTO boat(one, state) VALUES(1, ?)", {ise::encode(now)});
        for (auto one = fresh.begin(); changed && one != fresh.end(); ++one)
            changed = disk_.execute("INSERT OR IGNORE INTO executed(id, raw) VALUES(?, ?)",
                                    {static_cast<std::int64_t>(one->id), encode_acknowledgement(*one)});
        if (changed && !fresh.empty())
            changed = disk_.execute("DELETE FROM executed WHERE number <= (SELECT MAX(number) FROM executed) - ?",
                                    {static_cast<std::int64_t>(kept_commands)});
        return done(changed);
    });
}

ise::result<std::vector<acknowledgement>> boat_memory::executed() {
    auto rows = disk_.query("SELECT raw FROM executed ORDER BY number");
    if (!rows) return rows.error();
    std::vector<acknowledgement> all;
    for (const auto& row : *rows) {
        auto ack = parse_acknowledgement(row.bytes(0));
        if (ack) all.push_back(std::move(*ack));
    }
    return all;
}

ise::result<std::vector<ise::bytes>> boat_memory::take_unacknowledged() {
    auto rows = disk_.query("SELECT raw FROM unacknowledged ORDER BY number");
    if (!rows) return rows.error();
    std::vector<ise::bytes> all;
    for (const auto& row : *rows) all.push_back(row.bytes(0));
    auto kept = disk_.transaction([&] {
        auto changed = disk_.execute("DELETE FROM unacknowledged");
        for (std::size_t i = 0; changed && i < all.size(); ++i)
            changed = disk_.execute("INSERT INTO unacknowledged(number, raw) VALUES(?, ?)",
                                    {static_cast<std::int64_t>(i + 1), all[i]});
        return changed;
    });
    if (!kept) return kept.error();
    return all;
}

ise::result<void> boat_memory::put(std::uint32_t number, const ise::bytes& raw) {
    return done(disk_.execute("INSERT OR REPLACE INTO unacknowledged(number, raw) VALUES(?, ?)",
                              {static_cast<std::int64_t>(number), raw}));
}

ise::result<void> boat_memory::forget(std::uint32_t number) {
    return done(disk_.execute("DELETE FROM unacknowledged WHERE number <= ?", {static_cast<std::int64_t>(number)}));
}

ise::result<std::vector<ise::bytes>> boat_memory::not_receipted() {
    auto rows = disk_.query("SELECT raw FROM not_receipted ORDER BY place");
    if (!rows) return rows.error();
    std::vector<ise::bytes> all;
    for (const auto& row : *rows) all.push_back(row.bytes(0));
    return all;
}

ise::result<void> boat_memory::put(packet_name name, const ise::bytes& raw) {
    return done(disk_.execute("INSERT OR REPLACE INTO not_receipted(boot, sequence, raw) VALUES(?, ?, ?)",
                              {std::int64_t{name.first}, std::int64_t{name.second}, raw}));
}

ise::result<void> boat_memory::forget(const std::vector<packet_name>& names) {
    return disk_.transaction([&] {
        ise::result<void> gone;
        for (auto name = names.begin(); gone && name != names.end(); ++name)
            gone = done(disk_.execute("DELETE FROM not_receipted WHERE boot = ? AND sequence = ?",
                                      {std::int64_t{name->first}, std::int64_t{name->second}}));
        return gone;
    });
}

} // namespace atirma
