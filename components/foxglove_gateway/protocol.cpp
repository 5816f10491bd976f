#include <components/foxglove_gateway/protocol.hpp>

#include <ise/core/little_endian.hpp>
#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <limits>

namespace ise::foxglove {
namespace {

using json = nlohmann::json;

constexpr std::size_t max_depth = 32; // of a client's JSON

std::string text_of(const json& value) { return value.dump(-1, ' ', false, json::error_handler_t::replace); }

// --- reading --------------------------------------------------------------------------------------------------------

// Throws errc::malformed with operation and field.
class fields {
public:
    fields(const json& of, std::string where, const protocol_limits& limits)
        : of_(of), where_(std::move(where)), limits_(limits) {}

    std::string text(const char* name) const {
        const auto& value = required(name);
        if (!value.is_string()) wrong(name, "a string");
        return checked(value.get<std::string>(), name);
    }
    std::string text_or_none(const char* name) const { return of_.contains(name) ? text(name) : std::string(); }
    std::optional<std::string> optional_text(const char* name) const {
        auto found = of_.find(name);
        if (found == of_.end() || found->is_null()) return std::nullopt;
        return text(name);
    }
    std::uint32_t number(const char* name) const { return number(required(name), name); }
    std::vector<std::uint32_t> numbers(const char* name) const {
        std::vector<std::uint32_t> made;
        for (const auto& one : list(name)) made.push_back(number(one, name));
        return made;
    }
    std::vector<std::string> texts(const char* name) const {
        std::vector<std::string> made;
        for (const auto& one : list(name)) {
            if (!one.is_string()) wrong(name, "a list of strings");
            made.push_back(checked(one.get<std::string>(), name));
        }
        return made;
    }
    const json& list(const char* name) const {
        const auto& value = required(name);
        if (!value.is_array()) wrong(name, "a list");
        if (value.size() > limits_.max_items)
            throw error(errc::too_large,
                        fmt::format("{}: {} has more than {} entries (max_items)", where_, name, limits_.max_items));
        return value;
    }
    const json& required(const char* name) const {
        auto found = of_.find(name);
        if (found == of_.end()) throw error(errc::malformed, fmt::format("{}: {} is missing", where_, name));
        return *found;
    }
    [[noreturn]] void wrong(const char* name, const char* wanted) const {
        throw error(errc::malformed, fmt::format("{}: {} is not {}", where_, name, wanted));
    }

private:
    std::string checked(std::string value, const char* name) const {
        if (value.size() > limits_.max_name_bytes)
            throw error(errc::too_large, fmt::format("{}: {} has more than {} bytes (max_name_bytes)", where_, name,
                                                     limits_.max_name_bytes));
        return value;
    }
    std::uint32_t number(const json& value, const char* name) const {
        if (value.is_number_unsigned() && value.get<std::uint64_t>() <= std::numeric_limits<std::uint32_t>::max())
            return value.get<std::uint32_t>();
        wrong(name, "an integer from 0 to 4294967295");
    }

