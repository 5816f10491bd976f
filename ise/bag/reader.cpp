#include <ise/bag/reader.hpp>

#include <ise/bag/compression.hpp>
#include <ise/bag/schema_room.hpp>
#include <ise/core/little_endian.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <queue>
#include <span>
#include <tuple>
#include <utility>

namespace ise::bag {
namespace {

constexpr std::size_t window_bytes = std::size_t{256} << 10;

bool is_magic(bytes_view data) noexcept {
    return data.size() >= magic.size() && std::equal(magic.begin(), magic.end(), data.begin(),
                                                     [](unsigned char a, std::byte b) { return std::byte{a} == b; });
}

failure in_file(const source& from, std::uint64_t at, errc code, const std::string& what) {
    return failure(code, fmt::format("{}: at byte {}: {}", from.name(), at, what));
}

template <class Record>
result<Record> parse_at(const source& from, std::uint64_t at, bytes_view content) {
    auto made = parse<Record>(content);
    if (!made) return in_file(from, at, made.error().code(), made.error().message());
    return made;
}

result<bytes> read_part(source& from, std::uint64_t at, std::uint64_t size) {
    bytes made(static_cast<std::size_t>(size));
    auto got = from.read(at, made);
    if (!got) return got.error();
    if (*got != made.size()) return in_file(from, at + *got, errc::malformed, "the file ends here, within a record");
    return made;
}

// A whole record, of which an index says where it is.
result<bytes> read_record(source& from, opcode op, std::uint64_t at, std::uint64_t length,
                          const reader_limits& limits) {
    auto size = from.size();
    if (!size) return size.error();
    if (length < record_head_bytes || at > *size || length > *size - at)
        return in_file(
            from, at, errc::malformed,
            fmt::format("the index has a {} of {} bytes, which is not within the file", name_of(op), length));
    if (length > limits.max_record_bytes)
        return in_file(from, at, errc::too_large,
                       fmt::format("a {} has {} bytes, more than {} (max_record_bytes)", name_of(op), length,
                                   limits.max_record_bytes));
    auto made = read_part(from, at, length);
    if (!made) return made;
    if (static_cast<opcode>((*made)[0]) != op ||
        detail::load_little<std::uint64_t>(made->data() + 1) != length - record_head_bytes)
        return in_file(from, at, errc::malformed,
                       fmt::format("the index has a {} here, which there is not", name_of(op)));
    made->erase(made->begin(), made->begin() + record_head_bytes);
    return made;
}

// The records of a chunk into `to`; its CRC only where everything was decompressed.
result<void> unpack(const source& from, std::uint64_t at, const chunk_record& chunk, const reader_limits& limits,
                    buffer& to) {
    to.clear();
    if (chunk.uncompressed_size > limits.max_chunk_bytes)
        return in_file(from, at, errc::too_large,
                       fmt::format("a Chunk decompresses to {} bytes, more than {} (max_chunk_bytes)",
                                   chunk.uncompressed_size, limits.max_chunk_bytes));
    auto kind = compression_named(chunk.compression);
    if (!kind) return in_file(from, at, kind.error().code(), "a Chunk: " + kind.error().message());
    auto done = decompress(*kind, chunk.records, static_cast<std::size_t>(chunk.uncompressed_size), to);
    if (!done) return in_file(from, at, done.error().code(), "a Chunk: " + done.error().message());
    if (chunk.uncompressed_crc != 0 && crc32(to.view()) != chunk.uncompressed_crc) {
        to.clear(); // any of it may be wrong
        return in_file(from, at, errc::malformed, "a Chunk: its CRC does not match");
    }
    return {};
}

// The record at `at` of a decompressed chunk.
result<record> record_in(const source& from, std::uint64_t chunk_at, bytes_view chunk, std::uint64_t at) {
    if (at > chunk.size() || chunk.size() - at < record_head_bytes)
        return in_file(from, chunk_at, errc::malformed,
                       fmt::format("a Chunk: byte {} of its {} is no record", at, chunk.size()));
    auto size = detail::load_little<std::uint64_t>(chunk.data() + at + 1);
    if (size > chunk.size() - at - record_head_bytes)
        return in_file(from, chunk_at, errc::malformed,
                       fmt::format("a Chunk: the record at its byte {} does not end within it", at));
    record made;
    made.op = static_cast<opcode>(chunk[static_cast<std::size_t>(at)]);
    made.content = chunk.subspan(static_cast<std::size_t>(at) + record_head_bytes, static_cast<std::size_t>(size));
    made.offset = chunk_at;
    made.in_chunk = at;
    return made;
}

} // namespace

record_reader::record_reader(source& from, reader_limits limits, std::uint64_t at)
    : from_(from), limits_(limits), at_(at) {}

failure record_reader::wrong(errc code, std::uint64_t at, const std::string& what) const {
    return in_file(from_, at, code, what);
}

// As many bytes as there are, at most `count`, in window_ from `from` on.
result<void> record_reader::load(std::uint64_t from, std::size_t count) {
    if (from >= window_at_ && from - window_at_ <= window_.size() &&
        window_.size() - static_cast<std::size_t>(from - window_at_) >= count)
        return {};
    auto size = from_.size();
    if (!size) return size.error();
    auto there = *size > from ? *size - from : 0;
    window_at_ = from;
    // The length of a record may be anything: no more than the file has.
    window_.resize(static_cast<std::size_t>(std::min<std::uint64_t>(std::max(count, window_bytes), there)));
    auto got = from_.read(from, window_);
    if (!got) return got.error();
    window_.resize(*got);
    return {};
}

result<std::optional<record>> record_reader::next_in_file() {
    if (ended_) return std::optional<record>();
    if (at_ == 0) {
        if (auto done = load(0, magic.size()); !done) return done.error();
        if (!is_magic(window_))
            return wrong(errc::malformed, 0,
                         window_.empty() ? "it is empty"
                                         : "it is not an MCAP file: it does not begin with MCAP's magic bytes");
        at_ = magic.size();
    }
    auto rest = [&] { return bytes_view(window_).subspan(static_cast<std::size_t>(at_ - window_at_)); };
    if (after_footer_) {
        if (auto done = load(at_, magic.size()); !done) return done.error();
        if (!is_magic(rest()))
            return wrong(errc::malformed, at_, "the magic bytes at the end are missing: the file was cut");
        if (auto done = load(at_ + magic.size(), 1); !done) return done.error();
        at_ += magic.size();
        if (!rest().empty()) return wrong(errc::malformed, at_, "there are bytes after the end of the recording");
        ended_ = true;
        return std::optional<record>();
    }
    if (auto done = load(at_, record_head_bytes); !done) return done.error();
    if (rest().empty()) return wrong(errc::malformed, at_, "the file ends here, without a Footer: it was not closed");
    if (rest().size() < record_head_bytes)
        return wrong(errc::malformed, at_, "the file ends here, within the head of a record: it was cut");
    auto size = detail::load_little<std::uint64_t>(rest().data() + 1);
    record made;
    made.op = static_cast<opcode>(rest()[0]);
    made.offset = at_;
    if (made.op == opcode{}) return wrong(errc::malformed, at_, "no record has the opcode 0");
    auto file = from_.size();
    if (!file) return file.error();
    if (size > *file - std::min(*file, at_ + record_head_bytes))
        return wrong(errc::malformed, at_,
                     fmt::format("a {} of {} bytes does not end within the file: it was cut", name_of(made.op), size));
    if (size > limits_.max_record_bytes)
        return wrong(errc::too_large, at_,
                     fmt::format("a {} has {} bytes, more than {} (max_record_bytes)", name_of(made.op), size,
                                 limits_.max_record_bytes));
    auto whole = record_head_bytes + static_cast<std::size_t>(size);
    if (auto done = load(at_, whole); !done) return done.error();
    if (rest().size() < whole) return wrong(errc::malformed, at_, "the file became shorter while it was read");
    made.content = rest().subspan(record_head_bytes, static_cast<std::size_t>(size));
    at_ += whole;
    after_footer_ = made.op == opcode::footer;
    return std::optional<record>(made);
}

result<void> record_reader::open_chunk(const record& chunk) {
    auto parsed = parse_at<chunk_record>(from_, chunk.offset, chunk.content);
    if (!parsed) return parsed.error();
    chunk_at_ = chunk.offset;
    chunk_next_ = 0;
    chunk_trouble_.reset();
    if (auto done = unpack(from_, chunk.offset, *parsed, limits_, chunk_); !done) {
        if (!skipped_) {
            chunk_.clear();
            return done;
        }
        chunk_trouble_ = done.error(); // after what could be decompressed
    }
    return {};
}

result<std::optional<record>> record_reader::next_in_chunk() {
    auto over = [&](const failure& why) -> result<std::optional<record>> {
        chunk_next_ = chunk_.size();
        auto first = chunk_trouble_ ? *std::exchange(chunk_trouble_, std::nullopt) : why;
        if (!skipped_) return first;
        skipped_(first);
        return std::optional<record>();
    };
    if (chunk_next_ >= chunk_.size()) {
        if (chunk_trouble_) return over(*chunk_trouble_);
        return std::optional<record>();
    }
    auto made = record_in(from_, chunk_at_, chunk_.view(), chunk_next_);
    if (!made) return over(made.error());
    const bool known = static_cast<std::uint8_t>(made->op) <= static_cast<std::uint8_t>(opcode::data_end);
    if (known && made->op != opcode::schema && made->op != opcode::channel && made->op != opcode::message)
        return over(wrong(errc::malformed, chunk_at_,
                          fmt::format("a Chunk: it has a {}, which must not be in it", name_of(made->op))));
    chunk_next_ += record_head_bytes + made->content.size();
    return std::optional<record>(*made);
}

result<std::optional<record>> record_reader::next() {
    for (;;) {
        if (chunk_next_ < chunk_.size() || chunk_trouble_) {
            auto got = next_in_chunk();
            if (!got || *got) return got;
            continue;
        }
        auto got = next_in_file();
        if (!got || !*got || (*got)->op != opcode::chunk || !expand_) return got;
        if (auto done = open_chunk(**got); !done) {
            if (!skipped_) return done.error();
            skipped_(done.error());
        }
    }
}

namespace {

result<void> add_schema(summary& to, const source& from, std::uint64_t at, bytes_view content, schema_room& room) {
    auto made = parse_at<schema_record>(from, at, content);
    if (!made) return made.error();
    if (made->id == 0) return {}; // as the specification demands
    if (auto known = to.schemas.find(made->id); known != to.schemas.end()) {
        if (known->second.name != made->name || known->second.data != made->data)
            return in_file(from, at, errc::malformed, fmt::format("the Schema {} comes twice, and differs", made->id));
        return {};
    }
    if (auto done = room.take(at, content.size()); !done) return done;
    to.schemas.emplace(made->id, std::move(*made));
    return {};
}

result<void> add_channel(summary& to, const source& from, std::uint64_t at, bytes_view content, schema_room& room) {
    auto made = parse_at<channel_record>(from, at, content);
    if (!made) return made.error();
    if (auto known = to.channels.find(made->id); known != to.channels.end()) {
        if (known->second.topic != made->topic || known->second.schema_id != made->schema_id)
            return in_file(from, at, errc::malformed,
                           fmt::format("the Channel {} ('{}') comes twice, and differs", made->id, made->topic));
        return {};
    }
    if (made->schema_id != 0 && !to.schemas.contains(made->schema_id))
        return in_file(from, at, errc::malformed,
                       fmt::format("the Channel {} ('{}') has the schema {}, which did not come before it", made->id,
                                   made->topic, made->schema_id));
    if (auto done = room.take(at, content.size()); !done) return done;
    to.channels.emplace(made->id, std::move(*made));
    return {};
}

// The summary of a closed file; nothing where there is none.
result<bool> read_index(source& from, std::uint64_t size, const reader_limits& limits, summary& into) {
    if (size < magic.size() * 2 + footer_bytes) return false;
    auto tail_at = size - magic.size() - footer_bytes;
    auto tail = read_part(from, tail_at, footer_bytes + magic.size());
    if (!tail) return tail.error();
    if (!is_magic(bytes_view(*tail).subspan(footer_bytes)) || static_cast<opcode>((*tail)[0]) != opcode::footer ||
        detail::load_little<std::uint64_t>(tail->data() + 1) != 20)
        return false;
    auto foot = parse_at<footer_record>(from, tail_at, bytes_view(*tail).subspan(record_head_bytes, 20));
    if (!foot) return foot.error();
    into.complete = true;
    if (foot->summary_start == 0) return false;
    if (foot->summary_start < magic.size() || foot->summary_start > tail_at)
        return in_file(from, tail_at, errc::malformed,
                       fmt::format("the Footer says that the summary begins at byte {}, which is not before it",
                                   foot->summary_start));
    auto length = tail_at - foot->summary_start;
    if (length > limits.max_summary_bytes)
        return in_file(from, foot->summary_start, errc::too_large,
                       fmt::format("the summary has {} bytes, more than {} (max_summary_bytes)", length,
                                   limits.max_summary_bytes));
    auto read = read_part(from, foot->summary_start, length);
    if (!read) return read.error();
    if (foot->summary_crc != 0) {
        auto crc = crc32(*read);
        crc = crc32(bytes_view(*tail).first(footer_bytes - 4), crc);
        if (crc != foot->summary_crc)
            return in_file(from, foot->summary_start, errc::malformed, "the CRC of the summary does not match");
    }
    bytes_view left = *read;
    auto at = foot->summary_start;
    schema_room room(from, limits.max_schema_bytes);
    bool counted = false, chunks = false;
    while (!left.empty()) {
        if (left.size() < record_head_bytes)
            return in_file(from, at, errc::malformed, "the summary ends within a record");
        auto op = static_cast<opcode>(left[0]);
        auto content_size = detail::load_little<std::uint64_t>(left.data() + 1);
        if (content_size > left.size() - record_head_bytes)
            return in_file(from, at, errc::malformed, fmt::format("a {} does not end within the summary", name_of(op)));
        auto content = left.subspan(record_head_bytes, static_cast<std::size_t>(content_size));
        switch (op) {
            case opcode::schema:
                if (auto done = add_schema(into, from, at, content, room); !done) return done.error();
                break;
            case opcode::channel:
                if (auto done = add_channel(into, from, at, content, room); !done) return done.error();
                break;
            case opcode::statistics: {
                auto made = parse_at<statistics_record>(from, at, content);
                if (!made) return made.error();
                into.statistics = std::move(*made);
                counted = true;
                break;
            }
            case opcode::chunk_index: {
                auto made = parse_at<chunk_index_record>(from, at, content);
                if (!made) return made.error();
                into.chunks.push_back(std::move(*made));
                chunks = true;
                break;
            }
            case opcode::attachment_index: {
                auto made = parse_at<attachment_index_record>(from, at, content);
                if (!made) return made.error();
                into.attachments.push_back(std::move(*made));
                break;
            }
            case opcode::metadata_index: {
                auto made = parse_at<metadata_index_record>(from, at, content);
                if (!made) return made.error();
                into.metadata.push_back(std::move(*made));
                break;
            }
            default: break;
        }
        left = left.subspan(record_head_bytes + content.size());
        at += record_head_bytes + content.size();
    }
    // An index without which messages, channels or counts would be overlooked is none.
    const auto& counts = into.statistics;
    bool whole = counted && (counts.message_count == 0 || chunks) && into.chunks.size() == counts.chunk_count &&
                 into.channels.size() == counts.channel_count && into.attachments.size() == counts.attachment_count &&
                 into.metadata.size() == counts.metadata_count;
    return whole;
}

void count(statistics_record& counts, const message_record& message) {
    if (counts.message_count == 0) {
        counts.message_start_time = counts.message_end_time = message.log_time;
    } else {
        counts.message_start_time = std::min(counts.message_start_time, message.log_time);
        counts.message_end_time = std::max(counts.message_end_time, message.log_time);
    }
    ++counts.message_count;
    ++counts.channel_message_counts[message.channel_id];
}

// All records of the data section. What is wrong is `damage`; what came before it is described.
void scan(source& from, const reader_limits& limits, summary& into) {
    record_reader records(from, limits);
    schema_room room(from, limits.max_schema_bytes);
    bool first = true, data_over = false;
    auto damaged = [&](const failure& why) {
        if (!into.damage) into.damage = why;
    };
    std::uint64_t good = 0;
    records.skip_damaged_chunks(damaged);
    for (;;) {
        auto got = records.next();
        if (!got) {
            damaged(got.error());
            break;
        }
        if (!*got) {
            good = into.file_bytes;
            into.complete = true;
            break;
        }
        const auto& one = **got;
        auto at = one.offset;
        bool fits = true;
        auto keep = [&](const auto& parsed) {
            if (!parsed) damaged(parsed.error()), fits = false;
            return fits;
        };
        if (std::exchange(first, false) && one.op != opcode::header)
            damaged(in_file(from, at, errc::malformed, "the first record is no Header"));
        if (one.in_chunk != record::outside && (into.chunks.empty() || into.chunks.back().chunk_start_offset != at)) {
            chunk_index_record made;
            made.chunk_start_offset = at;
            made.chunk_length = records.offset() - at;
            made.compressed_size = made.chunk_length;
            into.chunks.push_back(std::move(made));
        }
        switch (one.op) {
            case opcode::header:
                if (auto made = parse_at<header_record>(from, at, one.content); keep(made)) into.header = *made;
                break;
            case opcode::schema: keep(add_schema(into, from, at, one.content, room)); break;
            case opcode::channel: keep(add_channel(into, from, at, one.content, room)); break;
            case opcode::message: {
                auto made = parse_at<message_record>(from, at, one.content);
                if (!keep(made)) break;
                if (!into.channels.contains(made->channel_id)) {
                    damaged(in_file(
                        from, at, errc::malformed,
                        fmt::format("a Message has the channel {}, which did not come before it", made->channel_id)));
                    fits = false;
                    break;
                }
                if (one.in_chunk == record::outside) {
                    if (into.loose.size() >= limits.max_index_entries) {
                        damaged(in_file(from, at, errc::too_large,
                                        fmt::format("more than {} messages stand outside of chunks (max_index_entries)",
                                                    limits.max_index_entries)));
                        fits = false;
                        break;
                    }
                    into.loose.push_back({made->log_time, at});
                } else {
                    auto& chunk = into.chunks.back();
                    bool none = chunk.uncompressed_size == 0;
                    chunk.message_start_time =
                        none ? made->log_time : std::min(chunk.message_start_time, made->log_time);
                    chunk.message_end_time = none ? made->log_time : std::max(chunk.message_end_time, made->log_time);
                    chunk.uncompressed_size = one.in_chunk + record_head_bytes + one.content.size();
                }
                count(into.statistics, *made);
                break;
            }
            case opcode::attachment: {
                auto made = parse_at<attachment_record>(from, at, one.content);
                if (!keep(made)) break;
                attachment_index_record entry;
                entry.offset = at;
                entry.length = record_head_bytes + one.content.size();
                entry.log_time = made->log_time;
                entry.create_time = made->create_time;
                entry.data_size = made->data.size();
                entry.name = std::move(made->name);
                entry.media_type = std::move(made->media_type);
                if (!data_over) into.attachments.push_back(std::move(entry));
                break;
            }
            case opcode::metadata: {
                auto made = parse_at<metadata_record>(from, at, one.content);
                if (!keep(made)) break;
                metadata_index_record entry;
                entry.offset = at;
                entry.length = record_head_bytes + one.content.size();
                entry.name = std::move(made->name);
                into.metadata.push_back(std::move(entry));
                break;
            }
            case opcode::data_end: data_over = true; break;
            default: break;
        }
        if (!into.damage) good = records.offset();
    }
    into.good_bytes = good;
    auto& counts = into.statistics;
    counts.schema_count = static_cast<std::uint16_t>(std::min<std::size_t>(into.schemas.size(), 0xffff));
    counts.channel_count = static_cast<std::uint32_t>(into.channels.size());
    counts.attachment_count = static_cast<std::uint32_t>(into.attachments.size());
    counts.metadata_count = static_cast<std::uint32_t>(into.metadata.size());
    counts.chunk_count = static_cast<std::uint32_t>(into.chunks.size());
}

} // namespace

result<summary> read_summary(source& from, depth how, const reader_limits& limits) {
    summary made;
    auto size = from.size();
    if (!size) return size.error();
    made.file_bytes = *size;
    record_reader head(from, limits);
    auto first = head.next();
    if (!first && head.offset() == 0) return first.error(); // no MCAP file
    std::optional<failure> trouble;
    if (how == depth::index) {
        auto indexed = read_index(from, *size, limits, made);
        if (indexed && *indexed) {
            made.indexed = true;
            made.good_bytes = *size;
            if (first && *first && (*first)->op == opcode::header)
                if (auto header = parse<header_record>((*first)->content)) made.header = std::move(*header);
            return made;
        }
        if (!indexed) trouble = indexed.error();
    } else {
        summary index; // checked too
        auto indexed = read_index(from, *size, limits, index);
        if (!indexed) trouble = indexed.error();
        made = summary();
    }
    made = summary();
    made.file_bytes = *size;
    scan(from, limits, made);
    if (!made.damage && trouble) made.damage = trouble;
    return made;
}

struct message_reader::state {
    struct loaded {
        std::uint64_t at = 0; // of the chunk in the file
        buffer data;
        std::vector<message_index_record::entry> entries; // those that are wanted, by time
        std::size_t next = 0;
    };
    struct place {
        timestamp time;
        std::uint64_t file_at, in_chunk;
        std::size_t chunk;
        bool operator<(const place& b) const noexcept { // the first is the greatest
            return std::tie(time, file_at, in_chunk) > std::tie(b.time, b.file_at, b.in_chunk);
        }
    };

