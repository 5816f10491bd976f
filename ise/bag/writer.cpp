#include <ise/bag/writer.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <limits>
#include <tuple>
#include <utility>

namespace ise::bag {

struct writer::state {
    state(std::unique_ptr<sink> to, writer_options how)
        : out(std::move(to)), options(std::move(how)), pack(options.packing, options.level) {}

    std::unique_ptr<sink> out;
    writer_options options;
    compressor pack;
    std::uint64_t written = 0;
    std::uint32_t data_crc = 0; // of all before Data End
    std::optional<failure> broken;
    bool closed = false;
    buffer room; // what is written next

    std::map<std::uint16_t, schema_record> schemas;
    std::map<std::uint16_t, channel_record> channels;
    std::map<std::tuple<std::string, std::string, bytes>, std::uint16_t> known_schemas;
    std::uint32_t next_schema = 1, next_channel = 0;
    statistics_record counts;

    buffer chunk, packed;
    timestamp chunk_start = 0, chunk_end = 0;
    std::uint64_t chunk_messages = 0;
    std::map<std::uint16_t, message_index_record> index; // of the present chunk; kept, for its memory

    std::vector<chunk_index_record> chunk_indices;
    std::vector<attachment_index_record> attachment_indices;
    std::vector<metadata_index_record> metadata_indices;

    result<void> put(bytes_view data) {
        if (broken) return *broken;
        if (auto done = out->write(data); !done) {
            broken = done.error();
            return *broken;
        }
        written += data.size();
        return {};
    }
    // A part of the data section.
    result<void> put_data(bytes_view data) {
        data_crc = crc32(data, data_crc);
        return put(data);
    }

    template <class Record>
    result<void> put_or_chunk(const Record& record) {
        if (broken) return *broken;
        if (options.chunks) {
            append(chunk, record);
            return chunk.size() >= options.chunk_bytes ? flush() : result<void>();
        }
        room.clear();
        append(room, record, options.pad);
        return put_data(room.view());
    }

    void note(const message_record& message) {
        if (counts.message_count == 0) {
            counts.message_start_time = counts.message_end_time = message.log_time;
        } else {
            counts.message_start_time = std::min(counts.message_start_time, message.log_time);
            counts.message_end_time = std::max(counts.message_end_time, message.log_time);
        }
        ++counts.message_count;
        ++counts.channel_message_counts[message.channel_id];
    }

    result<void> flush() {
        if (broken) return *broken;
        if (chunk.empty()) return {};
        chunk_record made;
        made.message_start_time = chunk_start;
        made.message_end_time = chunk_end;
        made.uncompressed_size = chunk.size();
        made.uncompressed_crc = options.crc ? crc32(chunk.view()) : 0;
        made.compression = name_of(options.packing);
        bytes_view records = chunk.view();
        if (options.packing != compression::none) {
            packed.clear();
            pack.compress(chunk.view(), packed);
            records = packed.view();
        }
        made.records = records;
        room.clear();
        append(room, made);
        chunk_index_record entry;
        entry.message_start_time = chunk_start;
        entry.message_end_time = chunk_end;
        entry.chunk_start_offset = written;
        entry.chunk_length = room.size();
        entry.compression = made.compression;
        entry.compressed_size = records.size();
        entry.uncompressed_size = chunk.size();
        if (options.message_index) {
            auto from = room.size();
            for (auto& [channel, one] : index) {
                if (one.entries.empty()) continue;
                entry.message_index_offsets[channel] = written + room.size();
                append(room, one, options.pad);
                one.entries.clear();
            }
            entry.message_index_length = room.size() - from;
        }
        ++counts.chunk_count;
        if (options.chunk_index) chunk_indices.push_back(std::move(entry));
        chunk.recycle();
        chunk_start = chunk_end = 0;
        chunk_messages = 0;
        return put_data(room.view());
    }

