#include <components/iridium_mail/mail_format.hpp>

#include <components/iridium_mail/mail_fields.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <set>

namespace atirma::iridium_mail {
namespace {

constexpr std::string_view mo_subject = "SBD Msg From Unit:";

ise::failure malformed(std::string what) {
    return ise::failure(ise::errc::malformed, "a mail of the Iridium gateway that cannot be: " + std::move(what));
}
ise::failure unusable(std::string what) {
    return ise::failure(ise::errc::invalid_argument, "no message for the Iridium gateway: " + std::move(what));
}

bool is_sbd(std::string_view name) { return lower(name).ends_with(".sbd"); }

/// A field that must be there, once.
struct field_reader {
    std::vector<mail_field> fields;
    std::optional<std::string> wrong;

    std::optional<std::string> optional(std::string_view name) {
        std::optional<std::string> found;
        for (const auto& field : fields) {
            if (field.name != name) continue;
            if (found) wrong = wrong.value_or(fmt::format("\"{}\" stands there twice", name));
            else found = field.value;
        }
        return found;
    }
    std::string required(std::string_view name) {
        auto found = optional(name);
        if (!found) wrong = wrong.value_or(fmt::format("there is no \"{}\"", name));
        return found.value_or("");
    }
    std::uint32_t number(std::string_view name, std::uint32_t most) {
        auto text = required(name);
        auto value = whole_number(text, most);
        if (!value) wrong = wrong.value_or(fmt::format("\"{}\" is \"{}\", not 0 to {}", name, text, most));
        return value.value_or(0);
    }
};

/// "00 - TRANSFER OK" → 0.
std::optional<session_status> status_in(std::string_view text) {
    auto number = whole_number(trimmed(text.substr(0, text.find('-'))), 255);
    if (!number) return std::nullopt;
    return static_cast<session_status>(*number);
}

/// "Lat = 59.372463 Long = 75.309806".
bool read_location(std::string_view text, mo_session& into) {
    auto after = [&](std::string_view name) -> std::string_view {
        auto at = lower(text).find(name);
        if (at == std::string::npos) return {};
        auto rest = trimmed(text.substr(at + name.size()));
        if (!rest.starts_with('=') && !rest.starts_with(':')) return {};
        rest = trimmed(rest.substr(1));
        return rest.substr(0, rest.find_first_of(" \t,;"));
    };
    into.latitude_deg = decimal(after("lat"), 90);
    into.longitude_deg = decimal(after("long"), 180);
    return into.latitude_deg && into.longitude_deg;
}

ise::result<gateway_mail> read_mo(const mail_message& mail) {
    mo_session made;
    made.imei = trimmed(trimmed(mail.subject).substr(mo_subject.size()));
    if (!is_imei(made.imei))
        return malformed(fmt::format("it is from the unit \"{}\", which is not an IMEI of 15 digits", made.imei));
    field_reader in{fields_of(mail.text), std::nullopt};
    made.momsn = static_cast<std::uint16_t>(in.number("momsn", 0xffff));
    made.mtmsn = static_cast<std::uint16_t>(in.number("mtmsn", 0xffff));
    made.size = in.number("message size (bytes)", 1'000'000);
    auto time = in.required("time of session (utc)");
    auto status = in.required("session status");
    auto location = in.optional("unit location");
    auto radius = in.optional("cepradius");
    if (in.wrong) return malformed(*in.wrong);
    if (auto at = session_time(time)) made.session_at = *at;
    else return malformed(fmt::format("its session was at \"{}\"; a time is \"Tue Aug 13 16:51:04 2002\"", time));
    if (auto known = status_in(status)) made.status = *known;
    else return malformed(fmt::format("the session's status is \"{}\"", status));
    if (location && !read_location(*location, made)) return malformed(fmt::format("the unit is at \"{}\"", *location));
    if (radius) {
        made.cep_km = decimal(*radius, 20'000);
        if (!made.cep_km || *made.cep_km < 0)
            return malformed(fmt::format("the radius of its position is \"{}\" km", *radius));
    }

    std::size_t messages = 0;
    for (const auto& one : mail.attachments) {
        if (!is_sbd(one.name)) continue;
        if (++messages > 1) return malformed("it brings more than one message");
        made.payload = one.content;
    }
    if (has_arrived(made.status) && made.size > max_mo_bytes)
        return malformed(fmt::format("no unit sends a message of {} bytes", made.size));
    if (has_arrived(made.status) && made.size > 0 && messages == 0)
        return malformed(fmt::format("it states {} bytes and has no attachment *.sbd", made.size));
    if (messages == 1 && made.payload.size() != made.size)
        return malformed(fmt::format("it states {} bytes and has {}", made.size, made.payload.size()));
    return gateway_mail(std::move(made));
}

/// The rest of the line behind `words`, wherever they stand.
std::string behind(std::string_view text, std::string_view words) {
    auto at = lower(text).find(words);
    if (at == std::string::npos) return {};
    auto rest = text.substr(at + words.size());
    return std::string(trimmed(rest.substr(0, rest.find('\n'))));
}

std::string_view leading_digits(std::string_view text) { return text.substr(0, text.find_first_not_of("0123456789")); }

gateway_mail read_disposition(const mail_message& mail, bool queued) {
    disposition made;
    made.queued = queued;
    auto subject = std::string(trimmed(mail.subject));
    std::string reason;
    for (const auto& field : fields_of(mail.text)) {
        if (field.name == "imei" && made.imei.empty()) made.imei = imei_in(field.value).value_or("");
        else if ((field.name == "attachment filename" || field.name == "attachment") && made.attachment.empty())
            made.attachment = field.value;
        else if ((field.name == "reason" || field.name == "error" || field.name == "error description") &&
                 reason.empty())
            reason = field.value;
        else if (field.name == "mtmsn" && !made.mtmsn)
            if (auto number = whole_number(field.value, 0xffff)) made.mtmsn = static_cast<std::uint16_t>(*number);
    }
    if (auto named = imei_in(subject)) made.imei = *named;
    else if (made.imei.empty()) made.imei = imei_in(mail.text).value_or("");
    if (!queued) {
        made.reason = !reason.empty()               ? reason
                      : !trimmed(mail.text).empty() ? std::string(trimmed(mail.text)).substr(0, 500)
                                                    : subject;
        return made;
    }
    if (!made.mtmsn)
        if (auto number = whole_number(leading_digits(behind(mail.text, "the mtmsn is ")), 0xffff))
            made.mtmsn = static_cast<std::uint16_t>(*number);
    made.queue_position = whole_number(leading_digits(behind(mail.text, "the message is number ")), 1000);
    return made;
}

bool is_name(std::string_view name) {
    auto plain = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') || c == '_' || c == '-' ||
               c == '.';
    };
    return name.size() > 4 && name.size() <= 80 && is_sbd(name) && std::all_of(name.begin(), name.end(), plain);
}

/// What is wrong with a message for units, or nothing.
std::optional<std::string> objection(const std::vector<std::string>& imeis, const std::vector<mt_message>& messages) {
    if (imeis.empty() || imeis.size() > max_mt_imeis)
        return fmt::format("it is for {} units; 1 to {} are possible", imeis.size(), max_mt_imeis);
    std::set<std::string_view> known;
    for (const auto& imei : imeis) {
        if (!is_imei(imei)) return fmt::format("\"{}\" is not an IMEI of 15 digits", imei);
        if (!known.insert(imei).second) return fmt::format("the unit {} stands there twice", imei);
    }
    if (messages.empty()) return "it has no attachment *.sbd";
    for (const auto& one : messages) {
        if (!is_name(one.name))
            return fmt::format("\"{}\" is not a name of an attachment: letters, digits, '_', '-', '.', ending in .sbd",
                               one.name);
        if (one.payload.empty()) return fmt::format("{} is empty", one.name);
        if (one.payload.size() > max_mt_bytes)
            return fmt::format("{} has {} bytes; {} are possible", one.name, one.payload.size(), max_mt_bytes);
    }
    return std::nullopt;
}

} // namespace

std::string_view name_of(session_status status) noexcept {
    switch (status) {
        case session_status::ok: return "transfer ok";
        case session_status::mt_too_large: return "MT message too large";
        case session_status::location_poor: return "location of poor quality";
        case session_status::timed_out: return "session timed out";
        case session_status::mo_too_large: return "MO message too large";
        case session_status::incomplete: return "incomplete transfer";
        case session_status::protocol_error: return "protocol error";
        case session_status::denied: return "access denied";
    }
    return "unknown";
}

bool is_imei(std::string_view text) noexcept {
    return text.size() == 15 && std::all_of(text.begin(), text.end(), [](char c) { return c >= '0' && c <= '9'; });
}

ise::result<gateway_mail> read_gateway_mail(const mail_message& mail, std::string_view from) {
    if (!same_text(mail.from, from))
        return ise::failure(ise::errc::unauthorized, fmt::format("a mail from \"{}\"; only those from {} are read",
                                                                 mail.from.substr(0, 100), from));
    if (mail.text.size() > 64 * 1024)
        return ise::failure(ise::errc::too_large, "a mail of the Iridium gateway with a text of more than 64 KiB");
    auto subject = lower(trimmed(mail.subject));
    if (subject.starts_with(lower(mo_subject))) return read_mo(mail);
    if (subject.find("not queued") != std::string::npos) return read_disposition(mail, false);
    if (subject.find("queued for unit") != std::string::npos) {
        auto made = read_disposition(mail, true);
        if (std::get<disposition>(made).imei.empty())
            return malformed(fmt::format("\"{}\" names no unit", mail.subject.substr(0, 200)));
        return made;
    }
    return malformed(fmt::format("its subject is \"{}\"", mail.subject.substr(0, 200)));
}

ise::result<mail_message> make_mt_mail(const std::string& from, const std::vector<std::string>& imeis,
                                       const std::vector<mt_message>& messages, std::string_view to) {
    if (auto why = objection(imeis, messages)) return unusable(*why);
    mail_message made;
    made.from = from;
    made.to = {std::string(to)};
    for (const auto& imei : imeis) made.subject += (made.subject.empty() ? "" : " ") + imei;
    for (const auto& one : messages) made.attachments.push_back({one.name, one.payload});
    return made;
}

ise::result<mt_order> read_mt_mail(const mail_message& mail) {
    mt_order made;
    std::string_view rest = trimmed(mail.subject);
    while (!rest.empty()) {
        auto one = rest.substr(0, rest.find(' '));
        rest.remove_prefix(std::min(one.size() + 1, rest.size()));
        made.imeis.emplace_back(one);
    }
    for (const auto& one : mail.attachments)
        if (is_sbd(one.name)) made.messages.push_back({one.name, one.content});
    if (auto why = objection(made.imeis, made.messages)) return malformed(*why);
    return made;
}

mail_message make_mo_mail(const mo_session& session, const std::string& to, std::string_view from) {
    mail_message made;
    made.from = from;
    made.to = {to};
    made.subject = fmt::format("{} {}", mo_subject, session.imei);
    auto status = lower(name_of(session.status));
    for (char& c : status)
        if (c >= 'a' && c <= 'z') c = static_cast<char>(c - 'a' + 'A');
    made.text = fmt::format("MOMSN: {}\r\nMTMSN: {}\r\nTime of Session (UTC): {}\r\nSession Status: {:02} - "
                            "{}\r\nMessage Size (bytes): {}\r\n\r\n",
                            session.momsn, session.mtmsn, session_time_text(session.session_at),
                            static_cast<unsigned>(session.status), status, session.size);
    if (session.latitude_deg && session.longitude_deg)
        made.text +=
            fmt::format("Unit Location: Lat = {:.6f} Long = {:.6f}\r\n", *session.latitude_deg, *session.longitude_deg);
    if (session.cep_km) made.text += fmt::format("CEPradius = {}\r\n", *session.cep_km);
    if (!session.payload.empty()) {
        made.text += "\r\nMessage is Attached.\r\n";
        made.attachments.push_back({fmt::format("{}_{:06}.sbd", session.imei, session.momsn), session.payload});
    }
    return made;
}

mail_message make_disposition_mail(const disposition& what, const std::string& to, std::string_view from) {
    mail_message made;
    made.from = from;
    made.to = {to};
    if (what.queued) {
        made.subject = fmt::format("SBD Mobile-Terminated Message Queued for Unit {}", what.imei);
        made.text = fmt::format("The following mobile-terminated message was queued for delivery:\r\n\r\nIMEI: {}\r\n",
                                what.imei);
        if (!what.attachment.empty()) made.text += fmt::format("Attachment Filename: {}\r\n", what.attachment);
        if (what.mtmsn && what.queue_position)
            made.text += fmt::format("\r\nThe MTMSN is {}, and the message is number {} in the queue.\r\n", *what.mtmsn,
                                     *what.queue_position);
        return made;
    }
    made.subject = fmt::format("Error: SBD Mobile-Terminated Message Not Queued for Unit {}", what.imei);
    made.text = fmt::format("The following mobile-terminated message was not queued for delivery:\r\n\r\nIMEI: {}\r\n",
                            what.imei);
    if (!what.attachment.empty()) made.text += fmt::format("Attachment Filename: {}\r\n", what.attachment);
    made.text += fmt::format("Reason: {}\r\n", what.reason);
    return made;
}

} // namespace atirma::iridium_mail
