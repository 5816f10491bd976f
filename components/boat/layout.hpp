#pragma once
#include <components/boat/enums.hpp>
#include <components/boat/packet_header.hpp>

#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <cmath>
#include <limits>
#include <string>
#include <string_view>

/// How fields lie in a packet: little-endian, fixed, scaled integers. Private to this folder.
namespace atirma::layout {

inline constexpr std::uint8_t version = 1;
inline constexpr std::size_t header_size = 14;
inline constexpr std::size_t checksum_size = 2;
/// 2200-01-01. The 48 bits of a time reach further than nanoseconds in 64 bits, which clocks count with.
inline constexpr std::uint64_t last_time_ms = 7'258'118'400'000;

/// First bodies of a class of packets.
enum : std::uint8_t {
    first_telemetry = 0x01,
    last_telemetry = 0x3F,
    telecommand_type = 0x40,
    acknowledgement_type = 0x41,
    authorised_type = 0x42,
    authorised_acknowledgement_type = 0x43,
    receipt_type = 0x44,
    limited_type = 0x45
};

/// CRC-16/CCITT (polynomial 0x1021, initial value 0xFFFF, not reflected, no final XOR; "123456789" gives 0x29B1).
std::uint16_t crc16(ise::bytes_view raw) noexcept;

class writer {
public:
    writer(std::uint8_t type, const packet_header& header);

    template <class U>
    void integer(U value) {
        auto bits = static_cast<std::uint64_t>(value);
        for (std::size_t i = 0; i < sizeof(U); ++i) out_.push_back(static_cast<std::byte>((bits >> (8 * i)) & 0xFF));
    }
    template <class E>
    void enumerator(E value) {
        integer(static_cast<std::uint8_t>(value));
    }

    /// `value` in steps of `step`, rounded and clamped; not finite is 0.
    template <class U>
    void scaled(double value, double step) {
        if (!std::isfinite(value)) value = 0;
        double steps = std::round(value / step);
        double low = static_cast<double>(std::numeric_limits<U>::min()),
               high = static_cast<double>(std::numeric_limits<U>::max());
        integer(static_cast<U>(steps < low ? low : steps > high ? high : steps));
    }
    /// A direction in hundredths of a degree, 0 … 35999.
    void direction(double degrees);
    void real(float value);
    void point(const waypoint& p);
    /// Length byte and text, cut to `most` bytes on a character's boundary.
    void text(std::string_view value, std::size_t most);

    /// The whole packet with its checksum.
    ise::bytes finish();

private:
    ise::bytes out_;
};

class reader {
public:
    /// Checks length, checksum and version; `ok()` tells. The header is read.
    explicit reader(ise::bytes_view raw);

    std::uint8_t type = 0;
    packet_header header;

    template <class U>
    U integer() {
        std::uint64_t bits = 0;
        if (!need(sizeof(U))) return U{};
        for (std::size_t i = 0; i < sizeof(U); ++i) bits |= std::to_integer<std::uint64_t>(rest_[i]) << (8 * i);
        rest_ = rest_.subspan(sizeof(U));
        return static_cast<U>(bits);
    }
    /// Kept as a number even without a name.
    template <class E>
    E any_enumerator() {
        return static_cast<E>(integer<std::uint8_t>());
    }
    /// Refused without a name.
    template <class E>
    E enumerator(std::string_view field) {
        auto value = any_enumerator<E>();
        if (ok() && !is_known(value)) bad_number(field, static_cast<unsigned>(value));
        return value;
    }
    template <class U>
    double scaled(double step) {
        return static_cast<double>(integer<U>()) * step;
    }
    double direction(std::string_view field);
    float real(std::string_view field);
    waypoint point(std::string_view field);
    std::string text(std::size_t most);

    void fail(std::string what);
    bool ok() const noexcept { return failed_.empty(); }
    /// Also refuses what is left over.
    ise::result<void> finish();

private:
    bool need(std::size_t size);
    void bad_number(std::string_view field, unsigned value);

    ise::bytes_view rest_;
    std::string failed_;
};

} // namespace atirma::layout