    // The records of one kind in the summary, and where they are.
    template <class Records>
    void group(buffer& to, std::uint64_t base, opcode op, const Records& records,
               std::vector<summary_offset_record>& groups) {
        auto from = to.size();
        for (const auto& one : records) append(to, one, options.pad);
        if (to.size() == from) return;
        summary_offset_record made;
        made.group_opcode = static_cast<std::uint8_t>(op);
        made.group_start = base + from;
        made.group_length = to.size() - from;
        groups.push_back(made);
    }

    template <class Map>
    static auto values(const Map& of) {
        std::vector<typename Map::mapped_type> made;
        for (const auto& [id, one] : of) made.push_back(one);
        return made;
    }

    result<void> close() {
        if (auto done = flush(); !done) return done;
        if (std::exchange(closed, true)) return {};
        room.clear();
        data_end_record end;
        end.data_section_crc = data_crc;
        append(room, end);
        if (auto done = put(room.view()); !done) return done;

        room.clear();
        auto base = written;
        std::vector<summary_offset_record> groups;
        if (options.repeat_schemas) group(room, base, opcode::schema, values(schemas), groups);
        if (options.repeat_channels) group(room, base, opcode::channel, values(channels), groups);
        if (options.statistics) group(room, base, opcode::statistics, std::vector{counts}, groups);
        if (options.metadata_index) group(room, base, opcode::metadata_index, metadata_indices, groups);
        if (options.attachment_index) group(room, base, opcode::attachment_index, attachment_indices, groups);
        if (options.chunk_index) group(room, base, opcode::chunk_index, chunk_indices, groups);
        footer_record foot;
        if (!room.empty()) foot.summary_start = base;
        if (options.summary_offsets && !groups.empty()) {
            foot.summary_offset_start = base + room.size();
            for (const auto& one : groups) append(room, one, options.pad);
        }
        append(room, foot);
        room.truncate(room.size() - 4);
        room.append(crc32(room.view()));
        room.append(std::as_bytes(std::span(magic)));
        return put(room.view());
    }
};

writer::writer(std::unique_ptr<state> made) noexcept : state_(std::move(made)) {}
writer::writer(writer&&) noexcept = default;
writer& writer::operator=(writer&&) noexcept = default;
writer::~writer() = default;

result<writer> writer::make(std::unique_ptr<sink> to, writer_options options) {
    writer made(std::make_unique<state>(std::move(to), std::move(options)));
    auto& self = *made.state_;
    self.room.append(std::as_bytes(std::span(magic)));
    header_record head;
    head.profile = self.options.profile;
    head.library = self.options.library;
    append(self.room, head, self.options.pad);
    if (auto done = self.put_data(self.room.view()); !done) return done.error();
    return made;
}

result<std::uint16_t> writer::add_schema(std::string name, std::string encoding, bytes_view data) {
    auto& self = *state_;
    std::tuple<std::string, std::string, bytes> key(std::move(name), std::move(encoding),
                                                    bytes(data.begin(), data.end()));
    if (auto known = self.known_schemas.find(key); known != self.known_schemas.end()) return known->second;
    while (self.next_schema <= std::numeric_limits<std::uint16_t>::max() &&
           self.schemas.contains(static_cast<std::uint16_t>(self.next_schema)))
        ++self.next_schema;
    if (self.next_schema > std::numeric_limits<std::uint16_t>::max())
        return failure(errc::too_large, fmt::format("{}: a file has at most 65,535 schemas", self.out->name()));
    schema_record made;
    made.id = static_cast<std::uint16_t>(self.next_schema++);
    made.name = std::get<0>(key);
    made.encoding = std::get<1>(key);
    made.data = std::get<2>(key);
    auto id = made.id;
    if (auto done = add(std::move(made)); !done) return done.error();
    self.known_schemas.emplace(std::move(key), id);
    return id;
}

result<std::uint16_t> writer::add_channel(std::uint16_t schema_id, std::string topic, std::string message_encoding,
                                          string_map metadata) {
    auto& self = *state_;
    while (self.next_channel <= std::numeric_limits<std::uint16_t>::max() &&
           self.channels.contains(static_cast<std::uint16_t>(self.next_channel)))
        ++self.next_channel;
    if (self.next_channel > std::numeric_limits<std::uint16_t>::max())
        return failure(errc::too_large, fmt::format("{}: a file has at most 65,536 channels", self.out->name()));
    channel_record made;
    made.id = static_cast<std::uint16_t>(self.next_channel++);
    made.schema_id = schema_id;
    made.topic = std::move(topic);
    made.message_encoding = std::move(message_encoding);
    made.metadata = std::move(metadata);
    auto id = made.id;
    if (auto done = add(std::move(made)); !done) return done.error();
    return id;
}

result<void> writer::add(schema_record record) {
    auto& self = *state_;
    if (record.id == 0 || self.schemas.contains(record.id))
        return failure(errc::invalid_argument,
                       fmt::format("{}: the schema id {} is 0 or in use", self.out->name(), record.id));
    if (auto done = self.put_or_chunk(record); !done) return done;
    ++self.counts.schema_count;
    self.schemas.emplace(record.id, std::move(record));
    return {};
}

result<void> writer::add(channel_record record) {
    auto& self = *state_;
    if (self.channels.contains(record.id))
        return failure(errc::invalid_argument,
                       fmt::format("{}: the channel id {} is in use", self.out->name(), record.id));
    if (record.schema_id != 0 && !self.schemas.contains(record.schema_id))
        return failure(errc::invalid_argument, fmt::format("{}: the channel '{}' has the unknown schema {}",
                                                           self.out->name(), record.topic, record.schema_id));
    if (auto done = self.put_or_chunk(record); !done) return done;
    ++self.counts.channel_count;
    self.channels.emplace(record.id, std::move(record));
    return {};
}

result<void> writer::write(const message_record& message) {
    auto& self = *state_;
    if (self.broken) return *self.broken;
    if (!self.channels.contains(message.channel_id))
        return failure(errc::invalid_argument,
                       fmt::format("{}: a message has the unknown channel {}", self.out->name(), message.channel_id));
    if (!self.options.chunks) {
        self.note(message);
        self.room.clear();
        append(self.room, message);
        return self.put_data(self.room.view());
    }
    self.note(message);
    if (self.chunk_messages++ == 0) {
        self.chunk_start = self.chunk_end = message.log_time;
    } else {
        self.chunk_start = std::min(self.chunk_start, message.log_time);
        self.chunk_end = std::max(self.chunk_end, message.log_time);
    }
    if (self.options.message_index) {
        auto& index = self.index[message.channel_id];
        index.channel_id = message.channel_id;
        index.entries.push_back({message.log_time, self.chunk.size()});
    }
    append(self.chunk, message);
    return self.chunk.size() >= self.options.chunk_bytes ? self.flush() : result<void>();
}

result<void> writer::flush() { return state_->flush(); }

result<void> writer::attach(const attachment_record& attachment) {
    auto& self = *state_;
    if (auto done = self.flush(); !done) return done;
    self.room.clear();
    append(self.room, attachment, self.options.pad);
    attachment_index_record entry;
    entry.offset = self.written;
    entry.length = self.room.size();
    entry.log_time = attachment.log_time;
    entry.create_time = attachment.create_time;
    entry.data_size = attachment.data.size();
    entry.name = attachment.name;
    entry.media_type = attachment.media_type;
    self.attachment_indices.push_back(std::move(entry));
    ++self.counts.attachment_count;
    return self.put_data(self.room.view());
}

result<void> writer::write(const metadata_record& metadata) {
    auto& self = *state_;
    if (auto done = self.flush(); !done) return done;
    self.room.clear();
    append(self.room, metadata, self.options.pad);
    metadata_index_record entry;
    entry.offset = self.written;
    entry.length = self.room.size();
    entry.name = metadata.name;
    self.metadata_indices.push_back(std::move(entry));
    ++self.counts.metadata_count;
    return self.put_data(self.room.view());
}

result<void> writer::close() { return state_->close(); }
result<void> writer::sync() { return state_->out->sync(); }
std::uint64_t writer::bytes_written() const noexcept { return state_->written; }
std::uint64_t writer::bytes_waiting() const noexcept { return state_->chunk.size(); }
const statistics_record& writer::statistics() const noexcept { return state_->counts; }

} // namespace ise::bag
