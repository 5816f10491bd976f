// The tests of the public MCAP conformance suite (github.com/foxglove/mcap, tests/conformance), as its own readers and
// writers do them:
//   mcap_conformance read FILE         the suite's JSON of a file
//   mcap_conformance write FILE.json   the bytes that the suite's JSON describes, to standard output
//   mcap_conformance sample FILE       writes a file of packets, and prints them as JSON (check_mcap.mjs)
//   mcap_conformance packets FILE      prints such packets out of a file of others
//   mcap_conformance all FOLDER        both over every FILE.json below FOLDER; exit code 1 if one differs
// The suite's repository keeps its files in Git LFS: where FILE.mcap is such a pointer, what is written is held against
// its SHA-256, and then read.
#include <ise/bag/protobuf.hpp>
#include <ise/bag/reader.hpp>
#include <ise/bag/writer.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/json.hpp>

#include <nlohmann/json.hpp>
#include <openssl/evp.h>

#include <algorithm>
#include <array>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iostream>
#include <iterator>
#include <map>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <string_view>
#include <utility>
#include <variant>
#include <vector>

namespace {

using namespace ise;
using namespace ise::bag;
using json = nlohmann::ordered_json;

std::string whole_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    if (!in) throw std::runtime_error("cannot open " + path);
    return std::string(std::istreambuf_iterator<char>(in), {});
}

// --- reading ---------------------------------------------------------------------------------------------------------

template <class T>
json number(T value) {
    return std::to_string(value);
}

json octets(bytes_view raw) {
    auto made = json::array();
    for (auto one : raw) made.push_back(std::to_string(static_cast<unsigned>(one)));
    return made;
}

json map(const string_map& of) {
    auto made = json::object();
    for (const auto& [key, value] : of) made[key] = value;
    return made;
}

json map(const std::map<std::uint16_t, std::uint64_t>& of) {
    auto made = json::object();
    for (const auto& [key, value] : of) made[std::to_string(key)] = std::to_string(value);
    return made;
}

json fields(std::initializer_list<std::pair<const char*, json>> all) {
    auto made = json::array();
    for (const auto& [name, value] : all) made.push_back(json::array({name, value}));
    return made;
}

