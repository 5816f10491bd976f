#pragma once
#include <ise/wire/frame.hpp>

#include <cstdint>
#include <optional>

namespace ise::wire {

/// What stands before the packet in the body of a request (FORMAT.md, "Calls"). The header's flags say what of it is
/// there.
struct request_head {
    std::uint32_t service = 0; ///< the number that the caller introduced it with
    std::int64_t time_ns = 0;  ///< what remains; with `flag::until` when it is over, by the receiver's clock
    std::uint64_t trace = 0;   ///< its lower half; 0: none
    std::uint64_t parent = 0;  ///< in this trace
    std::uint64_t high = 0;    ///< the upper half of the trace; only where both sides have `feature::traces`
    std::uint64_t number = 0;  ///< outlives the session; 0: none

    /// The shortest one.
    static constexpr std::size_t min_size = 12;
    /// With these flags.
    static constexpr std::size_t size(std::uint8_t flags) noexcept {
        return min_size + (flags & flag::traced ? 16 : 0) + (is_wide(flags) ? 8 : 0) + (flags & flag::numbered ? 8 : 0);
    }

    /// Of those flags that say what is there.
    std::uint8_t flags() const noexcept {
        return static_cast<std::uint8_t>((trace != 0 ? flag::traced : 0) | (trace != 0 && high != 0 ? flag::wide : 0) |
                                         (number != 0 ? flag::numbered : 0));
    }
    void put(buffer& out) const {
        out.append(service);
        out.append(time_ns);
        if (trace != 0) {
            out.append(trace);
            out.append(parent);
            if (high != 0) out.append(high);
        }
        if (number != 0) out.append(number);
    }
    /// Nothing where the body is too short for what its flags say.
    static std::optional<request_head> read(std::uint8_t flags, bytes_view body) noexcept {
        if (body.size() < size(flags)) return std::nullopt;
        request_head head;
        const auto* at = body.data();
        head.service = detail::load_little<std::uint32_t>(at);
        head.time_ns = time_of(at);
        at += min_size;
        if (flags & flag::traced) {
            head.trace = detail::load_little<std::uint64_t>(at);
            head.parent = detail::load_little<std::uint64_t>(at + 8);
            at += 16;
        }
        if (is_wide(flags)) {
            head.high = detail::load_little<std::uint64_t>(at);
            at += 8;
        }
        if (flags & flag::numbered) head.number = detail::load_little<std::uint64_t>(at);
        return head;
    }

    /// The time alone, which is put in when the frame leaves.
    static std::int64_t time_of(const std::byte* body) noexcept {
        return detail::load_little<std::int64_t>(body + time_at);
    }
    static void set_time(std::byte* body, std::int64_t time_ns) noexcept {
        detail::store_little(body + time_at, time_ns);
    }

private:
    static constexpr bool is_wide(std::uint8_t flags) noexcept {
        return (flags & flag::traced) && (flags & flag::wide);
    }
    static constexpr std::size_t time_at = 4;
};

} // namespace ise::wire
