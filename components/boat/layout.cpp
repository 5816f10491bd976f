#include <components/boat/layout.hpp>

#include <fmt/format.h>

#include <bit>

namespace atirma::layout {

std::uint16_t crc16(ise::bytes_view raw) noexcept {
    unsigned crc = 0xFFFF;
    for (std::byte b : raw) {
        crc ^= std::to_integer<unsigned>(b) << 8;
        for (int bit = 0; bit < 8; ++bit) crc = (crc & 0x8000) ? (crc << 1) ^ 0x1021 : crc << 1;
        crc &= 0xFFFF;
    }
    return static_cast<std::uint16_t>(crc);
}

writer::writer(std::uint8_t type, const packet_header& header) {
    out_.reserve(max_packet_size);
    integer(version);
    integer(type);
    integer(header.boot);
    integer(header.sequence);
    auto ms = header.measured_at.time_since_epoch().count();
    auto bits = static_cast<std::uint64_t>(ms < 0 ? 0 : ms);
    integer(static_cast<std::uint32_t>(bits & 0xFFFFFFFF));
    integer(static_cast<std::uint16_t>((bits >> 32) & 0xFFFF));
}

void writer::direction(double degrees) {
    if (!std::isfinite(degrees)) degrees = 0;
    double turns = std::fmod(degrees, 360.0);
    auto steps = static_cast<long>(std::round(turns * 100));
    integer(static_cast<std::uint16_t>((steps + 36000) % 36000));
}

void writer::real(float value) { integer(std::bit_cast<std::uint32_t>(std::isfinite(value) ? value : 0.0f)); }

void writer::point(const waypoint& p) {
    scaled<std::int32_t>(p.latitude_deg, 1e-7);
    scaled<std::int32_t>(p.longitude_deg, 1e-7);
}

void writer::text(std::string_view value, std::size_t most) {
    if (value.size() > most) {
        while (most > 0 && (static_cast<unsigned char>(value[most]) & 0xC0) == 0x80) --most; // never half a character
        value = value.substr(0, most);
    }
    integer(static_cast<std::uint8_t>(value.size()));
    auto raw = ise::as_bytes(value);
    out_.insert(out_.end(), raw.begin(), raw.end());
}

ise::bytes writer::finish() {
    integer(crc16(out_));
    return std::move(out_);
}

reader::reader(ise::bytes_view raw) {
    if (raw.size() < header_size + checksum_size || raw.size() > max_packet_size) {
        fail(fmt::format("a packet has {} to {} bytes, not {}", header_size + checksum_size, max_packet_size,
                         raw.size()));
        return;
    }
    auto body = raw.first(raw.size() - checksum_size);
    rest_ = raw.last(checksum_size);
    auto stated = integer<std::uint16_t>();
    auto computed = crc16(body);
    if (stated != computed) {
        fail(fmt::format("the checksum is {:04X}, the bytes give {:04X}", stated, computed));
        return;
    }
    rest_ = body;
    auto in_version = integer<std::uint8_t>();
    if (in_version != version) {
        fail(fmt::format("a packet of format version {}; this program reads version {}", in_version, version));
        return;
    }
    type = integer<std::uint8_t>();
    header.boot = integer<std::uint16_t>();
    header.sequence = integer<std::uint32_t>();
    std::uint64_t low = integer<std::uint32_t>();
    std::uint64_t high = integer<std::uint16_t>();
    auto ms = low | (high << 32);
    if (ms > last_time_ms) {
        fail("a time after 2200");
        return;
    }
    header.measured_at = utc_time(std::chrono::milliseconds(static_cast<std::int64_t>(ms)));
}

double reader::direction(std::string_view field) {
    auto steps = integer<std::uint16_t>();
    if (ok() && steps >= 36000) bad_number(field, steps);
    return steps / 100.0;
}

float reader::real(std::string_view field) {
    auto value = std::bit_cast<float>(integer<std::uint32_t>());
    if (ok() && !std::isfinite(value)) fail(fmt::format("{} is not a number", field));
    return value;
}

waypoint reader::point(std::string_view field) {
    auto latitude = integer<std::int32_t>();
    auto longitude = integer<std::int32_t>();
    waypoint p{latitude / 1e7, longitude / 1e7};
    if (ok() && (std::abs(p.latitude_deg) > 90 || std::abs(p.longitude_deg) > 180))
        fail(fmt::format("{} {:.5f}, {:.5f} is not on the globe", field, p.latitude_deg, p.longitude_deg));
    return p;
}

std::string reader::text(std::size_t most) {
    std::size_t size = integer<std::uint8_t>();
    if (size > most) fail(fmt::format("a text of {} bytes; {} are possible", size, most));
    if (!need(size)) return {};
    std::string out(ise::as_text(rest_.first(size)));
    rest_ = rest_.subspan(size);
    return out;
}

void reader::fail(std::string what) {
    if (ok()) failed_ = std::move(what);
    rest_ = {};
}

ise::result<void> reader::finish() {
    if (ok() && !rest_.empty()) fail(fmt::format("{} bytes too many for a packet of type {:02X}", rest_.size(), type));
    if (!ok()) return ise::failure(ise::errc::malformed, failed_);
    return {};
}

bool reader::need(std::size_t size) {
    if (!ok()) return false;
    if (rest_.size() < size) return fail(fmt::format("too short for a packet of type {:02X}", type)), false;
    return true;
}

void reader::bad_number(std::string_view field, unsigned value) { fail(fmt::format("{} cannot be {}", field, value)); }

} // namespace atirma::layout