// Nothing for a record that the suite does not show.
json shown(const record& one) {
    auto made = [](const char* type, json of) { return json{{"type", type}, {"fields", std::move(of)}}; };
    switch (one.op) {
        case opcode::header: {
            auto r = parse<header_record>(one.content).value();
            return made("Header", fields({{"library", r.library}, {"profile", r.profile}}));
        }
        case opcode::footer: {
            auto r = parse<footer_record>(one.content).value();
            return made("Footer", fields({{"summary_crc", number(r.summary_crc)},
                                          {"summary_offset_start", number(r.summary_offset_start)},
                                          {"summary_start", number(r.summary_start)}}));
        }
        case opcode::schema: {
            auto r = parse<schema_record>(one.content).value();
            return made(
                "Schema",
                fields({{"data", octets(r.data)}, {"encoding", r.encoding}, {"id", number(r.id)}, {"name", r.name}}));
        }
        case opcode::channel: {
            auto r = parse<channel_record>(one.content).value();
            return made("Channel", fields({{"id", number(r.id)},
                                           {"message_encoding", r.message_encoding},
                                           {"metadata", map(r.metadata)},
                                           {"schema_id", number(r.schema_id)},
                                           {"topic", r.topic}}));
        }
        case opcode::message: {
            auto r = parse<message_record>(one.content).value();
            return made("Message", fields({{"channel_id", number(r.channel_id)},
                                           {"data", octets(r.data)},
                                           {"log_time", number(r.log_time)},
                                           {"publish_time", number(r.publish_time)},
                                           {"sequence", number(r.sequence)}}));
        }
        case opcode::attachment: {
            auto r = parse<attachment_record>(one.content).value();
            return made("Attachment", fields({{"create_time", number(r.create_time)},
                                              {"data", octets(r.data)},
                                              {"log_time", number(r.log_time)},
                                              {"media_type", r.media_type},
                                              {"name", r.name}}));
        }
        case opcode::metadata: {
            auto r = parse<metadata_record>(one.content).value();
            return made("Metadata", fields({{"metadata", map(r.metadata)}, {"name", r.name}}));
        }
        case opcode::data_end: {
            auto r = parse<data_end_record>(one.content).value();
            return made("DataEnd",
                        fields({std::pair<const char*, json>("data_section_crc", number(r.data_section_crc))}));
        }
        case opcode::statistics: {
            auto r = parse<statistics_record>(one.content).value();
            return made("Statistics", fields({{"attachment_count", number(r.attachment_count)},
                                              {"channel_count", number(r.channel_count)},
                                              {"channel_message_counts", map(r.channel_message_counts)},
                                              {"chunk_count", number(r.chunk_count)},
                                              {"message_count", number(r.message_count)},
                                              {"message_end_time", number(r.message_end_time)},
                                              {"message_start_time", number(r.message_start_time)},
                                              {"metadata_count", number(r.metadata_count)},
                                              {"schema_count", number(r.schema_count)}}));
        }
        case opcode::chunk_index: {
            auto r = parse<chunk_index_record>(one.content).value();
            return made("ChunkIndex", fields({{"chunk_length", number(r.chunk_length)},
                                              {"chunk_start_offset", number(r.chunk_start_offset)},
                                              {"compressed_size", number(r.compressed_size)},
                                              {"compression", r.compression},
                                              {"message_end_time", number(r.message_end_time)},
                                              {"message_index_length", number(r.message_index_length)},
                                              {"message_index_offsets", map(r.message_index_offsets)},
                                              {"message_start_time", number(r.message_start_time)},
                                              {"uncompressed_size", number(r.uncompressed_size)}}));
        }
        case opcode::attachment_index: {
            auto r = parse<attachment_index_record>(one.content).value();
            return made("AttachmentIndex", fields({{"create_time", number(r.create_time)},
                                                   {"data_size", number(r.data_size)},
                                                   {"length", number(r.length)},
                                                   {"log_time", number(r.log_time)},
                                                   {"media_type", r.media_type},
                                                   {"name", r.name},
                                                   {"offset", number(r.offset)}}));
        }
        case opcode::metadata_index: {
            auto r = parse<metadata_index_record>(one.content).value();
            return made("MetadataIndex",
                        fields({{"length", number(r.length)}, {"name", r.name}, {"offset", number(r.offset)}}));
        }
        case opcode::summary_offset: {
            auto r = parse<summary_offset_record>(one.content).value();
            return made("SummaryOffset", fields({{"group_length", number(r.group_length)},
                                                 {"group_opcode", number(unsigned{r.group_opcode})},
                                                 {"group_start", number(r.group_start)}}));
        }
        default: return nullptr;
    }
}

json read_all(source& from) {
    auto records = json::array();
    record_reader in(from);
    for (auto got = in.next().value(); got; got = in.next().value())
        if (auto made = shown(*got); !made.is_null()) records.push_back(std::move(made));
    return json{{"records", std::move(records)}};
}

// --- writing ---------------------------------------------------------------------------------------------------------

class described {
public:
    explicit described(const json& of) {
        for (const auto& one : of.at("fields")) fields_[one.at(0)] = one.at(1);
    }
    std::string text(const char* name) const { return fields_.at(name); }
    template <class T>
    T number(const char* name) const {
        return static_cast<T>(std::stoull(fields_.at(name).get<std::string>()));
    }
    bytes data(const char* name) const {
        bytes made;
        for (const auto& one : fields_.at(name))
            made.push_back(static_cast<std::byte>(std::stoul(one.get<std::string>())));
        return made;
    }
    string_map map(const char* name) const { return fields_.at(name).get<string_map>(); }

private:
    std::map<std::string, json> fields_;
};

