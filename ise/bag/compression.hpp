#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <memory>
#include <string_view>

namespace ise::bag {

/// How chunks are compressed.
enum class compression : std::uint8_t { none, lz4, zstd };

/// "", "lz4", "zstd", as in a file.
std::string_view name_of(compression kind) noexcept;
/// errc::malformed for a compression that is not known.
result<compression> compression_named(std::string_view name);

/// CRC-32 as the format uses it, of `data` after what `before` is the CRC of.
std::uint32_t crc32(bytes_view data, std::uint32_t before = 0) noexcept;

/// Compresses chunks, one after another; keeps its memory between them. Used by one thread at a time.
class compressor {
public:
    /// `level` of zstd: 1 is the fastest.
    explicit compressor(compression kind, int level = 1);
    ~compressor();
    compressor(compressor&&) noexcept;
    compressor& operator=(compressor&&) noexcept;

    compression kind() const noexcept { return kind_; }
    /// Appends the compressed `data` to `to`. Throws errc::io_failed if the library has no memory.
    void compress(bytes_view data, buffer& to);

private:
    struct state;
    std::unique_ptr<state> state_;
    compression kind_;
    int level_;
};

/// Decompresses exactly `size` bytes into `to` (cleared first). Memory grows with what was really decompressed, and
/// never beyond `size`, which the caller has bounded. errc::malformed if the data is damaged, or decompresses to more
/// or less. Then `to` has what could be decompressed before.
result<void> decompress(compression kind, bytes_view data, std::size_t size, buffer& to);

} // namespace ise::bag
