#include <components/iridium_mail/mail_fields.hpp>
#include <components/iridium_mail/mail_format.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::iridium_mail {
namespace {

/// RFC 8601 without comments, in lower case, its words separated by single blanks. What stands in quotes is a sender's
/// text and becomes one word without meaning.
std::string without_comments(std::string_view text) {
    std::string made;
    int depth = 0;
    bool quoted = false;
    for (std::size_t i = 0; i < text.size(); ++i) {
        char c = text[i];
        if (c == '\\' && (quoted || depth > 0)) {
            ++i; // the next one means itself
        } else if (quoted) {
            quoted = c != '"';
            made += quoted ? '_' : '"';
        } else if (c == '(') {
            ++depth;
        } else if (depth > 0) {
            if (c == ')' && --depth == 0) made += ' ';
        } else {
            quoted = c == '"';
            bool blank = c == '\t' || c == '\r' || c == '\n';
            made += blank ? ' ' : c;
        }
    }
    made = lower(made);
    std::string single;
    for (char c : made)
        if (c != ' ' || (!single.empty() && single.back() != ' ')) single += c;
    return std::string(trimmed(single));
}

/// "header.d" of "dkim=pass header.d=iridium.com header.s=x"; empty where there is none.
std::string_view property(std::string_view result, std::string_view name) {
    while (!result.empty()) {
        auto word = result.substr(0, result.find(' '));
        result.remove_prefix(std::min(word.size() + 1, result.size()));
        auto equals = word.find('=');
        if (equals == std::string_view::npos || word.substr(0, equals) != name) continue;
        auto value = word.substr(equals + 1);
        return value.substr(value.rfind('@') + 1); // an address stands for its domain
    }
    return {};
}

/// `of` is the domain, or one above it that is no top-level domain.
bool covers(std::string_view of, std::string_view domain) {
    if (of.empty() || of.find('.') == std::string_view::npos) return false;
    return of == domain ||
           (domain.size() > of.size() && domain.ends_with(of) && domain[domain.size() - of.size() - 1] == '.');
}

bool passes(std::string_view result, std::string_view domain) {
    auto method = result.substr(0, result.find(' '));
    if (method == "dmarc=pass") return property(result, "header.from") == domain;
    if (method == "dkim=pass") return covers(property(result, "header.d"), domain);
    if (method == "spf=pass") return property(result, "smtp.mailfrom") == domain;
    return false;
}

} // namespace

ise::result<void> check_authentication(const std::vector<std::string>& results, std::string_view authserv,
                                       std::string_view domain) {
    const auto wanted = lower(domain), server = lower(authserv);
    for (const auto& each : results) {
        auto text = without_comments(each);
        std::string_view rest = text;
        auto head = trimmed(rest.substr(0, rest.find(';')));
        rest.remove_prefix(std::min(rest.find(';'), rest.size()));
        if (head.substr(0, head.find(' ')) != server) continue; // a version may follow
        while (!rest.empty()) {
            rest.remove_prefix(1);
            auto result = trimmed(rest.substr(0, rest.find(';')));
            if (passes(result, wanted)) return {};
            rest.remove_prefix(std::min(rest.find(';'), rest.size()));
        }
        return ise::failure(ise::errc::unauthorized, fmt::format("{} did not find the mail to be of {}: {}", authserv,
                                                                 domain, text.substr(0, 200)));
    }
    return ise::failure(ise::errc::unauthorized,
                        fmt::format("no Authentication-Results of {} say that the mail is of {}", authserv, domain));
}

} // namespace atirma::iridium_mail
