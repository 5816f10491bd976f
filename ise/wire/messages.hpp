#pragma once
#include <array>
#include <cstdint>
#include <optional>
#include <string>
#include <vector>

/// The bodies of control frames: plain packets, encoded like every other (ise/packet/LAYOUT.md). Fields are only
/// ever appended; a receiver takes what is missing from the defaults here and passes over what it does not know.
namespace ise::wire {

inline constexpr std::uint32_t magic = 0x31455349; ///< "ISE1"
inline constexpr std::uint16_t oldest_version = 1;
inline constexpr std::uint16_t newest_version = 1;

/// Bits of `features`: what both sides have is used.
namespace feature {
inline constexpr std::uint64_t pieces = 1;  ///< big messages travel in pieces
inline constexpr std::uint64_t schemas = 2; ///< schema texts are answered
inline constexpr std::uint64_t resume = 4;  ///< subscriptions can be resumed by ticket
inline constexpr std::uint64_t objects = 8; ///< within one process: packets as the objects that they are
/// What a side's clock says is told, and deadlines are times of the provider's.
inline constexpr std::uint64_t clock = 16;
inline constexpr std::uint64_t stamps = 32;                       ///< packets carry the time of their publication
inline constexpr std::uint64_t traces = 64;                       ///< traces have 128 bits
inline constexpr std::uint64_t packet_traces = 128;               ///< published packets carry traces
inline constexpr std::uint64_t loans = 256;                       ///< between two processes: packets in shared memory
inline constexpr std::uint64_t first = pieces | schemas | resume; ///< those of every peer
/// Over every transport.
inline constexpr std::uint64_t all = first | clock | stamps | traces | packet_traces;
} // namespace feature

/// Who speaks.
struct identity {
    std::string path;              ///< of the component; empty for an anonymous client
    std::string host_name;         ///< for people
    std::string process_key;       ///< one process and life
    std::uint64_t incarnation = 0; ///< one life of the component
    std::uint64_t epoch = 0;       ///< of its name, 0 if none was granted
};

/// Every receiver accepts frames of this size, so that a sender can cut its messages without asking.
inline constexpr std::uint32_t min_frame_limit = 256u << 10;

/// What the sender of it accepts from the other side.
struct limits {
    std::uint32_t max_frame_bytes = 1u << 20; ///< at least min_frame_limit
    std::uint64_t max_message_bytes = 256ull << 20;
    std::uint32_t max_calls = 1u << 20; ///< pending at once
    std::uint32_t max_subscriptions = 1u << 16;
    std::uint64_t heartbeat_ns = 1'000'000'000; ///< it expects to hear something at least this often
};

struct credentials {
    std::string scheme; ///< empty: none
    std::vector<std::uint8_t> proof;
};

struct hello {
    std::uint32_t magic = wire::magic;
    std::uint16_t oldest = oldest_version;
    std::uint16_t newest = newest_version;
    std::uint64_t features = feature::first;
    identity self;
    std::string wanted_path;              ///< empty: whoever listens there
    std::uint64_t wanted_epoch = 0;       ///< 0: any
    std::uint64_t wanted_incarnation = 0; ///< 0: any
    limits accepts;
    credentials authentication;
    /// Over datagrams: by which the responder keeps its replies to numbered calls. Secret between the two; 0: none.
    std::uint64_t reply_key = 0;
    /// With a shared key: the endpoint as it was connected, then as it was asked for where that is another text.
    std::vector<std::string> dialled;
    std::string host_key; ///< with `dialled`: equal where loopback and local sockets reach
};

struct welcome {
    std::uint16_t version = newest_version;
    std::uint64_t features = feature::first;
    identity self;
    limits accepts;
    credentials authentication;
    std::int64_t clock_ns = 0; ///< the sender's monotonic clock (`feature::clock`)
};

/// Answers a hello that is not accepted, or ends a session (goodbye).
struct farewell {
    std::uint8_t code = 0; ///< ise::errc
    std::string reason;
};

inline constexpr std::uint64_t unknown_loss = ~std::uint64_t{0};

/// Refuses a subscription, or ends it.
struct ended {
    std::uint8_t code = 0; ///< ise::errc
    std::string reason;
    std::uint64_t lost = 0; ///< packets that were to come and do not; or `unknown_loss`
};

/// A service and its packets. Of a request-response service it goes ahead of the first request, and the caller gives
/// it a number on this connection by which its requests name it.
struct introduction {
    std::string service;
    std::vector<std::uint64_t> fingerprints; ///< of the service's packets, in the order of its kind
};

/// What the provider of an introduced service has in place of the packets that the caller announced.
struct provider_packets {
    std::vector<std::uint64_t> fingerprints;
};

struct call_failure {
    std::uint8_t code = 0;      ///< ise::errc
    std::uint8_t execution = 0; ///< ise::execution
    std::string reason;
};

/// What a full queue does.
enum class overflow : std::uint8_t { keep_latest = 0, keep_last = 1, lossless = 2, disconnect = 3 };

using ticket = std::array<std::uint8_t, 16>;

struct resumption {
    wire::ticket ticket{};
    std::uint64_t incarnation = 0;
    std::uint64_t next_sequence = 0; ///< the first packet that did not arrive
};

struct subscribe {
    introduction service;
    overflow policy = overflow::keep_last;
    std::uint32_t depth = 64;          ///< packets that the provider may hold back
    std::uint64_t credit = 0;          ///< lossless: packets that may be sent before more credit comes
    std::uint64_t min_interval_ns = 0; ///< rate limit; 0: every packet
    bool last_value = true;            ///< the last packet published before comes first
    std::vector<resumption> resume;    ///< none or one
    std::vector<std::uint8_t> request; ///< the user's own subscribe packet
};

struct subscribed {
    wire::ticket ticket{};
    std::uint64_t incarnation = 0;
    std::uint64_t first_sequence = 0; ///< of the first packet that is to be counted
    bool resumed = false;
    std::vector<std::uint64_t> fingerprints;
    std::vector<std::uint8_t> response; ///< the user's own subscribe response
};

struct schema_request {
    std::vector<std::uint64_t> fingerprints;
};

struct schema_answer {
    std::uint64_t fingerprint = 0;
    std::string text; ///< empty: not known here
};

} // namespace ise::wire
