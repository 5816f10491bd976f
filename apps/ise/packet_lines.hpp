#pragma once
#include <ise/packet/dynamic.hpp>
#include <ise/subscription/received.hpp>

#include <string>
#include <vector>

namespace ise::cli {

/// How packets are printed: each as a line of JSON, or of CSV.
struct packet_format {
    std::vector<std::string> fields; ///< only these, by path; empty: the whole packet
    bool csv = false;
    bool stamp = false;    ///< with the time of publication
    bool losses = false;   ///< with the packets lost before it
    bool terminal = false; ///< also in CSV without what a terminal obeys; JSON never has it
    json_style style = json_style::compact;
};

/// Where a packet comes from; empty: it is known anyway.
struct packet_source {
    std::string component, service;
};

/// problem(usage) if packets of this schema have no such field.
void check_field(const schema& of, const std::string& path);
/// The first line of CSV: the fields, or all that the schema has.
std::string csv_heading(const packet_format& how, const schema& of, bool with_source);
/// A packet as its line. A field that this packet does not have (an absent optional, an index beyond the end) is null,
/// in CSV empty.
std::string packet_line(const packet_format& how, const received<dynamic_packet>& packet, const packet_source& from);

} // namespace ise::cli
