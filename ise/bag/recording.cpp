#include <ise/bag/recording.hpp>

#include <ise/bag/compression.hpp>
#include <ise/bag/file.hpp>
#include <ise/component/served_runs.hpp>
#include <ise/packet/adapt.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/action.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

namespace ise::bag {
namespace {

constexpr const char* component_key = "ise.component";
constexpr const char* service_key = "ise.service";
constexpr const char* content_key = "ise.content";
constexpr const char* schema_key = "ise.schema";

std::string_view name_of(content what) noexcept {
    switch (what) {
        case content::packets: return "packets";
        case content::calls: return "calls";
        case content::runs: return "runs";
        case content::events: return "events";
    }
    return "";
}

// The fields of `recorded_call` before the service's packets.
struct call_head {
    std::string caller;
    std::string outcome;
    std::string message;
    duration took{};
    duration deadline{};
};

} // namespace

schema call_schema(const dynamic_contract& service) {
    auto head = schema_of<call_head>().type();
    head.name = "call";
    type_member request, response;
    request.name = "request";
    request.type = service.packet(role::request).type();
    response.name = "response";
    response.type.kind = type_kind::optional;
    type_member inner;
    inner.type = service.packet(role::response).type();
    response.type.members.push_back(std::move(inner));
    response.type.complete();
    head.members.push_back(std::move(request));
    head.members.push_back(std::move(response));
    head.complete();
    return schema(std::move(head));
}

bytes encode_call(const recorded_call& call) {
    call_head head;
    head.caller = call.caller;
    head.outcome = call.outcome;
    head.message = call.message;
    head.took = call.took;
    head.deadline = call.deadline;
    auto made = ise::encode(head);
    made.insert(made.end(), call.request.begin(), call.request.end());
    made.push_back(static_cast<std::byte>(call.response ? 1 : 0));
    if (call.response) made.insert(made.end(), call.response->begin(), call.response->end());
    return made;
}

result<recorded_call> decode_call(const dynamic_contract& service, bytes_view packet) {
    try {
        dynamic_packet all(call_schema(service), bytes(packet.begin(), packet.end()));
        recorded_call made;
        made.caller = all.field("caller").as_string();
        made.outcome = all.field("outcome").as_string();
        made.message = all.field("message").as_string();
        made.took = duration(all.field("took").as_int());
        made.deadline = duration(all.field("deadline").as_int());
        auto request = all.field("request").raw();
        made.request.assign(request.begin(), request.end());
        auto response = all.field("response");
        if (!response.is_null()) {
            auto raw = response.raw();
            // An optional's bytes begin with its mark; `field` may have passed through it.
            if (response.kind() == type_kind::optional) raw = raw.subspan(1);
            made.response = bytes(raw.begin(), raw.end());
        }
        return made;
    } catch (const error& thrown) {
        return thrown.why();
    }
}

namespace {

content content_of(const dynamic_contract& service) {
    if (service.kind() == service_kind::request_response) return content::calls;
    return is_action(*service.types()) ? content::runs : content::packets;
}

schema schema_in(content what, const dynamic_contract& service) {
    if (what == content::calls) return call_schema(service);
    return what == content::runs ? schema_of_runs(service) : service.packet(role::published);
}

} // namespace

topic::topic(std::string component, const dynamic_contract& service)
    : name_(fmt::format("{}/{}", component, service.name())), component_(std::move(component)),
      service_(service.name()), what_(content_of(service)), contract_(service),
      packet_(std::make_shared<const protobuf_type>(schema_in(what_, service))) {}

topic::topic(std::string name, schema packet)
    : name_("ise/" + name), packet_(std::make_shared<const protobuf_type>(std::move(packet))) {}

result<topic> topic::of(const channel_record& channel) {
    auto wrong = [&](const std::string& why) {
        return failure(errc::malformed, fmt::format("channel {} ('{}'): {}", channel.id, channel.topic, why));
    };
    auto text = [&](const std::string& key) -> const std::string* {
        auto found = channel.metadata.find(key);
        return found == channel.metadata.end() ? nullptr : &found->second;
    };
    const auto* what = text(content_key);
    if (!what) return wrong("it was not recorded by ISE");
    try {
        if (*what == name_of(content::events)) {
            const auto* of = text(schema_key);
            if (!of || !channel.topic.starts_with("ise/")) return wrong("it has no schema");
            auto packet = schema::parse(*of);
            if (!packet) return wrong(packet.error().message());
            return topic(channel.topic.substr(4), std::move(*packet));
        }
        const bool calls = *what == name_of(content::calls);
        if (!calls && *what != name_of(content::packets) && *what != name_of(content::runs))
            return wrong("it has an unknown content");
        auto kind = calls ? service_kind::request_response : service_kind::subscription;
        const auto* component = text(component_key);
        const auto* service = text(service_key);
        if (!component || !service) return wrong("it does not name its component and its service");
        std::vector<std::string> texts;
        for (std::size_t i = 0; i < (kind == service_kind::subscription ? 5 : 2); ++i) {
            const auto* one = text(fmt::format("{}.{}", schema_key, i));
            if (!one) return wrong("it has not all schemas of its service");
            texts.push_back(*one);
        }
        auto contract = dynamic_contract::parse(*service, kind, texts);
        if (!contract) return wrong(contract.error().message());
        if (content_of(*contract) != content::runs && *what == name_of(content::runs))
            return wrong("it has runs of a service that is no action");
        return topic(*component, *contract);
    } catch (const error& thrown) {
        return wrong(thrown.what());
    }
}

string_map topic::metadata() const {
    string_map made;
    made[content_key] = name_of(what_);
    if (!contract_) {
        made[schema_key] = packet_->of().text();
        return made;
    }
    made[component_key] = component_;
    made[service_key] = service_;
    const auto& all = contract_->types()->schemas;
    for (std::size_t i = 0; i < all.size(); ++i) made[fmt::format("{}.{}", schema_key, i)] = all[i].text();
    return made;
}

namespace {

constexpr std::uint64_t max_attached_bytes = std::uint64_t{64} << 20;

result<bytes> content_of_file(const std::string& path) {
    auto file = open_file(path);
    if (!file) return file.error();
    auto size = (*file)->size();
    if (!size) return size.error();
    if (*size > max_attached_bytes)
        return failure(errc::too_large, fmt::format("{} has {} bytes, and at most {} are attached (max_attached_bytes)",
                                                    path, *size, max_attached_bytes));
    bytes made(static_cast<std::size_t>(*size));
    auto got = (*file)->read(0, made);
    if (!got) return got.error();
    made.resize(*got);
    return made;
}

std::string media_type_of(std::string_view path) {
    if (path.ends_with(".toml")) return "application/toml";
    return path.ends_with(".log") || path.ends_with(".txt") ? "text/plain" : "application/octet-stream";
}

} // namespace

struct recording_file::state {
    explicit state(recording_options how) : options(std::move(how)) {}

