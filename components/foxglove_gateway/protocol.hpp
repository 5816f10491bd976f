#pragma once
#include <ise/component/introspection.hpp>
#include <ise/component/parameter.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>
#include <ise/core/time.hpp>

#include <cstdint>
#include <map>
#include <optional>
#include <set>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

/// The Foxglove WebSocket protocol: messages of clients read, messages of the server written. Pure.
namespace ise::foxglove {

/// The subprotocols, the preferred one first. Their messages are the same.
inline constexpr const char* subprotocols[] = {"foxglove.sdk.v1", "foxglove.websocket.v1"};

/// Limits on what a client sends.
struct protocol_limits {
    std::size_t max_text_bytes = std::size_t{256} << 10; ///< of a JSON message
    std::size_t max_items = 4096;                        ///< of a list in it
    std::size_t max_name_bytes = 1024;                   ///< of a name or an encoding
};

// --- from clients ---------------------------------------------------------------------------------------------------

struct subscribe_message {
    struct entry {
        std::uint32_t id = 0, channel = 0;
    };
    std::vector<entry> subscriptions;
};
struct unsubscribe_message {
    std::vector<std::uint32_t> ids;
};
struct advertise_message {
    struct entry {
        std::uint32_t id = 0;
        std::string topic, encoding, schema_name;
    };
    std::vector<entry> channels;
};
struct unadvertise_message {
    std::vector<std::uint32_t> ids;
};
struct get_parameters_message {
    std::vector<std::string> names; ///< none: all
    std::optional<std::string> id;
};
struct set_parameters_message {
    struct entry {
        std::string name;
        std::string value; ///< as ISE writes it
    };
    std::vector<entry> parameters;
    std::optional<std::string> id;
};
struct parameter_updates_message {
    bool begin = true;
    std::vector<std::string> names; ///< none: all
};
struct graph_updates_message {
    bool begin = true;
};
struct fetch_asset_message {
    std::string uri;
    std::uint32_t id = 0;
};
struct client_data_message {
    std::uint32_t channel = 0;
    std::string payload;
};
struct call_message {
    std::uint32_t service = 0, call = 0;
    std::string encoding, payload;
};
using client_message = std::variant<subscribe_message, unsubscribe_message, advertise_message, unadvertise_message,
                                    get_parameters_message, set_parameters_message, parameter_updates_message,
                                    graph_updates_message, fetch_asset_message, client_data_message, call_message>;

/// Reads a text message. errc::malformed or errc::too_large, with the operation and the field.
result<client_message> read_text(std::string_view json, const protocol_limits& limits = protocol_limits());
/// Reads a binary message. Errors as above.
result<client_message> read_binary(std::string_view message, const protocol_limits& limits = protocol_limits());

// --- to clients: the payloads of text messages, or of binary ones where it says so ----------------------------------

struct server_info {
    std::string name;
    std::vector<std::string> capabilities;
    std::vector<std::string> encodings; ///< of published messages and calls
    std::map<std::string, std::string> metadata;
    std::string session;
};
std::string write(const server_info& of);

enum class status_level : std::uint8_t { info = 0, warning = 1, error = 2 };
/// `id` names a condition that lasts, until `status_removed`; empty: something that happened.
std::string write_status(status_level level, std::string_view message, std::string_view id = {});
std::string write_status_removed(std::string_view id); ///< see above

/// A schema as viewers read it.
struct schema_info {
    std::string encoding;        ///< of messages: "protobuf", "json"
    std::string name;            ///< of the schema
    std::string schema_encoding; ///< "protobuf", "jsonschema"
    std::string schema;          ///< protobuf: base64 of a FileDescriptorSet
    bool operator==(const schema_info&) const = default;
};
/// Of messages of this type.
schema_info protobuf_schema(std::string name, bytes_view descriptors);

struct channel_info {
    std::uint32_t id = 0;
    std::string topic;
    schema_info schema;
};
std::string write_advertise(const std::vector<const channel_info*>& channels);
std::string write_unadvertise(const std::vector<std::uint32_t>& ids);

struct service_info {
    std::uint32_t id = 0;
    std::string name, type;
    schema_info request, response;
};
std::string write_advertise_services(const std::vector<const service_info*>& services);
std::string write_unadvertise_services(const std::vector<std::uint32_t>& ids);

/// A parameter of a component: `name` is "atirma/boat/wind-speed".
struct parameter_info {
    std::string name;
    parameter_kind kind = parameter_kind::text;
    bool many = false;
    std::vector<std::string> values;
    bool operator==(const parameter_info&) const = default;
};
std::string write_parameters(const std::vector<const parameter_info*>& parameters,
                             const std::optional<std::string>& id);

std::string write_call_failure(std::uint32_t service, std::uint32_t call, std::string_view message);

/// Who publishes, subscribes and provides.
struct connection_graph {
    using edges = std::map<std::string, std::set<std::string>>; ///< of a topic or service: components
    edges published, subscribed, services;
    bool operator==(const connection_graph&) const = default;
};
/// What has changed; empty: nothing.
std::string write_graph_change(const connection_graph& before, const connection_graph& now);

std::string write_message_head(std::uint32_t subscription, wall_time at);          ///< binary; the payload follows
std::string write_time(wall_time at);                                              ///< binary
std::string write_call_response(const call_message& to, std::string_view payload); ///< binary
std::string write_asset(std::uint32_t id, std::string_view content);               ///< binary
std::string write_asset_failure(std::uint32_t id, std::string_view message);       ///< binary

/// The path below the folder of assets that a URI means: "package://boat/hull.glb" is "boat/hull.glb". Refuses paths
/// that could lead elsewhere. errc::invalid_argument.
result<std::string> asset_path(std::string_view uri);

} // namespace ise::foxglove
