#include <components/communication_node/postgres_rows.hpp>

#include <components/communication_node/postgres_schema.hpp>

#include <fmt/format.h>

namespace atirma::postgres_rows_of {
namespace {

/// A list whose elements need no quotes.
void append(std::string& list, std::string_view element) {
    list += list.empty() ? '{' : ',';
    list += element;
}

void close(std::string& list) { list += list.empty() ? "{}" : "}"; }

} // namespace

telemetry_packet packet_in(const postgres_row& row, std::size_t from) {
    telemetry_packet made;
    made.position = number_of(row, from);
    made.boot = static_cast<std::uint16_t>(integer_of(row, from + 1));
    made.sequence = static_cast<std::uint32_t>(integer_of(row, from + 2));
    made.measured_at = time_of(row, from + 3);
    made.link = static_cast<link_id>(integer_of(row, from + 4));
    made.received_at = time_of(row, from + 5);
    made.history = text_of(row, from + 6) == "t";
    made.raw = bytes_of_postgres(row.at(from + 7));
    return made;
}

std::vector<command_record> records_in(const postgres_rows& rows) {
    std::vector<command_record> made;
    for (const auto& row : rows) made.push_back(ise::from_json<command_record>(text_of(row, 0)));
    return made;
}

std::optional<std::pair<authority_state, std::uint64_t>> authority_in(const postgres_rows& rows) {
    if (rows.empty()) return std::nullopt;
    return std::pair(ise::from_json<authority_state>(text_of(rows[0], 0)), number_of(rows[0], 1));
}

std::vector<std::string> lines_of(const std::string& text) {
    std::vector<std::string> made;
    for (std::size_t from = 0; from < text.size();) {
        auto end = std::min(text.find('\n', from), text.size());
        made.push_back(text.substr(from, end - from));
        from = end + 1;
    }
    return made;
}

int weight_of(const command_record& record) {
    switch (record.status.state) {
        case telecommand_stage::acknowledged: return 3;
        case telecommand_stage::sent: return 1;
        default: return is_final(record.status.state) ? 2 : 0;
    }
}

packet_arrays::packet_arrays(std::span<const telemetry_packet> packets) {
    for (const auto& p : packets) {
        append(boots, std::to_string(p.boot));
        append(sequences, std::to_string(p.sequence));
        append(times, std::to_string(p.measured_at.time_since_epoch().count()));
        append(links, std::to_string(static_cast<int>(p.link)));
        append(receptions, std::to_string(p.received_at.time_since_epoch().count()));
        append(histories, p.history ? "t" : "f");
        append(contents, "\"\\" + postgres_bytes(p.raw) + "\""); // the backslash doubled, as in every array
    }
    for (auto* list : {&boots, &sequences, &times, &links, &receptions, &histories, &contents}) close(*list);
}

command_arrays::command_arrays(std::span<const command_record> records) {
    std::vector<std::string> by, nodes, texts;
    for (const auto& record : records) {
        const auto& s = record.status;
        append(ids, std::to_string(s.id));
        append(opens, is_final(s.state) ? "f" : "t");
        append(weights, std::to_string(weight_of(record)));
        append(changes, std::to_string(s.at.time_since_epoch().count()));
        by.push_back(s.asked_by);
        nodes.push_back(record.node);
        texts.push_back(ise::to_json(record));
    }
    for (auto* list : {&ids, &opens, &weights, &changes}) close(*list);
    askers = postgres_array(by);
    givers = postgres_array(nodes);
    contents = postgres_array(texts);
}

ise::result<void> check_version(const std::string& database, const postgres_rows& found) {
    auto version = found.empty() ? 0 : integer_of(found[0], 0);
    if (version > postgres_schema::version)
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("{} has version {} of the tables, of a newer program; this one knows version "
                                        "{}: use the newer program",
                                        database, version, postgres_schema::version));
    if (version < postgres_schema::version)
        return ise::failure(ise::errc::io_failed,
                            fmt::format("{} has version {} of the tables, and this program needs version {}: run "
                                        "atirma store migrate URL, as the owner of the database",
                                        database, version, postgres_schema::version));
    return {};
}

} // namespace atirma::postgres_rows_of
