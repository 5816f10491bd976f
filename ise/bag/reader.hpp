#pragma once
#include <ise/bag/file.hpp>
#include <ise/bag/records.hpp>
#include <ise/core/buffer.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace ise::bag {

/// Limits on a file, which may come from untrusted sources (LIMITS.md).
struct reader_limits {
    std::uint64_t max_record_bytes = std::uint64_t{1} << 30;    ///< of one record
    std::uint64_t max_chunk_bytes = std::uint64_t{256} << 20;   ///< of one chunk when decompressed
    std::uint64_t max_summary_bytes = std::uint64_t{256} << 20; ///< of the summary
    std::uint64_t max_schema_bytes = std::uint64_t{256} << 20;  ///< of all schemas and channels together
    std::uint64_t max_open_bytes = std::uint64_t{1} << 30;      ///< of chunks that overlap in time, decompressed
    std::uint64_t max_index_entries = std::uint64_t{64} << 20;  ///< messages that stand outside of chunks
};

/// A record as it lies in the file. Its content is valid until the next call of the reader.
struct record {
    static constexpr std::uint64_t outside = std::numeric_limits<std::uint64_t>::max();

    opcode op{};
    bytes_view content;
    std::uint64_t offset = 0;         ///< in the file; of its chunk, if it is in one
    std::uint64_t in_chunk = outside; ///< in the decompressed chunk; `outside`: it is in none
};

/// Reads the records of a file one after another, from its beginning, without its index. Used by one thread at a time.
/// All failures name the file, the offset and the record; errc::malformed for damage, errc::too_large for a limit.
class record_reader {
public:
    /// `from` must outlive the reader. `at`: where the first record begins; 0: after the magic bytes, which are
    /// checked.
    explicit record_reader(source& from, reader_limits limits = reader_limits(), std::uint64_t at = 0);

    /// Whether records of chunks are returned one by one (default), or chunks whole.
    void expand_chunks(bool on) noexcept { expand_ = on; }
    /// Continues after a chunk whose content is damaged, instead of failing; `skipped` gets what was wrong. Records
    /// that could be decompressed before the damage are returned.
    void skip_damaged_chunks(std::function<void(const failure&)> skipped) { skipped_ = std::move(skipped); }

    /// The next record; nothing after the Footer and the magic bytes behind it.
    result<std::optional<record>> next();
    /// Where the next record of the file begins.
    std::uint64_t offset() const noexcept { return at_; }

private:
    result<void> load(std::uint64_t from, std::size_t count);
    result<std::optional<record>> next_in_file();
    result<void> open_chunk(const record& chunk);
    result<std::optional<record>> next_in_chunk();
    failure wrong(errc code, std::uint64_t at, const std::string& what) const;

    source& from_;
    reader_limits limits_;
    std::function<void(const failure&)> skipped_;
    bool expand_ = true;
    bool ended_ = false;
    bool after_footer_ = false;
    std::uint64_t at_ = 0;
    bytes window_; // of the file, from window_at_ on
    std::uint64_t window_at_ = 0;
    buffer chunk_;
    std::uint64_t chunk_at_ = 0;
    std::size_t chunk_next_ = 0;
    std::optional<failure> chunk_trouble_;
};

/// What a file has, from its summary, or from all of its records where it has none.
struct summary {
    header_record header;
    std::map<std::uint16_t, schema_record> schemas;
    std::map<std::uint16_t, channel_record> channels;
    statistics_record statistics; ///< counted, where the file has none
    std::vector<chunk_index_record> chunks;
    std::vector<attachment_index_record> attachments;
    std::vector<metadata_index_record> metadata;
    /// Messages that stand outside of chunks; only where the file had to be read whole.
    std::vector<message_index_record::entry> loose;
    std::uint64_t file_bytes = 0;
    bool complete = false;         ///< it ends as it should: it was closed
    bool indexed = false;          ///< read from its summary
    std::optional<failure> damage; ///< the first, if it had to be read whole: what comes before is described here
    std::uint64_t good_bytes = 0;  ///< of the file, before the damage
};

/// How much of a file is read for its summary.
enum class depth : std::uint8_t {
    index, ///< its summary; all of it only where it has none
    whole, ///< all records, with all CRCs
};

/// Describes a file. Fails only if it is not an MCAP file or cannot be read; damage is described in the summary.
result<summary> read_summary(source& from, depth how = depth::index, const reader_limits& limits = reader_limits());

/// Which messages are read.
struct message_filter {
    timestamp from = 0;                                      ///< log time
    timestamp until = std::numeric_limits<timestamp>::max(); ///< log time, exclusive
    std::function<bool(const channel_record&)> wanted;       ///< empty: all channels
};

/// Reads messages by log time; those of equal times in the order of the file. Memory: the chunks that overlap in time.
/// Used by one thread at a time.
class message_reader {
public:
    /// `from` and `about` must outlive the reader.
    message_reader(source& from, const summary& about, message_filter filter = message_filter(),
                   reader_limits limits = reader_limits());
    ~message_reader();
    message_reader(message_reader&&) noexcept;
    message_reader& operator=(message_reader&&) noexcept;

    /// The next message, whose data is valid until the next call; nothing at the end. Failures name the file, the
    /// chunk's offset and the channel.
    result<std::optional<message_record>> next();

private:
    struct state;
    std::unique_ptr<state> state_;
};

/// Reads one attachment; its name, type and data, which are its own. Checks its CRC.
struct attachment {
    timestamp log_time = 0;
    timestamp create_time = 0;
    std::string name;
    std::string media_type;
    bytes data;
};
result<attachment> read_attachment(source& from, const attachment_index_record& where,
                                   const reader_limits& limits = reader_limits()); ///< see above
/// Reads one metadata record.
result<metadata_record> read_metadata(source& from, const metadata_index_record& where,
                                      const reader_limits& limits = reader_limits());

} // namespace ise::bag
