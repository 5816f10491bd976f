#include <components/mail/mime.hpp>

#include <fmt/format.h>
#include <gmime/gmime.h>

#include <memory>
#include <mutex>
#include <optional>
#include <type_traits>

namespace atirma {
namespace {

template <class T>
struct released {
    void operator()(T* object) const { g_object_unref(object); }
};
template <class T>
using owned = std::unique_ptr<T, released<T>>;
using owned_text = std::unique_ptr<char, decltype([](char* text) { g_free(text); })>;
using owned_options =
    std::unique_ptr<GMimeParserOptions, decltype([](GMimeParserOptions* o) { g_mime_parser_options_free(o); })>;

void start_library() {
    static std::once_flag once;
    std::call_once(once, [] { g_mime_init(); });
}

ise::failure malformed(std::string what) {
    return ise::failure(ise::errc::malformed, "this is not a mail to rely on: " + std::move(what));
}

std::string as_utf8(const char* text) {
    if (!text) return {};
    owned_text valid(g_utf8_make_valid(text, -1));
    return valid.get();
}

// What the parser stumbled over and went on, but what leaves a mail that is not what was sent.
void on_warning(gint64, GMimeParserWarning code, const gchar*, gpointer into) {
    auto& why = *static_cast<std::optional<std::string>*>(into);
    if (why) return;
    if (code == GMIME_WARN_TRUNCATED_MESSAGE) why = "it ends in the middle";
    else if (code == GMIME_CRIT_NESTING_OVERFLOW) why = "its parts are nested without end";
    else if (code == GMIME_CRIT_MULTIPART_WITHOUT_BOUNDARY) why = "its parts have no boundary";
}

owned<GMimeStream> memory_stream(const void* data, std::size_t size) {
    if (size == 0) return owned<GMimeStream>(g_mime_stream_mem_new()); // the other one wants an address
    return owned<GMimeStream>(g_mime_stream_mem_new_with_buffer(static_cast<const char*>(data), size));
}

std::vector<std::byte> written(GMimeStream* stream) {
    auto* array = g_mime_stream_mem_get_byte_array(GMIME_STREAM_MEM(stream));
    auto* data = reinterpret_cast<const std::byte*>(array->data);
    return {data, data + array->len};
}

/// RFC 4648 with line breaks, to the letter: the library itself passes over what it does not know.
bool is_base64(const std::vector<std::byte>& raw) {
    std::size_t digits = 0, padding = 0;
    for (std::byte one : raw) {
        auto c = static_cast<char>(one);
        if (c == '\r' || c == '\n' || c == ' ' || c == '\t') continue;
        if (c == '=') {
            ++padding;
            continue;
        }
        bool known = (c >= 'A' && c <= 'Z') || (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '+' || c == '/';
        if (!known || padding > 0) return false;
        ++digits;
    }
    return padding <= 2 && (digits + padding) % 4 == 0;
}

ise::result<mail_attachment> attachment_of(GMimePart* part) {
    mail_attachment made;
    made.name = as_utf8(g_mime_part_get_filename(part));
    auto* content = g_mime_part_get_content(part);
    if (!content) return made; // headers and nothing else: an empty file
    if (g_mime_data_wrapper_get_encoding(content) == GMIME_CONTENT_ENCODING_BASE64) {
        auto* encoded = g_mime_data_wrapper_get_stream(content);
        g_mime_stream_reset(encoded);
        owned<GMimeStream> copy(g_mime_stream_mem_new());
        g_mime_stream_write_to_stream(encoded, copy.get());
        if (!is_base64(written(copy.get())))
            return malformed(fmt::format("the base64 of its attachment \"{}\" is broken", made.name));
        g_mime_stream_reset(encoded);
    }
    owned<GMimeStream> decoded(g_mime_stream_mem_new());
    if (g_mime_data_wrapper_write_to_stream(content, decoded.get()) < 0)
        return malformed(fmt::format("its attachment \"{}\" cannot be decoded", made.name));
    made.content = written(decoded.get());
    return made;
}

std::vector<std::string> addresses(InternetAddressList* list) {
    std::vector<std::string> found;
    for (int i = 0; list && i < internet_address_list_length(list) && found.size() < 100; ++i) {
        auto* one = internet_address_list_get_address(list, i);
        if (!INTERNET_ADDRESS_IS_MAILBOX(one)) continue; // groups are for people
        auto text = as_utf8(internet_address_mailbox_get_addr(INTERNET_ADDRESS_MAILBOX(one)));
        if (is_mail_address(text)) found.push_back(std::move(text));
    }
    return found;
}

/// The values of a header that may stand there several times, from the top, as they are written: an encoded word (RFC
/// 2047) in what a sender has chosen must not become anything else there.
std::vector<std::string> values_of(GMimeMessage* message, const char* name) {
    std::vector<std::string> found;
    auto* headers = g_mime_object_get_header_list(GMIME_OBJECT(message));
    for (int i = 0; i < g_mime_header_list_get_count(headers) && found.size() < 100; ++i) {
        auto* one = g_mime_header_list_get_header_at(headers, i);
        if (g_ascii_strcasecmp(g_mime_header_get_name(one), name) == 0)
            found.push_back(as_utf8(g_mime_header_get_raw_value(one)));
    }
    return found;
}

bool is_attachment(GMimePart* part) {
    const char* disposition = g_mime_object_get_disposition(GMIME_OBJECT(part));
    return g_mime_part_get_filename(part) || (disposition && g_ascii_strcasecmp(disposition, "attachment") == 0);
}

} // namespace

ise::result<mail_message> read_mail(std::string_view raw, const mime_limits& limits) {
    start_library();
    if (raw.size() > limits.max_bytes)
        return ise::failure(ise::errc::too_large,
                            fmt::format("a mail of {} bytes; {} are read at most", raw.size(), limits.max_bytes));
    auto stream = memory_stream(raw.data(), raw.size());
    owned<GMimeParser> parser(g_mime_parser_new_with_stream(stream.get()));
    owned_options options(g_mime_parser_options_new());
    std::optional<std::string> damage;
    // GMime 3.2.13 of Debian 12 takes three arguments, that of Debian 13 four.
    auto warn_by = [&](auto* set) {
        if constexpr (std::is_invocable_v<decltype(set), GMimeParserOptions*, GMimeParserWarningFunc, gpointer,
                                          GDestroyNotify>)
            set(options.get(), on_warning, &damage, nullptr);
        else set(options.get(), on_warning, &damage);
    };
    warn_by(&g_mime_parser_options_set_warning_callback);
    owned<GMimeMessage> message(g_mime_parser_construct_message(parser.get(), options.get()));
    if (!message) return malformed("it has no headers");
    if (damage) return malformed(*damage);

    mail_message made;
    auto senders = addresses(g_mime_message_get_from(message.get()));
    if (senders.empty()) return malformed("it has no sender");
    made.from = std::move(senders.front());
    made.to = addresses(g_mime_message_get_to(message.get()));
    made.subject = as_utf8(g_mime_message_get_subject(message.get()));
    made.authentication_results = values_of(message.get(), "Authentication-Results");

    if (!g_mime_message_get_mime_part(message.get())) return made;
    std::unique_ptr<GMimePartIter, decltype([](GMimePartIter* i) { g_mime_part_iter_free(i); })> at(
        g_mime_part_iter_new(GMIME_OBJECT(message.get())));
    bool has_text = false;
    std::size_t parts = 0;
    do {
        auto* current = g_mime_part_iter_get_current(at.get());
        if (!GMIME_IS_PART(current)) continue;
        if (++parts > limits.max_parts)
            return ise::failure(ise::errc::too_large, fmt::format("a mail of more than {} parts", limits.max_parts));
        auto* part = GMIME_PART(current);
        if (is_attachment(part)) {
            auto attachment = attachment_of(part);
            if (!attachment) return attachment.error();
            made.attachments.push_back(std::move(*attachment));
        } else if (GMIME_IS_TEXT_PART(current) && !has_text &&
                   g_mime_content_type_is_type(g_mime_object_get_content_type(current), "text", "plain")) {
            owned_text text(g_mime_text_part_get_text(GMIME_TEXT_PART(current)));
            made.text = as_utf8(text.get());
            has_text = true;
        }
    } while (g_mime_part_iter_next(at.get()));
    return made;
}

bool is_mail_address(std::string_view text) noexcept {
    auto at = text.find('@');
    if (at == 0 || at == std::string_view::npos || at + 1 == text.size() || at != text.rfind('@') || text.size() > 254)
        return false;
    for (char c : text)
        if (c <= ' ' || c > '~' || std::string_view("()<>[],;:\\\"").find(c) != std::string_view::npos) return false;
    return true;
}

namespace {

ise::failure unusable(std::string what) {
    return ise::failure(ise::errc::invalid_argument, "the mail cannot be sent: " + std::move(what));
}

bool is_line(const std::string& text) {
    return g_utf8_validate_len(text.data(), text.size(), nullptr) && text.find_first_of("\r\n") == std::string::npos;
}

void set_content(GMimePart* part, const void* data, std::size_t size, GMimeContentEncoding encoding) {
    auto stream = memory_stream(data, size);
    owned<GMimeDataWrapper> content(g_mime_data_wrapper_new_with_stream(stream.get(), GMIME_CONTENT_ENCODING_DEFAULT));
    g_mime_part_set_content(part, content.get());
    g_mime_part_set_content_encoding(part, encoding);
}

void add(GMimeMultipart* to, GMimePart* part) {
    g_mime_multipart_add(to, GMIME_OBJECT(part));
    g_object_unref(part);
}

} // namespace

ise::result<std::string> write_mail(const mail_message& what, const mail_stamp& stamp) {
    start_library();
    if (!is_mail_address(what.from)) return unusable(fmt::format("\"{}\" is not an address to send from", what.from));
    if (what.to.empty()) return unusable("it has no recipient");
    for (const auto& to : what.to)
        if (!is_mail_address(to)) return unusable(fmt::format("\"{}\" is not an address to send to", to));
    if (!is_line(what.subject)) return unusable("its subject is not one line of UTF-8");
    if (!g_utf8_validate_len(what.text.data(), what.text.size(), nullptr)) return unusable("its text is not UTF-8");
    for (const auto& one : what.attachments)
        if (one.name.empty() || !is_line(one.name))
            return unusable("the name of an attachment is not one line of UTF-8");

    owned<GMimeMessage> message(g_mime_message_new(TRUE));
    g_mime_message_add_mailbox(message.get(), GMIME_ADDRESS_TYPE_FROM, nullptr, what.from.c_str());
    for (const auto& to : what.to)
        g_mime_message_add_mailbox(message.get(), GMIME_ADDRESS_TYPE_TO, nullptr, to.c_str());
    g_mime_message_set_subject(message.get(), what.subject.c_str(), "utf-8");
    auto seconds = std::chrono::floor<std::chrono::seconds>(stamp.sent_at).time_since_epoch().count();
    std::unique_ptr<GDateTime, decltype([](GDateTime* d) { g_date_time_unref(d); })> date(
        g_date_time_new_from_unix_utc(seconds));
    if (date) g_mime_message_set_date(message.get(), date.get());
    auto own = fmt::format("{:x}.{:016x}", seconds, stamp.random);
    g_mime_message_set_message_id(message.get(),
                                  fmt::format("{}@{}", own, what.from.substr(what.from.find('@') + 1)).c_str());

    auto* body = g_mime_multipart_new_with_subtype("mixed");
    g_mime_multipart_set_boundary(body, ("=_" + own).c_str());
    g_mime_message_set_mime_part(message.get(), GMIME_OBJECT(body));
    auto* text = g_mime_part_new_with_type("text", "plain");
    g_mime_object_set_content_type_parameter(GMIME_OBJECT(text), "charset", "utf-8");
    set_content(text, what.text.data(), what.text.size(), GMIME_CONTENT_ENCODING_QUOTEDPRINTABLE);
    add(body, text);
    for (const auto& one : what.attachments) {
        auto* part = g_mime_part_new_with_type("application", "octet-stream");
        g_mime_object_set_disposition(GMIME_OBJECT(part), "attachment");
        g_mime_part_set_filename(part, one.name.c_str());
        set_content(part, one.content.data(), one.content.size(), GMIME_CONTENT_ENCODING_BASE64);
        add(body, part);
    }
    g_object_unref(body);

    std::unique_ptr<GMimeFormatOptions, decltype([](GMimeFormatOptions* o) { g_mime_format_options_free(o); })> format(
        g_mime_format_options_new());
    g_mime_format_options_set_newline_format(format.get(), GMIME_NEWLINE_FORMAT_DOS);
    owned_text whole(g_mime_object_to_string(GMIME_OBJECT(message.get()), format.get()));
    return std::string(whole.get());
}

} // namespace atirma