bytes write_all(const json& file) {
    bool has[10]{};
    constexpr std::array<std::string_view, 10> names{"ch", "mx", "st", "rsh", "rch", "ax", "mdx", "chx", "sum", "pad"};
    for (const auto& one : file.at("meta").at("variant").at("features")) {
        auto at = std::ranges::find(names, one.get<std::string>());
        if (at == names.end()) throw std::runtime_error("unknown feature " + one.get<std::string>());
        has[at - names.begin()] = true;
    }
    const auto& all = file.at("records");
    writer_options how;
    how.packing = compression::none;
    how.chunks = has[0];
    how.message_index = has[1];
    how.statistics = has[2];
    how.repeat_schemas = has[3];
    how.repeat_channels = has[4];
    how.attachment_index = has[5];
    how.metadata_index = has[6];
    how.chunk_index = has[7];
    how.summary_offsets = has[8];
    how.pad = has[9];
    described head(all.at(0));
    how.profile = head.text("profile");
    how.library = head.text("library");
    bytes made;
    auto out = writer::make(memory_sink(made), how).value();
    for (const auto& one : all) {
        std::string type = one.at("type");
        described of(one);
        if (type == "DataEnd") break; // what follows is the writer's
        if (type == "Schema") {
            schema_record r;
            r.id = of.number<std::uint16_t>("id");
            r.name = of.text("name");
            r.encoding = of.text("encoding");
            r.data = of.data("data");
            out.add(std::move(r)).value();
        } else if (type == "Channel") {
            channel_record r;
            r.id = of.number<std::uint16_t>("id");
            r.schema_id = of.number<std::uint16_t>("schema_id");
            r.topic = of.text("topic");
            r.message_encoding = of.text("message_encoding");
            r.metadata = of.map("metadata");
            out.add(std::move(r)).value();
        } else if (type == "Message") {
            auto content = of.data("data");
            message_record r;
            r.channel_id = of.number<std::uint16_t>("channel_id");
            r.sequence = of.number<std::uint32_t>("sequence");
            r.log_time = of.number<timestamp>("log_time");
            r.publish_time = of.number<timestamp>("publish_time");
            r.data = content;
            out.write(r).value();
        } else if (type == "Attachment") {
            auto content = of.data("data");
            attachment_record r;
            r.log_time = of.number<timestamp>("log_time");
            r.create_time = of.number<timestamp>("create_time");
            r.name = of.text("name");
            r.media_type = of.text("media_type");
            r.data = content;
            out.attach(r).value();
        } else if (type == "Metadata") {
            metadata_record r;
            r.name = of.text("name");
            r.metadata = of.map("metadata");
            out.write(r).value();
        }
    }
    out.close().value();
    return made;
}

// --- all -------------------------------------------------------------------------------------------------------------

std::string sha256(bytes_view of) {
    std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
    unsigned size = 0;
    if (EVP_Digest(of.data(), of.size(), digest.data(), &size, EVP_sha256(), nullptr) != 1)
        throw std::runtime_error("no SHA-256");
    std::string made;
    for (unsigned i = 0; i < size; ++i) {
        char hex[3];
        std::snprintf(hex, sizeof hex, "%02x", digest[i]);
        made += hex;
    }
    return made;
}

// Empty: it is as it should be.
std::string trouble(const std::string& path) {
    auto file = json::parse(whole_file(path));
    auto expected = whole_file(path.substr(0, path.size() - 5) + ".mcap");
    auto wrote = write_all(file);
    constexpr std::string_view pointer = "version https://git-lfs.github.com/spec/v1\noid sha256:";
    if (expected.starts_with(pointer)) {
        if (expected.substr(pointer.size(), 64) != sha256(wrote)) return "what was written has another SHA-256";
        if (expected.find("\nsize " + std::to_string(wrote.size()) + "\n") == expected.npos) return "another size";
        expected = std::string(as_text(wrote));
    } else if (expected != as_text(wrote)) {
        return "what was written differs";
    }
    auto from = memory_source(as_bytes(expected), path);
    if (read_all(*from).at("records") != file.at("records")) return "what was read differs";
    return {};
}

