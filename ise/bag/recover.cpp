#include <ise/bag/recover.hpp>

#include <ise/bag/schema_room.hpp>
#include <ise/core/little_endian.hpp>

#include <algorithm>
#include <set>
#include <span>
#include <utility>

namespace ise::bag {
namespace {

// The file as if its last record, a chunk that was cut, ended where the file does: what of it is there is decompressed.
class mended_source final : public source {
public:
    mended_source(source& of, bytes head, std::uint64_t at) : of_(of), head_(std::move(head)), at_(at) {}
    const std::string& name() const noexcept override { return of_.name(); }
    result<std::uint64_t> size() override { return of_.size(); }
    result<std::size_t> read(std::uint64_t offset, std::span<std::byte> into) override {
        auto got = of_.read(offset, into);
        if (!got) return got;
        for (std::size_t i = 0; i < head_.size(); ++i)
            if (at_ + i >= offset && at_ + i < offset + *got)
                into[static_cast<std::size_t>(at_ + i - offset)] = head_[i];
        return got;
    }

private:
    source& of_;
    bytes head_;
    std::uint64_t at_;
};

// Where lengths of a cut chunk are too long, the head with those that fit; nothing if there is no such chunk.
result<std::optional<bytes>> mend_chunk(source& from, std::uint64_t at) {
    auto size = from.size();
    if (!size) return size.error();
    constexpr std::size_t fixed = record_head_bytes + 28; // before the name of the compression
    constexpr std::size_t most = fixed + 4 + 16 + 8;
    if (at >= *size || *size - at <= fixed + 4 + 8) return std::optional<bytes>();
    bytes head(static_cast<std::size_t>(std::min<std::uint64_t>(most, *size - at)));
    auto got = from.read(at, head);
    if (!got) return got.error();
    head.resize(*got);
    if (head.size() <= fixed + 12 || static_cast<opcode>(head[0]) != opcode::chunk) return std::optional<bytes>();
    auto name = detail::load_little<std::uint32_t>(head.data() + fixed);
    if (name > 16 || head.size() < fixed + 4 + name + 8) return std::optional<bytes>();
    auto length_at = fixed + 4 + name;
    head.resize(length_at + 8);
    auto there = *size - at;
    detail::store_little(head.data() + 1, std::uint64_t{there - record_head_bytes});
    detail::store_little(head.data() + length_at, std::uint64_t{there - head.size()});
    return std::optional<bytes>(std::move(head));
}

class copy {
public:
    copy(const source& from, std::uint64_t max_schema_bytes, writer& to, recovery& made, summary about)
        : room_(from, max_schema_bytes), to_(to), made_(made), about_(std::move(about)) {}

    result<void> take(const record& one) {
        switch (one.op) {
            case opcode::schema: {
                auto read = parse<schema_record>(one.content);
                if (!read || read->id == 0 || schemas_.contains(read->id) || !has_room(one)) return {};
                schemas_.insert(read->id);
                return to_.add(std::move(*read));
            }
            case opcode::channel: {
                auto read = parse<channel_record>(one.content);
                if (!read || channels_.contains(read->id)) return {};
                if (read->schema_id != 0 && !schemas_.contains(read->schema_id)) return {};
                if (!has_room(one)) return {};
                channels_.insert(read->id);
                return to_.add(std::move(*read));
            }
            case opcode::message: {
                auto read = parse<message_record>(one.content);
                if (!read) return {};
                if (!channels_.contains(read->channel_id)) {
                    if (auto done = describe(read->channel_id); !done) return done;
                    if (!channels_.contains(read->channel_id)) return ++made_.left_out, result<void>();
                }
                ++made_.messages;
                return to_.write(*read);
            }
            case opcode::attachment: {
                auto read = parse<attachment_record>(one.content);
                if (!read) return made_.damaged_chunks.push_back(read.error()), result<void>();
                ++made_.attachments;
                return to_.attach(*read);
            }
            case opcode::metadata: {
                auto read = parse<metadata_record>(one.content);
                if (!read) return {};
                ++made_.metadata;
                return to_.write(*read);
            }
            default: return {};
        }
    }

private:
    // Whether the writer has room for it. A schema or a channel without room is left out like a damaged one; the first
    // is noted.
    bool has_room(const record& of) {
        auto taken = room_.take(of.offset, of.content.size());
        if (!taken && !std::exchange(full_, true)) made_.damaged_chunks.push_back(taken.error());
        return static_cast<bool>(taken);
    }

    // A channel whose own record is damaged; the summary is within the limit, too.
    result<void> describe(std::uint16_t id) {
        auto channel = about_.channels.find(id);
        if (channel == about_.channels.end()) return {};
        const auto of = channel->second.schema_id;
        if (of != 0 && !schemas_.contains(of)) {
            auto schema = about_.schemas.find(of);
            if (schema == about_.schemas.end()) return {};
            schemas_.insert(of);
            if (auto done = to_.add(schema->second); !done) return done;
        }
        channels_.insert(id);
        return to_.add(channel->second);
    }

    schema_room room_;
    bool full_ = false;
    writer& to_;
    recovery& made_;
    summary about_;
    std::set<std::uint16_t> schemas_, channels_;
};

} // namespace

result<recovery> recover(source& from, writer& to, const reader_limits& limits) {
    recovery made;
    auto size = from.size();
    if (!size) return size.error();
    made.file_bytes = *size;
    auto about = read_summary(from, depth::index, limits);
    copy into(from, limits.max_schema_bytes, to, made, about ? std::move(*about) : summary());
    record_reader records(from, limits);
    records.skip_damaged_chunks([&](const failure& why) { made.damaged_chunks.push_back(why); });
    for (;;) {
        auto got = records.next();
        if (!got) {
            if (records.offset() == 0) return got.error();
            made.end = got.error();
            break;
        }
        if (!*got) break;
        if ((*got)->op == opcode::data_end) { // the summary repeats what came
            auto rest = records.next();
            while (rest && *rest) rest = records.next();
            if (!rest) made.end = rest.error();
            break;
        }
        if (auto done = into.take(**got); !done) return done.error();
    }
    if (made.end) {
        auto head = mend_chunk(from, records.offset());
        if (!head) return head.error();
        if (*head) {
            mended_source mended(from, std::move(**head), records.offset());
            record_reader last(mended, limits, records.offset());
            last.skip_damaged_chunks([](const failure&) {}); // `end` says it
            for (auto got = last.next(); got && *got; got = last.next())
                if (auto done = into.take(**got); !done) return done.error();
        }
    }
    made.complete = !made.end && made.damaged_chunks.empty();
    if (auto done = to.close(); !done) return done.error();
    return made;
}

} // namespace ise::bag
