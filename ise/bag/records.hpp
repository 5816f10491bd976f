#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <array>
#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

/// Files in the MCAP format (https://mcap.dev/spec): records, reader and writer.
namespace ise::bag {

/// The first and last bytes of a file.
inline constexpr std::array<unsigned char, 8> magic{0x89, 'M', 'C', 'A', 'P', '0', '\r', '\n'};
/// Bytes of a record before its content: opcode and length.
inline constexpr std::size_t record_head_bytes = 9;
/// Bytes of a Footer record, with its head.
inline constexpr std::size_t footer_bytes = record_head_bytes + 20;

/// The kind of a record. Readers skip those that they do not know.
enum class opcode : std::uint8_t {
    header = 0x01,
    footer = 0x02,
    schema = 0x03,
    channel = 0x04,
    message = 0x05,
    chunk = 0x06,
    message_index = 0x07,
    chunk_index = 0x08,
    attachment = 0x09,
    attachment_index = 0x0a,
    statistics = 0x0b,
    metadata = 0x0c,
    metadata_index = 0x0d,
    summary_offset = 0x0e,
    data_end = 0x0f,
};

/// "Chunk Index"; for opcodes without a name "record 0x42".
std::string name_of(opcode op);

/// Nanoseconds since 1970-01-01 UTC.
using timestamp = std::uint64_t;
/// Keys and values of users.
using string_map = std::map<std::string, std::string>;

struct header_record {
    std::string profile; ///< requirements on the fields of the file; ISE's is "ise"
    std::string library; ///< the program that wrote it
};

struct footer_record {
    std::uint64_t summary_start = 0;        ///< offset; 0: there is no summary
    std::uint64_t summary_offset_start = 0; ///< offset; 0: there is none
    std::uint32_t summary_crc = 0;          ///< 0: unknown
};

struct schema_record {
    std::uint16_t id = 0;
    std::string name;
    std::string encoding; ///< "protobuf"
    bytes data;           ///< for protobuf a FileDescriptorSet
};

struct channel_record {
    std::uint16_t id = 0;
    std::uint16_t schema_id = 0; ///< 0: none
    std::string topic;
    std::string message_encoding;
    string_map metadata;
};

struct message_record {
    std::uint16_t channel_id = 0;
    std::uint32_t sequence = 0;
    timestamp log_time = 0;
    timestamp publish_time = 0;
    bytes_view data; ///< borrowed
};

struct chunk_record {
    timestamp message_start_time = 0;
    timestamp message_end_time = 0;
    std::uint64_t uncompressed_size = 0;
    std::uint32_t uncompressed_crc = 0; ///< 0: unknown
    std::string compression;            ///< "", "lz4" or "zstd"
    bytes_view records;                 ///< compressed; borrowed
};

struct message_index_record {
    struct entry {
        timestamp log_time = 0;
        std::uint64_t offset = 0; ///< in the uncompressed chunk
    };
    std::uint16_t channel_id = 0;
    std::vector<entry> entries;
};

struct chunk_index_record {
    timestamp message_start_time = 0;
    timestamp message_end_time = 0;
    std::uint64_t chunk_start_offset = 0;
    std::uint64_t chunk_length = 0;
    std::map<std::uint16_t, std::uint64_t> message_index_offsets;
    std::uint64_t message_index_length = 0;
    std::string compression;
    std::uint64_t compressed_size = 0;
    std::uint64_t uncompressed_size = 0;
};

struct attachment_record {
    timestamp log_time = 0;
    timestamp create_time = 0;
    std::string name;
    std::string media_type;
    bytes_view data; ///< borrowed
};

struct attachment_index_record {
    std::uint64_t offset = 0;
    std::uint64_t length = 0;
    timestamp log_time = 0;
    timestamp create_time = 0;
    std::uint64_t data_size = 0;
    std::string name;
    std::string media_type;
};

struct metadata_record {
    std::string name;
    string_map metadata;
};

struct metadata_index_record {
    std::uint64_t offset = 0;
    std::uint64_t length = 0;
    std::string name;
};

struct statistics_record {
    std::uint64_t message_count = 0;
    std::uint16_t schema_count = 0;
    std::uint32_t channel_count = 0;
    std::uint32_t attachment_count = 0;
    std::uint32_t metadata_count = 0;
    std::uint32_t chunk_count = 0;
    timestamp message_start_time = 0;
    timestamp message_end_time = 0;
    std::map<std::uint16_t, std::uint64_t> channel_message_counts;
};

struct summary_offset_record {
    std::uint8_t group_opcode = 0;
    std::uint64_t group_start = 0;
    std::uint64_t group_length = 0;
};

struct data_end_record {
    std::uint32_t data_section_crc = 0; ///< 0: unknown
};

/// Reads the content of a record. Fails with `malformed`, naming the record and the field, if a field does not fit;
/// bytes after the last field are skipped, as the specification demands. Nothing is allocated that the content does
/// not hold. Views refer to `content`.
template <class Record>
result<Record> parse(bytes_view content);

template <>
result<header_record> parse(bytes_view content);
template <>
result<footer_record> parse(bytes_view content);
template <>
result<schema_record> parse(bytes_view content);
template <>
result<channel_record> parse(bytes_view content);
template <>
result<message_record> parse(bytes_view content);
template <>
result<chunk_record> parse(bytes_view content);
template <>
result<message_index_record> parse(bytes_view content);
template <>
result<chunk_index_record> parse(bytes_view content);
template <>
result<attachment_record> parse(bytes_view content);
template <>
result<attachment_index_record> parse(bytes_view content);
template <>
result<metadata_record> parse(bytes_view content);
template <>
result<metadata_index_record> parse(bytes_view content);
template <>
result<statistics_record> parse(bytes_view content);
template <>
result<summary_offset_record> parse(bytes_view content);
template <>
result<data_end_record> parse(bytes_view content);

/// Appends a record with its head. `pad` appends bytes of a later version of the format, which readers skip (for the
/// conformance suite); records that cannot be extended have none.
void append(buffer& to, const header_record& record, bool pad = false);
void append(buffer& to, const footer_record& record);                             ///< see above
void append(buffer& to, const schema_record& record, bool pad = false);           ///< see above
void append(buffer& to, const channel_record& record, bool pad = false);          ///< see above
void append(buffer& to, const message_record& record);                            ///< see above
void append(buffer& to, const message_index_record& record, bool pad = false);    ///< see above
void append(buffer& to, const chunk_index_record& record, bool pad = false);      ///< see above
void append(buffer& to, const attachment_index_record& record, bool pad = false); ///< see above
void append(buffer& to, const metadata_record& record, bool pad = false);         ///< see above
void append(buffer& to, const metadata_index_record& record, bool pad = false);   ///< see above
void append(buffer& to, const statistics_record& record, bool pad = false);       ///< see above
void append(buffer& to, const summary_offset_record& record, bool pad = false);   ///< see above
void append(buffer& to, const data_end_record& record);                           ///< see above
/// With the CRC of its fields. See above.
void append(buffer& to, const attachment_record& record, bool pad = false);
/// See above.
void append(buffer& to, const chunk_record& record);

} // namespace ise::bag