int all(const std::string& folder) {
    std::size_t good = 0, bad = 0;
    std::vector<std::string> paths;
    for (const auto& one : std::filesystem::recursive_directory_iterator(folder))
        if (one.path().extension() == ".json") paths.push_back(one.path().string());
    std::ranges::sort(paths);
    for (const auto& path : paths) {
        std::string why;
        try {
            why = trouble(path);
        } catch (const std::exception& thrown) {
            why = thrown.what();
        }
        why.empty() ? ++good : ++bad;
        if (!why.empty()) std::cout << "FAIL " << path << ": " << why << "\n";
    }
    std::cout << good << " of " << good + bad << " files are written and read as the suite says\n";
    return good > 0 && bad == 0 ? 0 : 1;
}

// --- packets, for check_mcap.mjs --------------------------------------------------------------------------------

enum class sail : std::uint8_t { furled = 1, reefed = 2, full = 5 };
struct waypoint {
    double latitude_deg = 0;
    double longitude_deg = 0;
};
struct sample {
    std::string name;
    std::int32_t count = 0;
    std::int64_t big = 0;
    double ratio = 0;
    sail sails = sail::furled;
    std::vector<waypoint> route;
    std::map<std::string, double> named;
    std::optional<std::int32_t> maybe;
    bytes blob;
    std::chrono::sys_time<std::chrono::milliseconds> when{};
    std::variant<std::int32_t, std::string> any;
};

void write_sample(const std::string& path) {
    protobuf_type type(schema_of<sample>());
    auto out = writer::make(create_file(path).value()).value();
    auto schema = out.add_schema(type.name(), "protobuf", type.descriptors()).value();
    auto channel = out.add_channel(schema, "sample", "protobuf").value();
    attachment_record attached;
    attached.name = "deployment.toml";
    attached.media_type = "application/toml";
    attached.data = as_bytes("[deployment]");
    out.attach(attached).value();
    for (std::uint32_t i = 0; i < 100; ++i) {
        sample one;
        one.name = i == 0 ? "" : "Las Palmas " + std::to_string(i);
        one.count = static_cast<std::int32_t>(i) * -1000;
        one.big = static_cast<std::int64_t>(i) << 40;
        one.ratio = i / 8.0;
        one.sails = i % 2 ? sail::full : sail::reefed;
        for (std::uint32_t n = 0; n < i % 3; ++n) one.route.push_back({28.0 + n, -15.5});
        if (i % 4) one.named["speed"] = i;
        if (i % 5) one.maybe = 0;
        one.blob.resize(i % 7, std::byte{200});
        one.when = std::chrono::sys_time<std::chrono::milliseconds>(std::chrono::milliseconds(1'700'000'000'123 + i));
        if (i % 2) one.any = "text";
        auto packet = encode(one);
        buffer message;
        type.encode(packet, message, true).value();
        message_record record;
        record.channel_id = channel;
        record.sequence = i;
        record.log_time = record.publish_time = 1000 + i;
        record.data = message.view();
        out.write(record).value();
        std::cout << to_json(type.of(), packet) << "\n";
    }
    out.close().value();
}

void print_packets(const std::string& path) {
    protobuf_type type(schema_of<sample>());
    auto from = open_file(path).value();
    auto about = read_summary(*from).value();
    message_reader in(*from, about);
    for (auto got = in.next().value(); got; got = in.next().value())
        std::cout << to_json(type.of(), type.decode(got->data).value()) << "\n";
}

} // namespace

int main(int count, char** arguments) try {
    std::string what = count == 3 ? arguments[1] : "";
    if (what == "read") {
        auto from = open_file(arguments[2]).value();
        std::cout << read_all(*from).dump(2) << "\n";
    } else if (what == "write") {
        auto made = write_all(json::parse(whole_file(arguments[2])));
        std::cout.write(as_text(made).data(), static_cast<std::streamsize>(made.size()));
    } else if (what == "sample") {
        write_sample(arguments[2]);
    } else if (what == "packets") {
        print_packets(arguments[2]);
    } else if (what == "all") {
        return all(arguments[2]);
    } else {
        std::cerr << "usage: mcap_conformance read FILE | write FILE.json | sample FILE | packets FILE | all FOLDER\n";
        return 2;
    }
    return std::cout.flush() ? 0 : 1;
} catch (const std::exception& thrown) {
    std::cerr << "mcap_conformance: " << thrown.what() << "\n";
    return 1;
}
