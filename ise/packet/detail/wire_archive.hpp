#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/error.hpp>
#include <ise/packet/limits.hpp>

#include <cstdint>
#include <limits>
#include <memory>
#include <string>
#include <string_view>

/// The two halves of ISE's wire archive. All packets are encoded and decoded by them; `codec` tells them how each type
/// is passed. <ise/packet/archive.hpp> makes cereal archives of them, for types with cereal functions of their own: to
/// construct a cereal archive costs more than to encode a small packet.
namespace ise::detail {

/// Writes values to the end of a buffer, as LAYOUT.md defines. It only names the buffer: pass it by value.
class writer {
public:
    explicit writer(buffer& out) noexcept : out_(&out) {}

    template <class... T>
    writer operator()(const T&... values) const {
        (write(values), ...);
        return *this;
    }

    /// The number of elements that follow. Throws `too_large` for 2^32.
    void put_count(std::size_t count) const {
        if (count > std::numeric_limits<std::uint32_t>::max()) [[unlikely]]
            fail_count(count);
        out_->append(static_cast<std::uint32_t>(count));
    }
    void put_raw(bytes_view raw) const { out_->append(raw); }
    buffer& out() const noexcept { return *out_; }

    [[noreturn]] static void fail_count(std::size_t count);
    [[noreturn]] static void fail_valueless();

private:
    template <class T>
    void write(const T& value) const;

    buffer* out_;
};

/// Reads values out of bounded bytes, as LAYOUT.md defines. A read that fails says why once (`fail`), returns false,
/// and every level on the way out puts its piece of the path in front: nothing is paid for the path until something is
/// wrong.
class reader {
public:
    reader(bytes_view input, const decode_limits& limits) noexcept
        : at_(input.data()), left_(input.size()), budget_(limits.max_total_bytes),
          zero_size_budget_(limits.max_zero_size_elements), depth_left_(limits.max_depth), limits_(&limits) {}

    /// Reads one value. False where it cannot: `take_failure` tells why.
    template <class T>
    bool operator()(T& value);

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
    /// The first failure; it stays.
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
