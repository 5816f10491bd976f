#include <components/communication_node/postgres_tools.hpp>

#include <components/communication_node/postgres_backfill.hpp>
#include <components/communication_node/postgres_rows.hpp>
#include <components/communication_node/postgres_schema.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace postgres_rows_of;

constexpr std::size_t file_page = 20'000, database_page = 5'000, command_pages = 500;

/// The result of `work`, or the failure that it throws.
template <class Work>
auto without_throwing(Work work) -> ise::result<decltype(work())> {
    try {
        return work();
    } catch (const ise::error& problem) {
        return problem.why();
    }
}

postgres_session open_current(const std::string& url) {
    auto made = postgres_session::open(url).value();
    auto there = made.query("SELECT to_regclass('atirma.meta') IS NOT NULL").value();
    postgres_rows version;
    if (text_of(there.at(0), 0) == "t") version = made.query("SELECT version FROM atirma.meta").value();
    check_version(postgres_name(url), version).value();
    return made;
}

std::optional<std::int64_t> number_of_boat(postgres_session& in, const std::string& boat) {
    auto rows = in.query("SELECT number FROM atirma.boats WHERE boat = $1", {boat}).value();
    return rows.empty() ? std::nullopt : std::optional(integer_of(rows[0], 0));
}

std::string rules_in(postgres_session& session) {
    auto rules = session.query("SELECT boat, kind, days FROM atirma.retention ORDER BY boat, kind").value();
    std::string text = rules.empty() ? "packets are kept for ever" : "packets are kept, by the most particular rule:";
    for (const auto& row : rules)
        text += fmt::format("\n  {}, {}: {} days", text_of(row, 0) == "*" ? "all boats" : text_of(row, 0),
                            integer_of(row, 1) < 0 ? "all kinds" : "kind " + text_of(row, 1), text_of(row, 2));
    return text;
}

} // namespace

ise::result<std::string> migrate_database(const std::string& url) {
    return without_throwing([&] {
        auto session = postgres_session::open(url).value();
        session.run_script("BEGIN; SELECT pg_advisory_xact_lock(hashtext('atirma.migrate'))").value();
        auto there = session.query("SELECT to_regclass('atirma.meta') IS NOT NULL").value();
        std::int64_t version = 0;
        if (text_of(there.at(0), 0) == "t") {
            auto rows = session.query("SELECT version FROM atirma.meta").value();
            version = rows.empty() ? 0 : integer_of(rows[0], 0);
            if (version > postgres_schema::version) check_version(postgres_name(url), rows).value();
        }
        auto before = version;
        for (; version < postgres_schema::version; ++version)
            session.run_script(std::string(postgres_schema::scripts[static_cast<std::size_t>(version)])).value();
        session.query("UPDATE atirma.meta SET version = $1", {std::to_string(version)}).value();
        session.run_script("COMMIT").value();
        return before == version ? fmt::format("{} has version {} already", postgres_name(url), version)
                                 : fmt::format("{} has version {} now", postgres_name(url), version);
    });
}

ise::result<std::string> import_store(const std::string& file, const std::string& url, const std::string& boat) {
    return without_throwing([&] {
        auto reader = store_reader::open(file).value();
        auto session = open_current(url);
        postgres_backfill into(session, boat);
        std::uint64_t fresh = 0;
        for (auto packets = reader.next_packets(file_page); !packets.empty(); packets = reader.next_packets(file_page))
            fresh += into.add(packets).value();
        for (auto records = reader.next_commands(command_pages); !records.empty();
             records = reader.next_commands(command_pages))
            into.put(records).value();
        auto held = reader.authority();
        bool newer = held.first.epoch != 0 && into.put(held.first, held.second).value();
        const auto& found = reader.found();
        auto text =
            fmt::format("{} packets and {} telecommands of {} are in {} for boat {}; {} of the packets were new",
                        found.packets, found.telecommands, file, postgres_name(url), boat, fresh);
        if (held.first.epoch != 0 && !newer) text += "; the authority there is as new, and stays";
        if (auto lost = found.damaged_packets + found.damaged_telecommands + found.unreadable.size(); lost != 0)
            text +=
                fmt::format("; {} damaged rows or parts of the file were left out (atirma store check {})", lost, file);
        return text;
    });
}

