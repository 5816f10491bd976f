#pragma once
#include <ise/bag/file.hpp>
#include <ise/core/result.hpp>

#include <fmt/format.h>

#include <cstddef>
#include <cstdint>

namespace ise::bag {

/// The memory that the schemas and channels of one file may take (`reader_limits::max_schema_bytes`).
class schema_room {
public:
    /// `from` must outlive it.
    schema_room(const source& from, std::uint64_t limit) : from_(from), left_(limit), limit_(limit) {}

    /// Takes the bytes of a record at this place of the file; errc::too_large if there is no room.
    result<void> take(std::uint64_t at, std::size_t size) {
        if (size > left_)
            return failure(errc::too_large, fmt::format("{}: at byte {}: its schemas and channels have more than {} "
                                                        "bytes (max_schema_bytes)",
                                                        from_.name(), at, limit_));
        left_ -= size;
        return {};
    }

private:
    const source& from_;
    std::uint64_t left_, limit_;
};

} // namespace ise::bag
