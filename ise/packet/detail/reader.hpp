#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/error.hpp>
#include <ise/packet/limits.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace ise::detail {

/// Bytes to decode, bounded. A read that fails says why once (`fail`), returns false, and every level on the way out
/// puts its piece of the path in front: nothing is paid for the path until something is wrong.
class reader {
public:
    reader(bytes_view input, const decode_limits& limits) noexcept
        : at_(input.data()), left_(input.size()), budget_(limits.max_total_bytes),
          zero_size_budget_(limits.max_zero_size_elements), depth_left_(limits.max_depth), limits_(&limits) {}

    std::size_t left() const noexcept { return left_; }
    /// The next byte; only what `left()` allows may be read behind it.
    const std::byte* here() const noexcept { return at_; }

    /// `count` bytes, or nullptr when fewer are left.
    const std::byte* take(std::size_t count) noexcept {
        if (left_ < count) [[unlikely]]
            return nullptr;
        const std::byte* taken = at_;
        at_ += count;
        left_ -= count;
        return taken;
    }

    /// Reads the number of elements and checks it against the bytes that are left before anything is allocated.
    bool take_count(std::size_t& count, std::size_t min_element_size, std::size_t element_memory,
                    std::string_view unit = "elements") {
        const std::byte* raw = take(sizeof(std::uint32_t));
        if (!raw) [[unlikely]]
            return fail_short(sizeof(std::uint32_t));
        count = 0;
        for (unsigned i = 0; i < 4; ++i) count |= std::to_integer<std::size_t>(raw[i]) << (8 * i);
        return accept_count(count, min_element_size, element_memory, unit);
    }
    bool accept_count(std::uint64_t count, std::size_t min_element_size, std::size_t element_memory,
                      std::string_view unit);

    bool enter();
    void leave() noexcept { ++depth_left_; }

    bool fail(std::string text, errc code = errc::malformed);
    bool fail_short(std::size_t needed);
    bool fail_flag(std::string_view what, unsigned value);
    bool fail_alternative(std::size_t index, std::size_t count);
    bool in_field(std::string_view name);
    bool in_element(std::size_t index);
    bool in_alternative(std::size_t index);

    bool failed() const noexcept { return trouble_ && !trouble_->text.empty(); }
    failure take_failure(std::string_view type);
    /// After the last field.
    bool finish() { return left_ == 0 || fail_surplus(); }

private:
    bool fail_surplus();
    bool in(const std::string& part);
    struct trouble {
        errc code = errc::malformed;
        std::string text;
        std::string path;
    };
    trouble& what();

    const std::byte* at_;
    std::size_t left_;
    std::size_t budget_;
    std::size_t zero_size_budget_;
    std::size_t depth_left_;
    const decode_limits* limits_;
    std::unique_ptr<trouble> trouble_; // made when something is wrong
};

} // namespace ise::detail
