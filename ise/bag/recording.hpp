#pragma once
#include <ise/bag/protobuf.hpp>
#include <ise/bag/reader.hpp>
#include <ise/bag/writer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>
#include <ise/packet/schema.hpp>
#include <ise/service/dynamic.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

/// What ISE records, and how it lies in MCAP files (README.md).
namespace ise::bag {

/// What a channel has.
enum class content : std::uint8_t {
    packets, ///< of a subscription
    calls,   ///< of a request-response service: a packet `call` each
    runs,    ///< of an action: a packet of `schema_of_runs` each
    events,  ///< of the recording itself
};

/// A channel: the packets of one service, or events. Immutable.
class topic {
public:
    /// The packets, the calls or the runs of a service of `component`.
    topic(std::string component, const dynamic_contract& service);
    /// Events of one kind, under `ise/NAME`.
    topic(std::string name, schema packet);
    /// Of a channel in a file. errc::malformed if it is none of ISE's, or damaged.
    static result<topic> of(const channel_record& channel);

    /// "atirma/boat/position"
    const std::string& name() const noexcept { return name_; }
    const std::string& component() const noexcept { return component_; } ///< empty: of events
    const std::string& service() const noexcept { return service_; }     ///< see above
    content what() const noexcept { return what_; }
    /// The packets of its messages; of calls with request and response, of runs with goal, feedback and result.
    const protobuf_type& packet() const noexcept { return *packet_; }
    /// The service; nothing for events.
    const std::optional<dynamic_contract>& contract() const noexcept { return contract_; }

    /// For `writer::add_channel`.
    string_map metadata() const;

private:
    std::string name_, component_, service_;
    content what_ = content::events;
    std::optional<dynamic_contract> contract_;
    std::shared_ptr<const protobuf_type> packet_;
};

/// A call in a recording. Its packet has these fields, with request and response as the service's own packets:
/// `struct call{caller,outcome,message,took,deadline,request,response:optional<…>}`.
struct recorded_call {
    std::string caller;
    std::string outcome; ///< "ok", or the name of an errc
    std::string message; ///< of a failure
    duration took{};
    duration deadline{}; ///< that its caller had left when the request was read; zero: none
    bytes request;
    std::optional<bytes> response; ///< where the outcome is "ok"
};
/// The schema of a service's calls.
schema call_schema(const dynamic_contract& service);
/// To the packet of the schema, and back: errc::malformed.
bytes encode_call(const recorded_call& call);
result<recorded_call> decode_call(const dynamic_contract& service, bytes_view packet); ///< see above

// --- events ---------------------------------------------------------------------------------------------------------

/// Packets that a service published and the recording does not have.
struct gap_event {
    std::string component;
    std::string service;
    std::optional<std::uint64_t> lost; ///< packets; nothing: unknown, as the provider restarted
    std::string reason;
};
/// A name that came, changed or went.
struct name_event {
    std::string change; ///< "present" at the beginning, "added", "changed", "removed"
    std::string path;
    std::string type;
    std::string state;
    std::string host;
    std::uint64_t process_id = 0;
    std::uint64_t incarnation = 0;
    std::vector<std::string> endpoints;
};
/// A parameter of a component, when the component was seen for the first time, or after a change.
struct parameter_event {
    std::string component;
    std::string name;
    std::vector<std::string> values;
    std::string unit;
};

inline constexpr const char* gaps_topic = "gaps";             ///< under `ise/`
inline constexpr const char* names_topic = "names";           ///< see above
inline constexpr const char* parameters_topic = "parameters"; ///< see above

// --- files ----------------------------------------------------------------------------------------------------------

/// A message on its way into a file.
struct recorded_message {
    std::shared_ptr<const topic> of;
    std::uint32_t sequence = 0;
    timestamp log_time = 0;
    timestamp publish_time = 0;
    bytes packet; ///< ISE's bytes
};

/// How recordings are written.
struct recording_options {
    std::string file;              ///< "voyage.mcap"; with splitting voyage_0001.mcap and so on
    writer_options format;         ///< of the files
    std::uint64_t split_bytes = 0; ///< a new file after so many; 0: none
    duration split_time{};         ///< a new file after this time; 0: none
    bool numbered = false;         ///< numbers also where nothing is split, for recordings that begin again
    /// Files that are attached to each recording at its beginning, and at its end again if they have changed since, as
    /// logs do; a reader takes the last of a name. At most 64 MiB each (`max_attached_bytes`).
    std::vector<std::string> attached;
    string_map about; ///< metadata `ise` of each file
};

/// Counts of a recording.
struct recording_counts {
    std::uint64_t messages = 0;
    std::uint64_t bytes = 0; ///< in files
    std::vector<std::string> files;
};

/// Writes messages to files. Used by one thread at a time, and not on a loop: it waits for the disk.
class recording_file {
public:
    explicit recording_file(recording_options options);
    ~recording_file();
    recording_file(recording_file&&) noexcept;
    recording_file& operator=(recording_file&&) noexcept;

    /// Begins the first file, before there is a message. Errors as below, and those of a file that is to be attached
    /// and cannot be read. Later such a file is left out, which the metadata `ise.not_attached` says.
    result<void> begin(timestamp now);
    /// Writes a message, into a new file where one is due. errc::io_failed. After these others can be written:
    /// errc::malformed for a packet that does not match its schema; errc::too_large for one beyond a limit
    /// (`protobuf_limits`), or of a service for which this file has no channel left.
    result<void> write(const recorded_message& message);
    /// Adds metadata to the present file; begins one where there is none. Errors as above.
    result<void> note(const std::string& name, const string_map& what, timestamp now);
    /// Puts the messages written so far into the file.
    result<void> flush();
    /// Ends the present file; the next message begins another.
    result<void> close();
    const recording_counts& counts() const noexcept; ///< so far

private:
    struct state;
    std::unique_ptr<state> state_;
};

} // namespace ise::bag
