#include <components/communication_node/postgres_backfill.hpp>

#include <components/communication_node/postgres_rows.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <set>

namespace atirma {
namespace {

using namespace postgres_rows_of;

constexpr std::size_t keep_page = 1'000;

std::string list_of(const std::set<std::int64_t>& numbers) {
    std::string made;
    for (auto one : numbers) made += fmt::format("{}{}", made.empty() ? "" : ",", one);
    return "{" + made + "}";
}

} // namespace

postgres_backfill::postgres_backfill(postgres_session& in, const std::string& boat) : session_(in) {
    auto fresh = session_.query("SELECT (random() * 9e15)::bigint * 2 + 1").value();
    auto rows = session_.query("SELECT number FROM atirma.open_boat($1, $2)", {boat, text_of(fresh.at(0), 0)}).value();
    boat_ = text_of(rows.at(0), 0);
}

ise::result<std::uint64_t> postgres_backfill::add(std::span<const telemetry_packet> packets) {
    try {
        session_.run_script("BEGIN").value();
        auto fresh = add_locked(packets);
        session_.run_script("COMMIT").value();
        return fresh;
    } catch (const ise::error& problem) {
        (void)session_.run_script("ROLLBACK"); // nothing to do if that fails: the connection is gone
        return problem.why();
    }
}

std::uint64_t postgres_backfill::add_locked(std::span<const telemetry_packet> packets) {
    if (packets.empty()) return 0;
    auto row = session_.query("SELECT head FROM atirma.boats WHERE number = $1 FOR UPDATE", {boat_}).value();
    auto head = number_of(row.at(0), 0);
    std::set<std::int64_t> days;
    std::set<std::pair<std::uint16_t, std::uint32_t>> numbers;
    for (const auto& packet : packets) {
        days.insert(std::chrono::floor<std::chrono::days>(packet.measured_at).time_since_epoch() /
                    std::chrono::milliseconds(1));
        numbers.emplace(packet.boot, packet.sequence);
    }
    bool unlike = numbers.size() == packets.size();
    if (unlike) {
        auto known =
            session_
                .query("SELECT EXISTS(SELECT 1 FROM atirma.packets WHERE boat = $1 AND (boot, sequence) >= ($2, $3) "
                       "AND (boot, sequence) <= ($4, $5))",
                       {boat_, std::to_string(numbers.begin()->first), std::to_string(numbers.begin()->second),
                        std::to_string(numbers.rbegin()->first), std::to_string(numbers.rbegin()->second)})
                .value();
        unlike = text_of(known.at(0), 0) == "f";
    }
    if (!unlike) {
        std::uint64_t fresh = 0;
        for (std::size_t at = 0; at < packets.size(); at += keep_page) {
            packet_arrays arrays(packets.subspan(at, std::min(keep_page, packets.size() - at)));
            auto kept = session_
                            .query("SELECT fresh FROM atirma.keep($1, $2, $3, $4, $5, $6, $7, $8)",
                                   {boat_, arrays.boots, arrays.sequences, arrays.times, arrays.links,
                                    arrays.receptions, arrays.histories, arrays.contents})
                            .value();
            fresh += number_of(kept.at(0), 0);
        }
        return fresh;
    }
    session_.query("SELECT atirma.make_partitions($1)", {list_of(days)}).value();
    auto before = std::to_string(head);
    std::string lines;
    for (const auto& p : packets)
        lines += fmt::format("{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t{}\t\\{}\n", boat_, p.boot, p.sequence,
                             p.measured_at.time_since_epoch().count(), ++head, p.received_at.time_since_epoch().count(),
                             static_cast<int>(p.link), p.raw.size() > 1 ? std::to_integer<int>(p.raw[1]) : 0,
                             p.history ? 't' : 'f', postgres_bytes(p.raw));
    session_
        .copy_in(
            "COPY atirma.packets(boat, boot, sequence, measured, position, received, link, kind, history, raw) FROM "
            "STDIN",
            lines)
        .value();
    session_.query("UPDATE atirma.boats SET head = $2 WHERE number = $1", {boat_, std::to_string(head)}).value();
    session_.query("SELECT atirma.know_newest($1, $2)", {boat_, before}).value();
    return packets.size();
}

ise::result<void> postgres_backfill::put(std::span<const command_record> records) {
    command_arrays arrays(records);
    auto done = session_.query("SELECT atirma.put_commands($1, $2, $3, $4, $5, $6, $7, $8)",
                               {boat_, arrays.ids, arrays.opens, arrays.askers, arrays.weights, arrays.changes,
                                arrays.givers, arrays.contents});
    if (!done) return done.error();
    return {};
}

ise::result<bool> postgres_backfill::put(const authority_state& state, std::uint64_t change) {
    for (;;) {
        auto there = session_.query("SELECT epoch, change FROM atirma.boats WHERE number = $1", {boat_});
        if (!there) return there.error();
        auto epoch = number_of(there->at(0), 0), number = number_of(there->at(0), 1);
        if (std::pair(epoch, number) >= std::pair(std::uint64_t{state.epoch}, change)) return false;
        auto put = session_.query("SELECT atirma.put_authority($1, $2, $3, $4, $5, $6)",
                                  {boat_, std::to_string(epoch), std::to_string(number), std::to_string(state.epoch),
                                   std::to_string(change), ise::to_json(state)});
        if (!put) return put.error();
        if (text_of(put->at(0), 0) == "t") return true;
    }
}

} // namespace atirma
