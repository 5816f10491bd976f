#include <components/iridium/directip.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace atirma::iridium {
namespace {

enum element : std::uint8_t {
    mo_header = 0x01,
    mo_payload = 0x02,
    mo_location = 0x03,
    mo_confirmed = 0x05,
    mt_header = 0x41,
    mt_payload = 0x42,
    mt_confirmed = 0x44,
};

ise::failure malformed(std::string what) { return ise::failure(ise::errc::malformed, "DirectIP: " + std::move(what)); }

class reader {
public:
    explicit reader(ise::bytes_view rest) : rest_(rest) {}
    template <class U>
    U integer() {
        std::uint64_t value = 0;
        for (auto b : take(sizeof(U))) value = value << 8 | std::to_integer<std::uint64_t>(b);
        return static_cast<U>(value);
    }
    ise::bytes_view take(std::size_t count) {
        short_ = short_ || count > rest_.size();
        auto now = rest_.first(short_ ? 0 : count);
        rest_ = rest_.subspan(now.size());
        return now;
    }
    bool empty() const noexcept { return rest_.empty(); }
    bool too_short() const noexcept { return short_; }

private:
    ise::bytes_view rest_;
    bool short_ = false;
};

class writer {
public:
    template <class U>
    writer& integer(U value) {
        auto bits = static_cast<std::uint64_t>(value);
        for (std::size_t i = sizeof(U); i-- > 0;) out_.push_back(static_cast<std::byte>(bits >> (8 * i) & 0xFF));
        return *this;
    }
    writer& raw(ise::bytes_view more) {
        out_.insert(out_.end(), more.begin(), more.end());
        return *this;
    }
    writer& begin(std::uint8_t id, std::size_t size) { return integer(id).integer(static_cast<std::uint16_t>(size)); }
    ise::bytes finish() {
        auto body = std::move(out_);
        out_.clear();
        begin(1, body.size()).raw(body);
        return std::move(out_);
    }

private:
    ise::bytes out_;
};

/// Calls `on_element(id, content)` for each; it says what is wrong, or nothing.
template <class OnElement>
ise::result<void> each_element(ise::bytes_view whole, OnElement on_element) {
    auto length = directip_length(whole);
    if (!length) return length.error();
    if (!*length || **length != whole.size())
        return malformed(*length ? fmt::format("{} bytes, its length says {}", whole.size(), **length)
                                 : fmt::format("{} bytes are no message", whole.size()));
    reader in(whole.subspan(directip_prefix));
    while (!in.empty()) {
        auto id = in.integer<std::uint8_t>();
        auto size = in.integer<std::uint16_t>();
        auto content = in.take(size);
        if (in.too_short()) return malformed(fmt::format("element {:02X} of {} bytes is cut off", id, size));
        std::string wrong = on_element(id, content);
        if (!wrong.empty()) return malformed(std::move(wrong));
    }
    return {};
}

template <std::size_t N>
void copy_to(std::array<std::byte, N>& into, ise::bytes_view from) {
    std::copy_n(from.begin(), std::min(N, from.size()), into.begin());
}

std::string wrong_size(const char* what, std::size_t is, std::size_t wanted) {
    return fmt::format("{} of {} bytes instead of {}", what, is, wanted);
}

} // namespace

ise::result<std::optional<std::size_t>> directip_length(ise::bytes_view begin) {
    if (!begin.empty() && begin[0] != std::byte{1})
        return malformed(fmt::format("revision {:02X} is not 01", std::to_integer<unsigned>(begin[0])));
    if (begin.size() < directip_prefix) return std::optional<std::size_t>();
    auto size = directip_prefix + std::to_integer<std::size_t>(begin[1]) * 256 + std::to_integer<std::size_t>(begin[2]);
    if (size > max_directip_bytes)
        return ise::failure(ise::errc::too_large,
                            fmt::format("DirectIP: {} bytes, {} at most", size, max_directip_bytes));
    return std::optional<std::size_t>(size);
}