    state(source& file, const summary& what, message_filter which, reader_limits most)
        : from(file), about(what), filter(std::move(which)), limits(most) {
        for (const auto& [id, channel] : about.channels)
            if (!filter.wanted || filter.wanted(channel)) wanted[id] = true;
        for (const auto& one : about.chunks)
            if (one.message_end_time >= filter.from && one.message_start_time < filter.until) chunks.push_back(&one);
        std::ranges::sort(chunks, {},
                          [](const auto* one) { return std::tie(one->message_start_time, one->chunk_start_offset); });
        for (const auto& one : about.loose)
            if (one.log_time >= filter.from && one.log_time < filter.until) loose.push_back(one);
        std::ranges::sort(loose, {}, [](const auto& one) { return std::tie(one.log_time, one.offset); });
    }

    source& from;
    const summary& about;
    message_filter filter;
    reader_limits limits;
    std::map<std::uint16_t, bool> wanted;
    std::vector<const chunk_index_record*> chunks; // by their first message
    std::size_t next_chunk = 0;
    std::vector<message_index_record::entry> loose;
    std::size_t next_loose = 0;
    std::vector<std::unique_ptr<loaded>> open;
    std::vector<std::size_t> free_places;
    std::uint64_t open_bytes = 0;
    std::priority_queue<place> waiting;  // the next message of each open chunk
    bytes message;                       // one that stands outside of a chunk
    std::optional<std::size_t> finished; // whose data was handed out last