ise::result<std::string> export_store(const std::string& url, const std::string& boat, const std::string& file) {
    return without_throwing([&] {
        auto session = open_current(url);
        auto number = number_of_boat(session, boat);
        if (!number)
            throw ise::error(ise::errc::invalid_argument,
                             fmt::format("{} has no boat {}: choose another with --boat", postgres_name(url), boat));
        auto id = std::to_string(*number);
        // One state of the database, whatever nodes write meanwhile.
        session.run_script("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY").value();
        auto life = session.query("SELECT life FROM atirma.boats WHERE number = $1", {id}).value();
        auto to = sqlite_store::open(file, number_of(life.at(0), 0)).value();
        std::uint64_t packets = 0, commands = 0;
        auto sql =
            fmt::format("SELECT {} FROM atirma.packets WHERE boat = $1 AND position > $2 ORDER BY position LIMIT {}",
                        columns_of_packet, database_page);
        for (std::string after = "0";;) {
            auto rows = session.query(sql, {id, after}).value();
            if (rows.empty()) break;
            std::vector<telemetry_packet> page;
            for (const auto& row : rows) page.push_back(packet_in(row));
            to.add(page).value();
            packets += page.size();
            after = text_of(rows.back(), 0);
        }
        auto of_commands =
            fmt::format("SELECT record, number FROM atirma.commands WHERE boat = $1 AND number > $2 ORDER BY "
                        "number LIMIT {}",
                        command_pages);
        for (std::string after = "0";;) {
            auto rows = session.query(of_commands, {id, after}).value();
            if (rows.empty()) break;
            auto records = records_in(rows);
            to.put(records).value();
            commands += records.size();
            after = text_of(rows.back(), 1);
        }
        auto states =
            session.query("SELECT state, change FROM atirma.authority WHERE boat = $1 ORDER BY epoch", {id}).value();
        for (const auto& row : states)
            to.put(ise::from_json<authority_state>(text_of(row, 0)), number_of(row, 1)).value();
        session.run_script("COMMIT").value();
        return fmt::format("{} packets and {} telecommands of boat {} are in {}", packets, commands, boat, file);
    });
}

ise::result<store_verdict> check_database(const std::string& url) {
    return without_throwing([&] {
        auto session = open_current(url);
        store_verdict made;
        made.sound = true;
        auto wrong = [&](const std::string& what) {
            made.sound = false;
            made.text += what + "\n";
        };
        auto boats = session.query("SELECT number, boat FROM atirma.boats ORDER BY number").value();
        for (const auto& row : boats) {
            auto id = text_of(row, 0);
            // As of one moment: nodes may store meanwhile.
            session.run_script("BEGIN ISOLATION LEVEL REPEATABLE READ READ ONLY").value();
            auto head = session.query("SELECT head FROM atirma.boats WHERE number = $1", {id}).value();
            // Reads every byte: a page that its checksum does not match is an error of the statement.
            auto found = session.query("SELECT count(*), count(DISTINCT position), coalesce(max(position), 0), "
                                       "coalesce(sum(length(raw) + hashtext(encode(raw, 'hex')) * 0), 0) FROM "
                                       "atirma.packets WHERE boat = $1",
                                       {id});
            auto records =
                !found ? found : session.query("SELECT record, id FROM atirma.commands WHERE boat = $1", {id});
            session.run_script("COMMIT").value();
            if (!found) {
                wrong(fmt::format("{}: its packets cannot be read: {}", text_of(row, 1), found.error().message()));
                continue;
            }
            if (!records) {
                wrong(
                    fmt::format("{}: its telecommands cannot be read: {}", text_of(row, 1), records.error().message()));
                continue;
            }
            const auto& counts = found->at(0);
            made.text += fmt::format("{}: {} packets and {} telecommands\n", text_of(row, 1), integer_of(counts, 0),
                                     records->size());
            if (integer_of(counts, 0) != integer_of(counts, 1))
                wrong(fmt::format("{}: {} packets have the position of another", text_of(row, 1),
                                  integer_of(counts, 0) - integer_of(counts, 1)));
            const auto given = integer_of(head.at(0), 0);
            if (integer_of(counts, 2) > given)
                wrong(fmt::format("{}: a packet has position {}, and {} were given out", text_of(row, 1),
                                  integer_of(counts, 2), given));
            for (const auto& record : *records)
                if (!read_json<command_record>(text_of(record, 0)))
                    wrong(fmt::format("{}: telecommand {} is not readable", text_of(row, 1), text_of(record, 1)));
        }
        auto settings = session
                            .query("SELECT name, setting FROM pg_settings WHERE (name IN ('fsync', 'full_page_writes') "
                                   "AND setting = 'off')")
                            .value();
        for (const auto& row : settings)
            wrong(fmt::format("{} is off: what was acknowledged may be lost with the power", text_of(row, 0)));
        auto checksums = session.query("SHOW data_checksums").value();
        if (text_of(checksums.at(0), 0) == "off")
            made.text += "the server keeps no checksums of its pages (initdb --data-checksums, pg_checksums --enable): "
                         "damage by the disk may not be noticed\n";
        made.text += fmt::format("{} is {}\n", postgres_name(url), made.sound ? "sound" : "not sound");
        return made;
    });
}

ise::result<std::string> set_retention(const std::string& url, const std::string& boat, std::optional<int> kind,
                                       std::optional<std::uint32_t> days) {
    return without_throwing([&] {
        auto session = open_current(url);
        std::string whose = boat.empty() ? "*" : boat, which = std::to_string(kind.value_or(-1));
        if (days)
            session
                .query("INSERT INTO atirma.retention VALUES ($1, $2, $3) ON CONFLICT (boat, kind) DO UPDATE SET days = "
                       "excluded.days",
                       {whose, which, std::to_string(*days)})
                .value();
        else session.query("DELETE FROM atirma.retention WHERE boat = $1 AND kind = $2", {whose, which}).value();
        return rules_in(session);
    });
}

ise::result<std::string> retention(const std::string& url) {
    return without_throwing([&] {
        auto session = open_current(url);
        return rules_in(session);
    });
}

} // namespace atirma