ise::result<mo_message> parse_directip_mo(ise::bytes_view whole) {
    mo_message out;
    bool header = false, payload = false;
    auto read = each_element(whole, [&](std::uint8_t id, ise::bytes_view content) -> std::string {
        reader in(content);
        switch (id) {
            case mo_header: {
                if (header) return "two headers";
                if (content.size() != 28) return wrong_size("an MO header", content.size(), 28);
                header = true;
                out.cdr = in.integer<std::uint32_t>();
                out.imei = ise::as_text(in.take(15));
                out.session_status = in.integer<std::uint8_t>();
                out.momsn = in.integer<std::uint16_t>();
                out.mtmsn = in.integer<std::uint16_t>();
                out.session_time = std::chrono::sys_seconds(std::chrono::seconds(in.integer<std::uint32_t>()));
                auto good = check_imei(out.imei);
                return good ? std::string() : good.error().message();
            }
            case mo_payload:
                if (payload) return "two payloads";
                if (content.size() > max_directip_payload)
                    return fmt::format("a payload of {} bytes, {} at most", content.size(), max_directip_payload);
                payload = true;
                out.data.assign(content.begin(), content.end());
                return {};
            case mo_location: {
                if (content.size() != 11) return wrong_size("a location", content.size(), 11);
                auto flags = in.integer<std::uint8_t>();
                auto degrees = [&in] {
                    double whole_degrees = in.integer<std::uint8_t>();
                    return whole_degrees + in.integer<std::uint16_t>() / 60000.0;
                };
                estimate where;
                where.latitude_deg = degrees() * (flags & 2 ? -1 : 1);
                where.longitude_deg = degrees() * (flags & 1 ? -1 : 1);
                where.cep_km = in.integer<std::uint32_t>();
                if (std::abs(where.latitude_deg) > 90 || std::abs(where.longitude_deg) > 180)
                    return "a location that is not on the globe";
                out.where = where;
                return {};
            }
            default: return {};
        }
    });
    if (!read) return read.error();
    if (!header) return malformed("an MO message without a header");
    return out;
}

ise::bytes encode_directip_mo(const mo_message& what) {
    writer out;
    auto imei = imei_bytes(what.imei);
    out.begin(mo_header, 28)
        .integer(what.cdr.value_or(0))
        .raw(imei)
        .integer(what.session_status)
        .integer(what.momsn)
        .integer(what.mtmsn);
    out.integer(static_cast<std::uint32_t>(what.session_time.time_since_epoch().count()));
    if (what.where) {
        auto parts = [&out](double degrees) {
            auto thousandths = static_cast<std::uint32_t>(std::lround(std::abs(degrees) * 60000));
            out.integer(static_cast<std::uint8_t>(thousandths / 60000))
                .integer(static_cast<std::uint16_t>(thousandths % 60000));
        };
        out.begin(mo_location, 11)
            .integer(static_cast<std::uint8_t>((what.where->latitude_deg < 0 ? 2 : 0) |
                                               (what.where->longitude_deg < 0 ? 1 : 0)));
        parts(what.where->latitude_deg);
        parts(what.where->longitude_deg);
        out.integer(static_cast<std::uint32_t>(std::lround(std::clamp(what.where->cep_km, 0.0, 4e9))));
    }
    if (!what.data.empty()) out.begin(mo_payload, what.data.size()).raw(what.data);
    return out.finish();
}

ise::bytes encode_mo_confirmation(bool success) {
    writer out;
    out.begin(mo_confirmed, 1).integer(static_cast<std::uint8_t>(success ? 1 : 0));
    return out.finish();
}

