#include <ise/bag/compression.hpp>
#include <ise/bag/records.hpp>

#include <ise/core/little_endian.hpp>

#include <fmt/format.h>

#include <utility>

namespace ise::bag {
namespace {

// Reads fields one after another; the first that does not fit is remembered, and all after it are empty.
class fields {
public:
    fields(std::string_view record, bytes_view content) : record_(record), left_(content), size_(content.size()) {}

    template <class T>
    void number(T& into, const char* name) {
        if (wrong_ || left_.size() < sizeof(T)) return fail(name);
        into = detail::load_little<T>(left_.data());
        left_ = left_.subspan(sizeof(T));
    }
    template <class Length>
    bytes_view block(const char* name) {
        Length length = 0;
        number(length, name);
        if (wrong_) return {};
        if (length > left_.size()) return fail(name), bytes_view();
        auto got = left_.first(static_cast<std::size_t>(length));
        left_ = left_.subspan(got.size());
        return got;
    }
    void text(std::string& into, const char* name) { into = as_text(block<std::uint32_t>(name)); }
    void map(string_map& into, const char* name) {
        fields inside(record_, block<std::uint32_t>(name));
        while (!wrong_ && !inside.left_.empty()) {
            std::string key, value;
            inside.text(key, name);
            inside.text(value, name);
            if (inside.wrong_) return fail(name);
            into[std::move(key)] = std::move(value);
        }
    }
    void map(std::map<std::uint16_t, std::uint64_t>& into, const char* name) {
        fields inside(record_, block<std::uint32_t>(name));
        while (!wrong_ && !inside.left_.empty()) {
            std::uint16_t key = 0;
            std::uint64_t value = 0;
            inside.number(key, name);
            inside.number(value, name);
            if (inside.wrong_) return fail(name);
            into[key] = value;
        }
    }
    void entries(std::vector<message_index_record::entry>& into, const char* name) {
        fields inside(record_, block<std::uint32_t>(name));
        into.reserve(inside.left_.size() / 16);
        while (!wrong_ && !inside.left_.empty()) {
            message_index_record::entry one;
            inside.number(one.log_time, name);
            inside.number(one.offset, name);
            if (inside.wrong_) return fail(name);
            into.push_back(one);
        }
    }
    bytes_view rest() { return wrong_ ? bytes_view() : std::exchange(left_, bytes_view()); }