    recording_options options;
    recording_counts counts;
    std::optional<writer> out;
    std::map<const topic*, std::pair<std::uint16_t, std::shared_ptr<const topic>>> channels; // of the present file
    std::map<std::string, std::uint32_t> attached; // to the present file: CRC by path
    timestamp began = 0, latest = 0;
    std::uint64_t bytes_before = 0;
    std::uint64_t number = 0; // of the present file
    buffer message;

    static constexpr std::uint64_t most_files = 1'000'000;

    bool numbered() const { return options.split_bytes > 0 || options.split_time > duration{} || options.numbered; }
    std::string next_name() const {
        if (!numbered()) return options.file;
        auto stem = options.file;
        std::string_view end = ".mcap";
        if (stem.ends_with(end)) stem.resize(stem.size() - end.size());
        return fmt::format("{}_{:04}{}", stem, number, end);
    }

    result<void> open(timestamp at) {
        std::string name;
        result<std::unique_ptr<sink>> file;
        do { // those of an earlier recording are kept
            ++number;
            name = next_name();
            file = create_file(name);
        } while (!file && file.error().code() == errc::name_taken && numbered() && number < most_files);
        if (!file) return file.error();
        auto made = writer::make(std::move(*file), options.format);
        if (!made) return made.error();
        out.emplace(std::move(*made));
        channels.clear();
        attached.clear();
        began = latest = at;
        counts.files.push_back(name);
        metadata_record about;
        about.name = "ise";
        about.metadata = options.about;
        if (auto done = out->write(about); !done) return done;
        return attach_files();
    }