ise::result<bool> parse_mo_confirmation(ise::bytes_view whole) {
    std::optional<bool> outcome;
    auto read = each_element(whole, [&](std::uint8_t id, ise::bytes_view content) -> std::string {
        if (id != mo_confirmed) return {};
        if (content.size() != 1) return wrong_size("an MO confirmation", content.size(), 1);
        outcome = content[0] == std::byte{1};
        return {};
    });
    if (!read) return read.error();
    if (!outcome) return malformed("no MO confirmation in it");
    return *outcome;
}

std::array<std::byte, 15> imei_bytes(std::string_view imei) noexcept {
    std::array<std::byte, 15> out{};
    copy_to(out, ise::as_bytes(imei));
    return out;
}

std::string imei_text(const std::array<std::byte, 15>& raw) { return std::string(ise::as_text(raw)); }

ise::result<directip_mt> parse_directip_mt(ise::bytes_view whole) {
    directip_mt out;
    bool header = false, payload = false;
    auto read = each_element(whole, [&](std::uint8_t id, ise::bytes_view content) -> std::string {
        reader in(content);
        if (id == mt_header) {
            if (header) return "two headers";
            if (content.size() != 21) return wrong_size("an MT header", content.size(), 21);
            header = true;
            out.client_id = in.integer<std::uint32_t>();
            copy_to(out.imei, in.take(15));
            out.flags = in.integer<std::uint16_t>();
        } else if (id == mt_payload) {
            if (payload) return "two payloads";
            if (content.size() > max_directip_payload)
                return fmt::format("a payload of {} bytes, {} at most", content.size(), max_directip_payload);
            payload = true;
            out.payload.assign(content.begin(), content.end());
        }
        return {};
    });
    if (!read) return read.error();
    if (!header) return malformed("an MT message without a header");
    return out;
}

ise::bytes encode_directip_mt(const directip_mt& what) {
    writer out;
    out.begin(mt_header, 21).integer(what.client_id).raw(what.imei).integer(what.flags);
    if (!what.payload.empty()) out.begin(mt_payload, what.payload.size()).raw(what.payload);
    return out.finish();
}

ise::result<mt_confirmation> parse_mt_confirmation(ise::bytes_view whole) {
    std::optional<mt_confirmation> outcome;
    auto read = each_element(whole, [&](std::uint8_t id, ise::bytes_view content) -> std::string {
        if (id != mt_confirmed) return {};
        if (content.size() != 25) return wrong_size("an MT confirmation", content.size(), 25);
        reader in(content);
        mt_confirmation made;
        made.client_id = in.integer<std::uint32_t>();
        copy_to(made.imei, in.take(15));
        made.auto_id = in.integer<std::uint32_t>();
        made.status = static_cast<std::int16_t>(in.integer<std::uint16_t>());
        outcome = made;
        return {};
    });
    if (!read) return read.error();
    if (!outcome) return malformed("no MT confirmation in it");
    return *outcome;
}

ise::bytes encode_mt_confirmation(const mt_confirmation& what) {
    writer out;
    out.begin(mt_confirmed, 25)
        .integer(what.client_id)
        .raw(what.imei)
        .integer(what.auto_id)
        .integer(static_cast<std::uint16_t>(what.status));
    return out.finish();
}

std::string_view explain_mt_status(int status) noexcept {
    if (status >= 1 && status <= 50) return "queued";
    switch (status) {
        case 0: return "taken; it had no payload";
        case -1: return "the IMEI is not 15 digits";
        case -2: return "the gateway knows no modem of this IMEI";
        case -3: return "the payload is too large";
        case -4: return "a payload was expected and there was none";
        case -5: return "the queue of the modem is full";
        case -6: return "the gateway's resources are not available";
        case -7: return "the message broke the protocol";
        case -8: return "ring alerts to this modem are disabled";
        case -9: return "the modem is not attached";
        case -10: return "the gateway refuses this sender's address";
        case -11: return "the MTMSN is out of range";
        default: return "a status that is not documented";
    }
}

bool mt_status_passes(int status) noexcept { return status == -5 || status == -6 || status == -9 || status < -11; }

} // namespace atirma::iridium
