#pragma once
#include <ise/core/bytes.hpp>

#include <algorithm>
#include <cstdint>

/// What a fuzz target is to do: takes the input a few bytes at a time; zeros at its end.
struct fuzz_input {
    ise::bytes_view left;

    std::uint8_t next() {
        if (left.empty()) return 0;
        auto value = static_cast<std::uint8_t>(left[0]);
        left = left.subspan(1);
        return value;
    }
    /// Of so many bytes, little-endian.
    std::uint64_t number(int count) {
        std::uint64_t value = 0;
        for (int i = 0; i < count; ++i) value |= std::uint64_t{next()} << (8 * i);
        return value;
    }
    /// Fewer at the end.
    ise::bytes_view raw(std::size_t count) {
        auto taken = left.first(std::min(count, left.size()));
        left = left.subspan(taken.size());
        return taken;
    }
};
