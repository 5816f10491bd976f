#include <components/mail/smtp_text.hpp>

#include <components/mail/imap_text.hpp>

#include <fmt/format.h>

namespace atirma {

ise::result<std::optional<smtp_reply>> smtp_replies::next() {
    for (;;) {
        auto end = buffer_.find('\n');
        if (text_.size() + std::min(end, buffer_.size()) > max_)
            return ise::failure(ise::errc::too_large,
                                fmt::format("the server sends a reply of more than {} bytes", max_));
        if (end == std::string::npos) return std::optional<smtp_reply>();
        auto line = buffer_.substr(0, end);
        buffer_.erase(0, end + 1);
        if (line.ends_with('\r')) line.pop_back();
        auto code = imap_number(std::string_view(line).substr(0, 3));
        bool more = line.size() > 3 && line[3] == '-';
        if (line.size() < 3 || !code || *code < 200 || *code > 599 || (line.size() > 3 && line[3] != ' ' && !more))
            return ise::failure(ise::errc::malformed,
                                fmt::format("the server says \"{}\", which is not a reply of SMTP", imap_shown(line)));
        text_ += (text_.empty() ? "" : " ") + line;
        if (more) continue;
        smtp_reply made;
        made.code = static_cast<int>(*code);
        made.text = std::exchange(text_, {});
        return std::optional<smtp_reply>(std::move(made));
    }
}

std::string smtp_content(std::string_view mail) {
    std::string made;
    made.reserve(mail.size() + mail.size() / 64 + 2);
    while (!mail.empty()) {
        auto line = mail.substr(0, mail.find('\n'));
        mail.remove_prefix(std::min(line.size() + 1, mail.size()));
        if (line.ends_with('\r')) line.remove_suffix(1);
        if (line.starts_with('.')) made += '.';
        made.append(line);
        made += "\r\n";
    }
    return made;
}

} // namespace atirma
