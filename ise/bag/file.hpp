#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <cstdint>
#include <memory>
#include <span>
#include <string>

namespace ise::bag {

/// Bytes that can be read at any place, such as a file. Used by one thread at a time.
class source {
public:
    virtual ~source() = default;
    /// The name of the file, for messages.
    virtual const std::string& name() const noexcept = 0;
    /// Bytes in it now; a file that is being written grows.
    virtual result<std::uint64_t> size() = 0;
    /// Reads up to `into.size()` bytes from `offset` on; fewer only at the end. errc::io_failed.
    virtual result<std::size_t> read(std::uint64_t offset, std::span<std::byte> into) = 0;
};

/// Bytes that are written one after another. Used by one thread at a time.
class sink {
public:
    virtual ~sink() = default;
    /// The name of the file, for messages.
    virtual const std::string& name() const noexcept = 0;
    /// Writes all of `data`, or fails with errc::io_failed; a part may be in the file then.
    virtual result<void> write(bytes_view data) = 0;
    /// Brings everything to the disk.
    virtual result<void> sync() { return {}; }
};

/// Opens an existing file to read. errc::io_failed with the name and the cause.
result<std::unique_ptr<source>> open_file(const std::string& path);
/// Creates a file. errc::name_taken if it exists already; errc::io_failed with the name and the cause.
result<std::unique_ptr<sink>> create_file(const std::string& path);

/// Bytes in memory as a source; borrowed.
std::unique_ptr<source> memory_source(bytes_view data, std::string name = "memory");
/// Appends to `to`; borrowed.
std::unique_ptr<sink> memory_sink(bytes& to, std::string name = "memory");

} // namespace ise::bag