    std::size_t read() const noexcept { return size_ - left_.size(); }
    void fail(const char* name) {
        if (!wrong_) wrong_ = name;
    }
    template <class T>
    result<T> done(T made) const {
        if (wrong_)
            return failure(errc::malformed,
                           fmt::format("{}: its field {} does not fit into its {} bytes", record_, wrong_, size_));
        return made;
    }

private:
    std::string_view record_;
    bytes_view left_;
    std::size_t size_;
    const char* wrong_ = nullptr;
};

void append_text(buffer& to, std::string_view text) {
    to.append(static_cast<std::uint32_t>(text.size()));
    to.append(as_bytes(text));
}

void append_map(buffer& to, const string_map& map) {
    std::size_t size = 0;
    for (const auto& [key, value] : map) size += 8 + key.size() + value.size();
    to.append(static_cast<std::uint32_t>(size));
    for (const auto& [key, value] : map) {
        append_text(to, key);
        append_text(to, value);
    }
}

void append_map(buffer& to, const std::map<std::uint16_t, std::uint64_t>& map) {
    to.append(static_cast<std::uint32_t>(map.size() * 10));
    for (const auto& [key, value] : map) {
        to.append(key);
        to.append(value);
    }
}

// The head of a record, and its length when the content is complete.
class framed {
public:
    framed(buffer& to, opcode op, bool pad = false) : to_(to), pad_(pad) {
        to.append(static_cast<std::uint8_t>(op));
        length_at_ = to.size();
        to.append(std::uint64_t{0});
    }
    ~framed() {
        if (pad_) {
            to_.append(std::uint8_t{0x01});
            to_.append(std::uint8_t{0xff});
            to_.append(std::uint8_t{0xff});
        }
        detail::store_little(to_.data() + length_at_, std::uint64_t{to_.size() - length_at_ - 8});
    }
    framed(const framed&) = delete;
    framed& operator=(const framed&) = delete;

private:
    buffer& to_;
    std::size_t length_at_ = 0;
    bool pad_;
};

} // namespace

std::string name_of(opcode op) {
    switch (op) {
        case opcode::header: return "Header";
        case opcode::footer: return "Footer";
        case opcode::schema: return "Schema";
        case opcode::channel: return "Channel";
        case opcode::message: return "Message";
        case opcode::chunk: return "Chunk";
        case opcode::message_index: return "Message Index";
        case opcode::chunk_index: return "Chunk Index";
        case opcode::attachment: return "Attachment";
        case opcode::attachment_index: return "Attachment Index";
        case opcode::statistics: return "Statistics";
        case opcode::metadata: return "Metadata";
        case opcode::metadata_index: return "Metadata Index";
        case opcode::summary_offset: return "Summary Offset";
        case opcode::data_end: return "Data End";
    }
    return fmt::format("record {:#04x}", static_cast<unsigned>(op));
}

template <>
result<header_record> parse(bytes_view content) {
    fields in("Header", content);
    header_record made;
    in.text(made.profile, "profile");
    in.text(made.library, "library");
    return in.done(std::move(made));
}

template <>
result<footer_record> parse(bytes_view content) {
    fields in("Footer", content);
    footer_record made;
    in.number(made.summary_start, "summary_start");
    in.number(made.summary_offset_start, "summary_offset_start");
    in.number(made.summary_crc, "summary_crc");
    return in.done(made);
}

template <>
result<schema_record> parse(bytes_view content) {
    fields in("Schema", content);
    schema_record made;
    in.number(made.id, "id");
    in.text(made.name, "name");
    in.text(made.encoding, "encoding");
    auto data = in.block<std::uint32_t>("data");
    made.data.assign(data.begin(), data.end());
    return in.done(std::move(made));
}

template <>
result<channel_record> parse(bytes_view content) {
    fields in("Channel", content);
    channel_record made;
    in.number(made.id, "id");
    in.number(made.schema_id, "schema_id");
    in.text(made.topic, "topic");
    in.text(made.message_encoding, "message_encoding");
    in.map(made.metadata, "metadata");
    return in.done(std::move(made));
}

template <>
result<message_record> parse(bytes_view content) {
    fields in("Message", content);
    message_record made;
    in.number(made.channel_id, "channel_id");
    in.number(made.sequence, "sequence");
    in.number(made.log_time, "log_time");
    in.number(made.publish_time, "publish_time");
    made.data = in.rest();
    return in.done(made);
}

template <>
result<chunk_record> parse(bytes_view content) {
    fields in("Chunk", content);
    chunk_record made;
    in.number(made.message_start_time, "message_start_time");
    in.number(made.message_end_time, "message_end_time");
    in.number(made.uncompressed_size, "uncompressed_size");
    in.number(made.uncompressed_crc, "uncompressed_crc");
    in.text(made.compression, "compression");
    made.records = in.block<std::uint64_t>("records");
    return in.done(std::move(made));
}

template <>
result<message_index_record> parse(bytes_view content) {
    fields in("Message Index", content);
    message_index_record made;
    in.number(made.channel_id, "channel_id");
    in.entries(made.entries, "records");
    return in.done(std::move(made));
}

template <>
result<chunk_index_record> parse(bytes_view content) {
    fields in("Chunk Index", content);
    chunk_index_record made;
    in.number(made.message_start_time, "message_start_time");
    in.number(made.message_end_time, "message_end_time");
    in.number(made.chunk_start_offset, "chunk_start_offset");
    in.number(made.chunk_length, "chunk_length");
    in.map(made.message_index_offsets, "message_index_offsets");
    in.number(made.message_index_length, "message_index_length");
    in.text(made.compression, "compression");
    in.number(made.compressed_size, "compressed_size");
    in.number(made.uncompressed_size, "uncompressed_size");
    return in.done(std::move(made));
}

template <>
result<attachment_record> parse(bytes_view content) {
    fields in("Attachment", content);
    attachment_record made;
    in.number(made.log_time, "log_time");
    in.number(made.create_time, "create_time");
    in.text(made.name, "name");
    in.text(made.media_type, "media_type");
    made.data = in.block<std::uint64_t>("data");
    auto covered = in.read();
    std::uint32_t crc = 0;
    in.number(crc, "crc");
    auto checked = in.done(std::move(made));
    if (checked && crc != 0 && crc32(content.first(covered)) != crc)
        return failure(errc::malformed, "Attachment: its CRC does not match");
    return checked;
}

template <>
result<attachment_index_record> parse(bytes_view content) {
    fields in("Attachment Index", content);
    attachment_index_record made;
    in.number(made.offset, "offset");
    in.number(made.length, "length");
    in.number(made.log_time, "log_time");
    in.number(made.create_time, "create_time");
    in.number(made.data_size, "data_size");
    in.text(made.name, "name");
    in.text(made.media_type, "media_type");
    return in.done(std::move(made));
}

template <>
result<metadata_record> parse(bytes_view content) {
    fields in("Metadata", content);
    metadata_record made;
    in.text(made.name, "name");
    in.map(made.metadata, "metadata");
    return in.done(std::move(made));
}

template <>
result<metadata_index_record> parse(bytes_view content) {
    fields in("Metadata Index", content);
    metadata_index_record made;
    in.number(made.offset, "offset");
    in.number(made.length, "length");
    in.text(made.name, "name");
    return in.done(std::move(made));
}

template <>
result<statistics_record> parse(bytes_view content) {
    fields in("Statistics", content);
    statistics_record made;
    in.number(made.message_count, "message_count");
    in.number(made.schema_count, "schema_count");
    in.number(made.channel_count, "channel_count");
    in.number(made.attachment_count, "attachment_count");
    in.number(made.metadata_count, "metadata_count");
    in.number(made.chunk_count, "chunk_count");
    in.number(made.message_start_time, "message_start_time");
    in.number(made.message_end_time, "message_end_time");
    in.map(made.channel_message_counts, "channel_message_counts");
    return in.done(std::move(made));
}

template <>
result<summary_offset_record> parse(bytes_view content) {
    fields in("Summary Offset", content);
    summary_offset_record made;
    in.number(made.group_opcode, "group_opcode");
    in.number(made.group_start, "group_start");
    in.number(made.group_length, "group_length");
    return in.done(made);
}

template <>
result<data_end_record> parse(bytes_view content) {
    fields in("Data End", content);
    data_end_record made;
    in.number(made.data_section_crc, "data_section_crc");
    return in.done(made);
}

void append(buffer& to, const header_record& record, bool pad) {
    framed frame(to, opcode::header, pad);
    append_text(to, record.profile);
    append_text(to, record.library);
}

void append(buffer& to, const footer_record& record) {
    framed frame(to, opcode::footer);
    to.append(record.summary_start);
    to.append(record.summary_offset_start);
    to.append(record.summary_crc);
}

void append(buffer& to, const schema_record& record, bool pad) {
    framed frame(to, opcode::schema, pad);
    to.append(record.id);
    append_text(to, record.name);
    append_text(to, record.encoding);
    append_text(to, as_text(record.data));
}

void append(buffer& to, const channel_record& record, bool pad) {
    framed frame(to, opcode::channel, pad);
    to.append(record.id);
    to.append(record.schema_id);
    append_text(to, record.topic);
    append_text(to, record.message_encoding);
    append_map(to, record.metadata);
}

void append(buffer& to, const message_record& record) {
    to.append(static_cast<std::uint8_t>(opcode::message));
    to.append(std::uint64_t{22 + record.data.size()});
    to.append(record.channel_id);
    to.append(record.sequence);
    to.append(record.log_time);
    to.append(record.publish_time);
    to.append(record.data);
}

void append(buffer& to, const chunk_record& record) {
    framed frame(to, opcode::chunk);
    to.append(record.message_start_time);
    to.append(record.message_end_time);
    to.append(record.uncompressed_size);
    to.append(record.uncompressed_crc);
    append_text(to, record.compression);
    to.append(std::uint64_t{record.records.size()});
    to.append(record.records);
}

void append(buffer& to, const message_index_record& record, bool pad) {
    framed frame(to, opcode::message_index, pad);
    to.append(record.channel_id);
    to.append(static_cast<std::uint32_t>(record.entries.size() * 16));
    for (const auto& one : record.entries) {
        to.append(one.log_time);
        to.append(one.offset);
    }
}

void append(buffer& to, const chunk_index_record& record, bool pad) {
    framed frame(to, opcode::chunk_index, pad);
    to.append(record.message_start_time);
    to.append(record.message_end_time);
    to.append(record.chunk_start_offset);
    to.append(record.chunk_length);
    append_map(to, record.message_index_offsets);
    to.append(record.message_index_length);
    append_text(to, record.compression);
    to.append(record.compressed_size);
    to.append(record.uncompressed_size);
}

void append(buffer& to, const attachment_record& record, bool pad) {
    framed frame(to, opcode::attachment, pad);
    auto from = to.size();
    to.append(record.log_time);
    to.append(record.create_time);
    append_text(to, record.name);
    append_text(to, record.media_type);
    to.append(std::uint64_t{record.data.size()});
    to.append(record.data);
    to.append(crc32(to.view().subspan(from)));
}

void append(buffer& to, const attachment_index_record& record, bool pad) {
    framed frame(to, opcode::attachment_index, pad);
    to.append(record.offset);
    to.append(record.length);
    to.append(record.log_time);
    to.append(record.create_time);
    to.append(record.data_size);
    append_text(to, record.name);
    append_text(to, record.media_type);
}

void append(buffer& to, const metadata_record& record, bool pad) {
    framed frame(to, opcode::metadata, pad);
    append_text(to, record.name);
    append_map(to, record.metadata);
}

void append(buffer& to, const metadata_index_record& record, bool pad) {
    framed frame(to, opcode::metadata_index, pad);
    to.append(record.offset);
    to.append(record.length);
    append_text(to, record.name);
}

void append(buffer& to, const statistics_record& record, bool pad) {
    framed frame(to, opcode::statistics, pad);
    to.append(record.message_count);
    to.append(record.schema_count);
    to.append(record.channel_count);
    to.append(record.attachment_count);
    to.append(record.metadata_count);
    to.append(record.chunk_count);
    to.append(record.message_start_time);
    to.append(record.message_end_time);
    append_map(to, record.channel_message_counts);
}

void append(buffer& to, const summary_offset_record& record, bool pad) {
    framed frame(to, opcode::summary_offset, pad);
    to.append(record.group_opcode);
    to.append(record.group_start);
    to.append(record.group_length);
}

void append(buffer& to, const data_end_record& record) {
    framed frame(to, opcode::data_end);
    to.append(record.data_section_crc);
}

} // namespace ise::bag