    result<void> open_chunk(const chunk_index_record& where) {
        auto raw = read_record(from, opcode::chunk, where.chunk_start_offset, where.chunk_length, limits);
        if (!raw) return raw.error();
        auto chunk = parse_at<chunk_record>(from, where.chunk_start_offset, *raw);
        if (!chunk) return chunk.error();
        if (chunk->uncompressed_size > limits.max_open_bytes - std::min(limits.max_open_bytes, open_bytes))
            return in_file(from, where.chunk_start_offset, errc::too_large,
                           fmt::format("chunks that overlap in time have more than {} bytes (max_open_bytes)",
                                       limits.max_open_bytes));
        auto made = std::make_unique<loaded>();
        made->at = where.chunk_start_offset;
        auto unpacked = unpack(from, where.chunk_start_offset, *chunk, limits, made->data);
        if (!unpacked && !about.damage) return unpacked;
        for (std::uint64_t at = 0; at < made->data.size();) {
            auto one = record_in(from, made->at, made->data.view(), at);
            if (!one) {
                if (about.damage) break; // what is whole was found by the scan
                return one.error();
            }
            if (one->op == opcode::message) {
                auto outcome = parse_at<message_record>(from, made->at, one->content);
                if (!outcome) return outcome.error();
                if (!about.channels.contains(outcome->channel_id))
                    return in_file(from, made->at, errc::malformed,
                                   fmt::format("a Message has the channel {}, which the file does not describe",
                                               outcome->channel_id));
                if (wanted.contains(outcome->channel_id) && outcome->log_time >= filter.from &&
                    outcome->log_time < filter.until)
                    made->entries.push_back({outcome->log_time, at});
            }
            at += record_head_bytes + one->content.size();
        }
        std::ranges::sort(made->entries, {}, [](const auto& one) { return std::tie(one.log_time, one.offset); });
        if (made->entries.empty()) return {};
        open_bytes += made->data.size();
        std::size_t at = open.size();
        if (free_places.empty()) open.emplace_back();
        else at = free_places.back(), free_places.pop_back();
        open[at] = std::move(made);
        offer(at);
        return {};
    }
    void offer(std::size_t chunk) {
        const auto& one = *open[chunk];
        waiting.push({one.entries[one.next].log_time, one.at, one.entries[one.next].offset, chunk});
    }
    void close(std::size_t chunk) {
        open_bytes -= open[chunk]->data.size();
        open[chunk].reset();
        free_places.push_back(chunk);
    }

