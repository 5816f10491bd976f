#pragma once
#include <ise/bag/records.hpp>
#include <ise/core/bytes.hpp>
#include <ise/packet/schema.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace ise::bag {

/// What a tested component did otherwise than in a recording.
struct difference {
    timestamp at = 0; ///< in the recording: when the packet was published, or the call was made
    std::string component;
    std::string service;
    std::string what;         ///< "packet", "call", or "request" of a call that the tested component makes
    std::uint64_t number = 0; ///< of the packet or call, from 0 on
    std::string field;        ///< the first other field: "waypoints[3].latitude_deg"; empty: the whole of it
    std::string recorded;     ///< its JSON, or a failure; empty: there was nothing
    std::string now;          ///< the same
    /// "2017-09-04T08:00:02.101000000Z atirma/boat: packet 4 of 'position', field at.latitude_deg: 28.1 in the
    /// recording, 28.2 now".
    std::string text() const;
};

/// The first field that differs between two packets.
struct field_difference {
    std::string field;
    std::string recorded; ///< JSON
    std::string now;      ///< JSON
};

/// Fields that are not compared, for what differs from run to run, such as random numbers and times of arrival: "store"
/// or "links.last_heard" of every packet and of every packet in it, "telemetry/store" of one service, where it stands
/// there. List positions are left out.
class ignored_fields {
public:
    ignored_fields() = default;
    explicit ignored_fields(std::vector<std::string> fields) : fields_(std::move(fields)) {}
    bool has(const std::string& service, const std::string& field) const;
    bool empty() const noexcept { return fields_.empty(); }

private:
    std::vector<std::string> fields_;
};

/// Compares two packets of a service. Nothing: they are the same, but for ignored fields. Throws errc::malformed if
/// the bytes do not match the schema.
std::optional<field_difference> compare_packets(const schema& of, bytes_view recorded, bytes_view now,
                                                const std::string& service, const ignored_fields& ignored);

} // namespace ise::bag
