#include <components/gprs/line.hpp>

#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>

namespace atirma::gprs {
namespace {

constexpr std::size_t max_fields = 6;
constexpr std::int64_t last_second = 253'402'300'799; // of the year 9999

std::uint8_t checksum(std::string_view text) noexcept {
    std::uint8_t sum = 0;
    for (char c : text) sum = static_cast<std::uint8_t>(sum ^ static_cast<unsigned char>(c));
    return sum;
}

std::string framed(const std::string& content) { return fmt::format("${}*{:02X}\r\n", content, checksum(content)); }

ise::failure wrong(std::string what) {
    return ise::failure(ise::errc::malformed, "no line of the uplink: " + std::move(what));
}

template <class N>
bool number(std::string_view text, N& into) {
    auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), into);
    return error == std::errc{} && end == text.data() + text.size() && text.front() != '-';
}

bool secret(std::string_view text, std::uint64_t& into) {
    if (text.size() != 16) return false;
    auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), into, 16);
    return error == std::errc{} && end == text.data() + text.size();
}

bool packet(std::string_view text, ise::bytes& into) {
    auto raw = ise::detail::from_base64(text);
    if (!raw || raw->empty() || raw->size() > max_packet_size) return false;
    into = std::move(*raw);
    return true;
}

struct fields {
    std::array<std::string_view, max_fields> of;
    std::size_t count = 0;
};

ise::result<line> parse_login(const fields& f) {
    login made;
    if (f.count != 6) return wrong("PATL has five fields");
    made.id = f.of[1];
    if (!is_good_id(made.id)) return wrong("PATL names no boat");
    if (!number(f.of[2], made.boot) || !number(f.of[3], made.first_unacked) || !number(f.of[4], made.last))
        return wrong("a field of PATL is not a number");
    if (made.first_unacked == 0 || made.last < made.first_unacked - 1)
        return wrong("the numbers of PATL do not fit together");
    if (!secret(f.of[5], made.token)) return wrong("the token of PATL is not 16 hexadecimal digits");
    return line(std::move(made));
}

ise::result<line> parse_record(const fields& f) {
    record made;
    if (f.count != 6) return wrong("PATD has five fields");
    if (!number(f.of[1], made.boot) || !number(f.of[2], made.number) || !number(f.of[3], made.unix_s))
        return wrong("a field of PATD is not a number");
    if (made.number == 0 || made.unix_s > last_second) return wrong("a number of PATD is out of range");
    if (f.of[4] != "H" && f.of[4] != "L") return wrong("PATD is neither H nor L");
    made.history = f.of[4] == "H";
    if (!packet(f.of[5], made.raw)) return wrong("PATD carries no packet");
    return line(std::move(made));
}

ise::result<line> parse_receipt(const fields& f) {
    receipt made;
    if (f.count != 3) return wrong("PATA has two fields");
    if (!number(f.of[1], made.boot) || !number(f.of[2], made.number)) return wrong("a field of PATA is not a number");
    return line(made);
}

ise::result<line> parse_order(const fields& f) {
    order made;
    if (f.count != 3) return wrong("PATC has two fields");
    if (!number(f.of[1], made.id)) return wrong("the id of PATC is not a number");
    if (!packet(f.of[2], made.raw)) return wrong("PATC carries no packet");
    return line(std::move(made));
}

ise::result<line> parse_outcome(const fields& f) {
    outcome made;
    if (f.count != 3 && f.count != 4) return wrong("PATR has two or three fields");
    if (!number(f.of[1], made.id) || !number(f.of[2], made.code)) return wrong("a field of PATR is not a number");
    if (f.count == 4 && !packet(f.of[3], made.raw)) return wrong("PATR carries no packet");
    return line(std::move(made));
}

ise::result<line> parse_challenge(const fields& f) {
    challenge made;
    if (f.count != 3) return wrong("PATN has two fields");
    if (!secret(f.of[1], made.token) || !secret(f.of[2], made.key))
        return wrong("a field of PATN is not 16 hexadecimal digits");
    return line(made);
}

ise::result<line> parse_key(const fields& f) {
    shown_key made;
    if (f.count != 2) return wrong("PATK has one field");
    if (!secret(f.of[1], made.key)) return wrong("the key of PATK is not 16 hexadecimal digits");
    return line(made);
}

struct encoder {
    std::string operator()(const login& l) const {
        return fmt::format("PATL,{},{},{},{},{:016x}", l.id, l.boot, l.first_unacked, l.last, l.token);
    }
    std::string operator()(const challenge& c) const { return fmt::format("PATN,{:016x},{:016x}", c.token, c.key); }
    std::string operator()(const shown_key& k) const { return fmt::format("PATK,{:016x}", k.key); }
    std::string operator()(const record& r) const {
        return fmt::format("PATD,{},{},{},{},{}", r.boot, r.number, r.unix_s, r.history ? 'H' : 'L',
                           ise::detail::to_base64(r.raw));
    }
    std::string operator()(const receipt& r) const { return fmt::format("PATA,{},{}", r.boot, r.number); }
    std::string operator()(const order& o) const {
        return fmt::format("PATC,{},{}", o.id, ise::detail::to_base64(o.raw));
    }
    std::string operator()(const outcome& o) const {
        auto text = fmt::format("PATR,{},{}", o.id, o.code);
        return o.raw.empty() ? text : text + "," + ise::detail::to_base64(o.raw);
    }
};

} // namespace

bool is_good_id(std::string_view id) noexcept {
    auto good = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '-' || c == '_' ||
               c == '.';
    };
    return !id.empty() && id.size() <= max_id && std::all_of(id.begin(), id.end(), good);
}

std::string encode(const line& of) { return framed(std::visit(encoder(), of)); }

ise::result<line> parse(std::string_view text) {
    if (text.size() > max_line)
        return ise::failure(ise::errc::too_large, fmt::format("a line of more than {} characters", max_line));
    if (text.size() < 4 || text.front() != '$' || text[text.size() - 3] != '*') return wrong("it is not $…*hh");
    auto content = text.substr(1, text.size() - 4);
    auto outcome = text.substr(text.size() - 2);
    std::uint8_t sum = 0;
    auto [end, error] = std::from_chars(outcome.data(), outcome.data() + outcome.size(), sum, 16);
    if (error != std::errc{} || end != outcome.data() + outcome.size()) return wrong("the checksum is not a number");
    if (sum != checksum(content)) return wrong("the checksum does not fit");
    fields split;
    for (;;) {
        if (split.count == max_fields) return wrong("too many fields");
        auto comma = content.find(',');
        auto field = content.substr(0, comma);
        if (field.empty()) return wrong("an empty field");
        split.of[split.count++] = field;
        if (comma == std::string_view::npos) break;
        content.remove_prefix(comma + 1);
    }
    if (split.of[0] == "PATL") return parse_login(split);
    if (split.of[0] == "PATD") return parse_record(split);
    if (split.of[0] == "PATA") return parse_receipt(split);
    if (split.of[0] == "PATC") return parse_order(split);
    if (split.of[0] == "PATR") return parse_outcome(split);
    if (split.of[0] == "PATN") return parse_challenge(split);
    if (split.of[0] == "PATK") return parse_key(split);
    return wrong("a sentence that is not of A-Tirma");
}

} // namespace atirma::gprs