    // Those that have changed since they were attached; metadata says which could not be read.
    result<void> attach_files() {
        metadata_record missing;
        missing.name = "ise.not_attached";
        for (const auto& path : options.attached) {
            auto content = content_of_file(path);
            if (!content) {
                if (!attached.contains(path)) missing.metadata[path] = content.error().message();
                continue;
            }
            const auto crc = crc32(*content);
            auto [known, is_new] = attached.try_emplace(path, crc);
            if (!is_new && std::exchange(known->second, crc) == crc) continue;
            attachment_record made;
            made.log_time = made.create_time = latest;
            made.name = path.substr(path.rfind('/') + 1);
            made.media_type = media_type_of(path);
            made.data = *content;
            if (auto done = out->attach(made); !done) return done;
        }
        return missing.metadata.empty() ? result<void>() : out->write(missing);
    }

    result<void> begin(timestamp now) {
        if (out) return {};
        for (const auto& path : options.attached)
            if (auto content = content_of_file(path); !content) return content.error();
        return open(now);
    }

    result<void> note(const std::string& name, const string_map& what, timestamp now) {
        if (!out)
            if (auto done = open(now); !done) return done;
        metadata_record made;
        made.name = name;
        made.metadata = what;
        return out->write(made);
    }

    bool full(timestamp now) const {
        if (!out) return false;
        if (options.split_bytes > 0 && out->bytes_written() + out->bytes_waiting() >= options.split_bytes) return true;
        return options.split_time > duration{} && now >= began + static_cast<timestamp>(options.split_time.count());
    }

    result<void> close() {
        if (!out) return {};
        auto done = attach_files();
        if (auto closed = out->close(); done) done = closed;
        if (done) done = out->sync();
        bytes_before += out->bytes_written();
        counts.bytes = bytes_before;
        out.reset();
        return done;
    }

    result<void> write(const recorded_message& one) {
        if (full(one.log_time))
            if (auto done = close(); !done) return done;
        if (!out)
            if (auto done = open(one.log_time); !done) return done;
        auto known = channels.find(one.of.get());
        if (known == channels.end()) {
            const auto& packet = one.of->packet();
            auto schema = out->add_schema(packet.name(), "protobuf", packet.descriptors());
            if (!schema) return schema.error();
            auto channel = out->add_channel(*schema, one.of->name(), "protobuf", one.of->metadata());
            if (!channel) return channel.error();
            known = channels.emplace(one.of.get(), std::pair(*channel, one.of)).first;
        }
        message.clear();
        if (auto done = one.of->packet().encode(one.packet, message, true); !done) return done;
        message_record made;
        made.channel_id = known->second.first;
        made.sequence = one.sequence;
        made.log_time = one.log_time;
        made.publish_time = one.publish_time;
        made.data = message.view();
        auto done = out->write(made);
        if (done) ++counts.messages;
        latest = std::max(latest, one.log_time);
        counts.bytes = bytes_before + out->bytes_written();
        return done;
    }
};

recording_file::recording_file(recording_options options) : state_(std::make_unique<state>(std::move(options))) {}
recording_file::~recording_file() = default;
recording_file::recording_file(recording_file&&) noexcept = default;
recording_file& recording_file::operator=(recording_file&&) noexcept = default;
result<void> recording_file::begin(timestamp now) { return state_->begin(now); }
result<void> recording_file::write(const recorded_message& message) { return state_->write(message); }
result<void> recording_file::note(const std::string& name, const string_map& what, timestamp now) {
    return state_->note(name, what, now);
}
result<void> recording_file::flush() {
    if (!state_->out) return {};
    if (auto done = state_->out->flush(); !done) return done;
    return state_->out->sync();
}
result<void> recording_file::close() { return state_->close(); }
const recording_counts& recording_file::counts() const noexcept { return state_->counts; }

} // namespace ise::bag