    const json& of_;
    std::string where_;
    const protocol_limits& limits_;
};

// Each entry of a list, as an object.
template <class Read>
void each(const fields& in, const char* name, const std::string& where, const protocol_limits& limits, Read read) {
    for (const auto& one : in.list(name)) {
        if (!one.is_object()) in.wrong(name, "a list of objects");
        read(fields(one, where, limits), one);
    }
}

std::string value_text(const json& value, const std::string& name) {
    if (value.is_string()) return value.get<std::string>();
    if (value.is_boolean()) return value.get<bool>() ? "true" : "false";
    if (value.is_number_integer()) return value.dump();
    if (value.is_number()) { // whole numbers come as 3.0 from some clients
        auto number = value.get<double>();
        if (number == std::floor(number) && std::abs(number) < 9e15)
            return fmt::format("{}", static_cast<std::int64_t>(number));
        return fmt::format("{}", number);
    }
    throw error(errc::malformed,
                fmt::format("setParameters: the value of {} is not a string, a number, true or false", name));
}

client_message read_operation(const std::string& op, const json& from, const protocol_limits& limits) {
    fields in(from, op, limits);
    if (op == "subscribe") {
        subscribe_message made;
        each(in, "subscriptions", op, limits, [&](const fields& one, const json&) {
            made.subscriptions.push_back({one.number("id"), one.number("channelId")});
        });
        return made;
    }
    if (op == "unsubscribe") {
        unsubscribe_message made;
        made.ids = in.numbers("subscriptionIds");
        return made;
    }
    if (op == "advertise") {
        advertise_message made;
        each(in, "channels", op, limits, [&](const fields& one, const json&) {
            made.channels.push_back(
                {one.number("id"), one.text("topic"), one.text("encoding"), one.text_or_none("schemaName")});
        });
        return made;
    }
    if (op == "unadvertise") {
        unadvertise_message made;
        made.ids = in.numbers("channelIds");
        return made;
    }
    if (op == "getParameters") {
        get_parameters_message made;
        made.names = in.texts("parameterNames");
        made.id = in.optional_text("id");
        return made;
    }
    if (op == "setParameters") {
        set_parameters_message made;
        each(in, "parameters", op, limits, [&](const fields& one, const json& all) {
            auto name = one.text("name");
            if (!all.contains("value") || all["value"].is_null())
                throw error(errc::malformed, fmt::format("setParameters: {} cannot be unset; give a value", name));
            auto value = value_text(all["value"], name);
            made.parameters.push_back({std::move(name), std::move(value)});
        });
        made.id = in.optional_text("id");
        return made;
    }
    if (op == "subscribeParameterUpdates" || op == "unsubscribeParameterUpdates") {
        parameter_updates_message made;
        made.begin = op == "subscribeParameterUpdates";
        made.names = in.texts("parameterNames");
        return made;
    }
    if (op == "subscribeConnectionGraph" || op == "unsubscribeConnectionGraph") {
        graph_updates_message made;
        made.begin = op == "subscribeConnectionGraph";
        return made;
    }
    if (op == "fetchAsset") {
        fetch_asset_message made;
        made.uri = in.text("uri");
        made.id = in.number("requestId");
        return made;
    }
    throw error(errc::malformed, fmt::format("there is no operation \"{}\"", op.substr(0, 64)));
}

std::uint32_t u32_at(std::string_view from, std::size_t at) noexcept {
    return ise::detail::load_little<std::uint32_t>(reinterpret_cast<const std::byte*>(from.data()) + at);
}

void append_u32(std::string& to, std::uint32_t value) {
    for (int shift = 0; shift < 32; shift += 8) to += static_cast<char>(value >> shift & 0xff);
}
void append_u64(std::string& to, std::uint64_t value) {
    for (int shift = 0; shift < 64; shift += 8) to += static_cast<char>(value >> shift & 0xff);
}
void append_time(std::string& to, wall_time at) {
    append_u64(to, static_cast<std::uint64_t>(std::max<std::int64_t>(at.time_since_epoch().count(), 0)));
}

// --- writing --------------------------------------------------------------------------------------------------------

json schema_json(const schema_info& of) {
    return {{"encoding", of.encoding},
            {"schemaName", of.name},
            {"schemaEncoding", of.schema_encoding},
            {"schema", of.schema}};
}

json value_json(parameter_kind kind, const std::string& text) {
    if (kind == parameter_kind::boolean) return text == "true";
    if (kind == parameter_kind::integer || kind == parameter_kind::number) {
        auto made = json::parse(text, nullptr, false);
        if (made.is_number()) return made;
    }
    return text;
}

} // namespace

result<client_message> read_text(std::string_view text, const protocol_limits& limits) {
    if (text.size() > limits.max_text_bytes)
        return failure(errc::too_large,
                       fmt::format("a text message has more than {} bytes (max_text_bytes)", limits.max_text_bytes));
    bool deep = false;
    auto bounded = [&deep](int depth, json::parse_event_t event, const json&) {
        const bool begins = event == json::parse_event_t::object_start || event == json::parse_event_t::array_start;
        deep = deep || (begins && depth > static_cast<int>(max_depth));
        return !deep;
    };
    auto read = json::parse(text, bounded, false);
    if (deep) return failure(errc::too_large, fmt::format("a text message has more than {} levels", max_depth));
    if (read.is_discarded()) return failure(errc::malformed, "a text message is not JSON");
    if (!read.is_object() || !read.contains("op") || !read["op"].is_string())
        return failure(errc::malformed, "a text message is not an object with an \"op\"");
    try {
        return read_operation(read["op"].get<std::string>(), read, limits);
    } catch (const error& why) {
        return why.why();
    }
}

result<client_message> read_binary(std::string_view message, const protocol_limits& limits) {
    if (message.empty()) return failure(errc::malformed, "a binary message is empty");
    const auto opcode = static_cast<std::uint8_t>(message[0]);
    if (opcode == 1) {
        if (message.size() < 5)
            return failure(errc::malformed, "a message of a client's channel has less than 5 bytes");
        client_data_message made;
        made.channel = u32_at(message, 1);
        made.payload = message.substr(5);
        return client_message(std::move(made));
    }
    if (opcode == 2) {
        if (message.size() < 13) return failure(errc::malformed, "a service call has less than 13 bytes");
        call_message made;
        made.service = u32_at(message, 1);
        made.call = u32_at(message, 5);
        const std::size_t length = u32_at(message, 9);
        if (length > message.size() - 13)
            return failure(errc::malformed, "the encoding of a service call is longer than the call");
        if (length > limits.max_name_bytes)
            return failure(errc::too_large,
                           fmt::format("the encoding of a service call has more than {} bytes", limits.max_name_bytes));
        made.encoding = message.substr(13, length);
        made.payload = message.substr(13 + length);
        return client_message(std::move(made));
    }
    return failure(errc::malformed, fmt::format("there is no binary message {}", opcode));
}

std::string write(const server_info& of) {
    json made = {{"op", "serverInfo"},
                 {"name", of.name},
                 {"capabilities", of.capabilities},
                 {"metadata", of.metadata},
                 {"sessionId", of.session}};
    if (!of.encodings.empty()) made["supportedEncodings"] = of.encodings;
    return text_of(made);
}

std::string write_status(status_level level, std::string_view message, std::string_view id) {
    json made = {{"op", "status"}, {"level", static_cast<int>(level)}, {"message", message}};
    if (!id.empty()) made["id"] = id;
    return text_of(made);
}

std::string write_status_removed(std::string_view id) {
    return text_of({{"op", "removeStatus"}, {"statusIds", json::array({id})}});
}

schema_info protobuf_schema(std::string name, bytes_view descriptors) {
    schema_info made;
    made.encoding = made.schema_encoding = "protobuf";
    made.name = std::move(name);
    made.schema = ise::detail::to_base64(descriptors);
    return made;
}

std::string write_advertise(const std::vector<const channel_info*>& channels) {
    auto all = json::array();
    for (const auto* one : channels) {
        auto made = schema_json(one->schema);
        made["id"] = one->id;
        made["topic"] = one->topic;
        all.push_back(std::move(made));
    }
    return text_of({{"op", "advertise"}, {"channels", std::move(all)}});
}

std::string write_unadvertise(const std::vector<std::uint32_t>& ids) {
    return text_of({{"op", "unadvertise"}, {"channelIds", ids}});
}

std::string write_advertise_services(const std::vector<const service_info*>& services) {
    auto all = json::array();
    for (const auto* one : services) {
        // Clients that know no `request` take JSON by a JSON schema.
        auto plain = [](const schema_info& of) { return text_of({{"title", of.name}, {"type", "object"}}); };
        all.push_back({{"id", one->id},
                       {"name", one->name},
                       {"type", one->type},
                       {"request", schema_json(one->request)},
                       {"response", schema_json(one->response)},
                       {"requestSchema", plain(one->request)},
                       {"responseSchema", plain(one->response)}});
    }
    return text_of({{"op", "advertiseServices"}, {"services", std::move(all)}});
}

std::string write_unadvertise_services(const std::vector<std::uint32_t>& ids) {
    return text_of({{"op", "unadvertiseServices"}, {"serviceIds", ids}});
}

std::string write_parameters(const std::vector<const parameter_info*>& parameters,
                             const std::optional<std::string>& id) {
    auto all = json::array();
    for (const auto* one : parameters) {
        json made = {{"name", one->name}};
        if (one->many) {
            auto values = json::array();
            for (const auto& value : one->values) values.push_back(value_json(one->kind, value));
            made["value"] = std::move(values);
        } else if (!one->values.empty()) {
            made["value"] = value_json(one->kind, one->values[0]);
            if (one->kind == parameter_kind::number && made["value"].is_number()) made["type"] = "float64";
        }
        all.push_back(std::move(made));
    }
    json made = {{"op", "parameterValues"}, {"parameters", std::move(all)}};
    if (id) made["id"] = *id;
    return text_of(made);
}

std::string write_call_failure(std::uint32_t service, std::uint32_t call, std::string_view message) {
    return text_of({{"op", "serviceCallFailure"}, {"serviceId", service}, {"callId", call}, {"message", message}});
}

std::string write_graph_change(const connection_graph& before, const connection_graph& now) {
    if (before == now) return {};
    auto changed = [](const connection_graph::edges& was, const connection_graph::edges& is, const char* ids) {
        auto all = json::array();
        auto add = [&](const std::string& name, const std::set<std::string>& who) {
            all.push_back({{"name", name}, {ids, who}});
        };
        for (const auto& [name, who] : is) {
            auto known = was.find(name);
            if (known == was.end() || known->second != who) add(name, who);
        }
        for (const auto& [name, who] : was)
            if (!is.contains(name)) add(name, {});
        return all;
    };
    auto removed_topics = json::array(), removed_services = json::array();
    auto is_topic = [&](const std::string& name) {
        return now.published.contains(name) || now.subscribed.contains(name);
    };
    for (const auto* edges : {&before.published, &before.subscribed})
        for (const auto& [name, who] : *edges)
            if (!is_topic(name) && std::ranges::find(removed_topics, json(name)) == removed_topics.end())
                removed_topics.push_back(name);
    for (const auto& [name, who] : before.services)
        if (!now.services.contains(name)) removed_services.push_back(name);
    return text_of({{"op", "connectionGraphUpdate"},
                    {"publishedTopics", changed(before.published, now.published, "publisherIds")},
                    {"subscribedTopics", changed(before.subscribed, now.subscribed, "subscriberIds")},
                    {"advertisedServices", changed(before.services, now.services, "providerIds")},
                    {"removedTopics", std::move(removed_topics)},
                    {"removedServices", std::move(removed_services)}});
}

std::string write_message_head(std::uint32_t subscription, wall_time at) {
    std::string made(1, '\x01');
    append_u32(made, subscription);
    append_time(made, at);
    return made;
}

std::string write_time(wall_time at) {
    std::string made(1, '\x02');
    append_time(made, at);
    return made;
}

std::string write_call_response(const call_message& to, std::string_view payload) {
    std::string made(1, '\x03');
    append_u32(made, to.service);
    append_u32(made, to.call);
    append_u32(made, static_cast<std::uint32_t>(to.encoding.size()));
    made += to.encoding;
    made += payload;
    return made;
}

std::string write_asset(std::uint32_t id, std::string_view content) {
    std::string made(1, '\x04');
    append_u32(made, id);
    made += '\0';
    append_u32(made, 0);
    made += content;
    return made;
}

std::string write_asset_failure(std::uint32_t id, std::string_view message) {
    std::string made(1, '\x04');
    append_u32(made, id);
    made += '\x01';
    append_u32(made, static_cast<std::uint32_t>(message.size()));
    made += message;
    return made;
}

result<std::string> asset_path(std::string_view uri) {
    auto refused = [&](const char* why) {
        return failure(errc::invalid_argument,
                       fmt::format("no asset '{}': {}; ask for package://PATH below the folder of assets",
                                   uri.substr(0, 200), why));
    };
    auto scheme = uri.find("://");
    if (scheme == std::string_view::npos || scheme == 0) return refused("it is not a URI such as package://boat.glb");
    std::string path;
    for (std::size_t at = scheme + 3; at < uri.size(); ++at) {
        char letter = uri[at];
        if (letter == '%') {
            int value = 0;
            if (at + 3 > uri.size()) return refused("a % stands without two digits");
            auto [end, problem] = std::from_chars(uri.data() + at + 1, uri.data() + at + 3, value, 16);
            if (problem != std::errc() || end != uri.data() + at + 3) return refused("a % stands without two digits");
            letter = static_cast<char>(value);
            at += 2;
        }
        if (static_cast<unsigned char>(letter) < 0x20 || letter == '\\' || letter == 0x7f)
            return refused("it has a character that no path has");
        path += letter;
    }
    for (std::size_t from = 0; from <= path.size();) {
        auto end = std::min(path.find('/', from), path.size());
        auto part = std::string_view(path).substr(from, end - from);
        if (part.empty() || part == "." || part == "..") return refused("its path leads elsewhere");
        from = end + 1;
    }
    return path;
}

} // namespace ise::foxglove