    result<std::optional<message_record>> next() {
        if (finished) close(*std::exchange(finished, std::nullopt));
        while (next_chunk < chunks.size() &&
               (waiting.empty() || chunks[next_chunk]->message_start_time <= waiting.top().time))
            if (auto done = open_chunk(*chunks[next_chunk++]); !done) return done.error();
        while (next_loose < loose.size() && (waiting.empty() || loose[next_loose].log_time <= waiting.top().time)) {
            auto got = next_outside();
            if (!got || *got) return got;
        }
        if (waiting.empty()) return std::optional<message_record>();
        auto top = waiting.top();
        waiting.pop();
        auto& chunk = *open[top.chunk];
        auto one = record_in(from, chunk.at, chunk.data.view(), top.in_chunk);
        if (!one) return one.error();
        auto made = parse_at<message_record>(from, chunk.at, one->content);
        if (!made) return made.error();
        if (++chunk.next < chunk.entries.size()) offer(top.chunk);
        else finished = top.chunk;
        return std::optional<message_record>(*made);
    }
    result<std::optional<message_record>> next_outside() {
        auto at = loose[next_loose++].offset;
        auto head = read_part(from, at, record_head_bytes);
        if (!head) return head.error();
        auto size = detail::load_little<std::uint64_t>(head->data() + 1);
        if (size > limits.max_record_bytes) return in_file(from, at, errc::malformed, "the file has changed");
        auto read = read_record(from, opcode::message, at, size + record_head_bytes, limits);
        if (!read) return read.error();
        message = std::move(*read);
        auto made = parse_at<message_record>(from, at, message);
        if (!made) return made.error();
        if (!wanted.contains(made->channel_id)) return std::optional<message_record>();
        return std::optional<message_record>(*made);
    }
};

message_reader::message_reader(source& from, const summary& about, message_filter filter, reader_limits limits)
    : state_(std::make_unique<state>(from, about, std::move(filter), limits)) {}
message_reader::~message_reader() = default;
message_reader::message_reader(message_reader&&) noexcept = default;
message_reader& message_reader::operator=(message_reader&&) noexcept = default;
result<std::optional<message_record>> message_reader::next() { return state_->next(); }

result<attachment> read_attachment(source& from, const attachment_index_record& where, const reader_limits& limits) {
    auto raw = read_record(from, opcode::attachment, where.offset, where.length, limits);
    if (!raw) return raw.error();
    auto parsed = parse_at<attachment_record>(from, where.offset, *raw);
    if (!parsed) return parsed.error();
    attachment made;
    made.log_time = parsed->log_time;
    made.create_time = parsed->create_time;
    made.name = std::move(parsed->name);
    made.media_type = std::move(parsed->media_type);
    made.data.assign(parsed->data.begin(), parsed->data.end());
    return made;
}

result<metadata_record> read_metadata(source& from, const metadata_index_record& where, const reader_limits& limits) {
    auto raw = read_record(from, opcode::metadata, where.offset, where.length, limits);
    if (!raw) return raw.error();
    return parse_at<metadata_record>(from, where.offset, *raw);
}

} // namespace ise::bag
