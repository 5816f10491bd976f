#pragma once
#include <ise/bag/compression.hpp>
#include <ise/bag/file.hpp>
#include <ise/bag/records.hpp>
#include <ise/core/buffer.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

namespace ise::bag {

/// How a file is written. The default is what `ise record` writes.
struct writer_options {
    std::string profile = "ise";
    std::string library = "ise";
    compression packing = compression::zstd;
    int level = 1;                                      ///< of zstd
    std::size_t chunk_bytes = std::size_t{1} << 20;     ///< a chunk is written when it has so many
    bool chunks = true;                                 ///< false: messages stand alone and have no index
    bool message_index = true;                          ///< after each chunk
    bool chunk_index = true, attachment_index = true;   ///< in the summary
    bool metadata_index = true, statistics = true;      ///< the same
    bool repeat_schemas = true, repeat_channels = true; ///< in the summary
    bool summary_offsets = true;
    bool crc = true;  ///< of chunks
    bool pad = false; ///< for the conformance suite: records have bytes of a later version
};

/// Writes one file. Every function that writes returns the failure of the sink; after one, nothing more is written.
/// Used by one thread at a time. A file whose writer was not closed has no summary and is recovered by `recover`.
class writer {
public:
    /// Writes the head of the file.
    static result<writer> make(std::unique_ptr<sink> to, writer_options options = writer_options());
    writer(writer&&) noexcept;
    writer& operator=(writer&&) noexcept;
    ~writer();

    /// Adds a schema and returns its id, from 1 on. The same name, encoding and data give the same id.
    /// errc::too_large beyond 65,535.
    result<std::uint16_t> add_schema(std::string name, std::string encoding, bytes_view data);
    /// Adds a channel and returns its id, from 0 on. errc::too_large beyond 65,536.
    result<std::uint16_t> add_channel(std::uint16_t schema_id, std::string topic, std::string message_encoding,
                                      string_map metadata = string_map());
    /// With the ids of another file, which must not be in use here.
    result<void> add(schema_record record);
    result<void> add(channel_record record); ///< see above

    /// Into the present chunk; the chunk is written when it is full. The channel must have been added.
    result<void> write(const message_record& message);
    /// Writes the present chunk, if there is one: all that came before is in the file.
    result<void> flush();
    /// Ends the present chunk first.
    result<void> attach(const attachment_record& attachment);
    result<void> write(const metadata_record& metadata); ///< as `attach`
    /// Writes the last chunk, the summary and the end. Once.
    result<void> close();
    /// Brings what was written to the disk.
    result<void> sync();

    /// Bytes written to the sink so far, and those in the present chunk.
    std::uint64_t bytes_written() const noexcept;
    std::uint64_t bytes_waiting() const noexcept;         ///< see above
    const statistics_record& statistics() const noexcept; ///< so far

private:
    struct state;
    explicit writer(std::unique_ptr<state> made) noexcept;
    std::unique_ptr<state> state_;
};

} // namespace ise::bag
