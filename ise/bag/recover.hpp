#pragma once
#include <ise/bag/reader.hpp>
#include <ise/bag/writer.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <optional>
#include <vector>

namespace ise::bag {

/// What was recovered of a damaged file.
struct recovery {
    std::uint64_t messages = 0;
    std::uint64_t attachments = 0;
    std::uint64_t metadata = 0;
    std::uint64_t left_out = 0;   ///< messages whose channel was described in a damaged part only
    std::uint64_t file_bytes = 0; ///< of the damaged file
    bool complete = false;        ///< nothing was wrong
    std::optional<failure> end;   ///< why nothing was read after a certain byte
    /// Of which only the beginning, or nothing, was recovered; and the first schema or channel without room
    /// (`max_schema_bytes`), which are left out.
    std::vector<failure> damaged_chunks;
};

/// Copies every whole record of a file that was cut at any byte, or of which parts are damaged, to `to`, and closes it.
/// Also from the last chunk, if it was cut, what can be decompressed. A channel whose description is damaged is taken
/// from the summary at the end of the file, where there is one. Fails if `from` is no MCAP file, or `to` cannot
/// be written.
result<recovery> recover(source& from, writer& to, const reader_limits& limits = reader_limits());

} // namespace ise::bag
