#pragma once
#include <ise/core/time.hpp>

#include <cstdint>
#include <deque>
#include <string>
#include <string_view>
#include <vector>

namespace ise::sim {

/// What happened in a virtual world, with its time. The hash covers every entry, so that two runs can be
/// compared; only the newest entries are kept for reading.
class trace {
public:
    /// One thing that happened.
    struct entry {
        time_point at;         ///< virtual
        std::string_view kind; ///< "connect", "deliver", "drop", ... (a literal)
        std::string subject;   ///< whom it happened to: "boat:49152->shore:7400"
        std::uint64_t amount;  ///< bytes, or 0
    };

    static constexpr std::size_t kept_entries = 4096; ///< for reading

    /// Adds an entry.
    void note(time_point at, std::string_view kind, std::string_view subject, std::uint64_t amount = 0);

    /// Over all entries so far: equal runs have equal hashes.
    std::uint64_t hash() const noexcept { return hash_; }
    /// Entries so far.
    std::uint64_t count() const noexcept { return count_; }
    /// The newest of them, oldest first.
    const std::deque<entry>& newest() const noexcept { return newest_; }

    /// One line an entry, seconds since the world began.
    std::string text() const;

private:
    void mix(const void* data, std::size_t size) noexcept;
    void mix(std::uint64_t value) noexcept;

    std::deque<entry> newest_;
    std::uint64_t hash_ = 0xCBF29CE484222325u;
    std::uint64_t count_ = 0;
};

} // namespace ise::sim
