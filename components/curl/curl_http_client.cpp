#include <components/curl/curl_http_client.hpp>

#include <components/curl/curl_easy.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace atirma {
namespace {

bool is_token(std::string_view text) {
    auto plain = [](char c) {
        return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z') || (c >= '0' && c <= '9') ||
               std::string_view("!#$%&'*+-.^_`|~").find(c) != std::string_view::npos;
    };
    return !text.empty() && std::all_of(text.begin(), text.end(), plain);
}
bool is_value(std::string_view text) {
    return std::none_of(text.begin(), text.end(), [](char c) { return c == '\r' || c == '\n' || c == '\0'; });
}

/// What no request may be made of.
std::optional<std::string> objection(const ise::http_exchange& what) {
    if (!is_token(what.method)) return "its method is none";
    for (char c : what.url)
        if (c <= ' ' || c > '~') return "its URL has characters that must be escaped (%20)";
    for (const auto& [name, value] : what.headers)
        if (!is_token(name) || !is_value(value)) return fmt::format("its header \"{}\" is none", name);
    return std::nullopt;
}

std::string lower(std::string_view text) {
    std::string made(text);
    for (char& c : made)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return made;
}

std::string_view trimmed(std::string_view text) {
    while (!text.empty() && (text.front() == ' ' || text.front() == '\t')) text.remove_prefix(1);
    while (!text.empty() && (text.back() == ' ' || text.back() == '\t' || text.back() == '\r')) text.remove_suffix(1);
    return text;
}

/// Of the last answer, where there were several ("100 Continue").
std::vector<std::pair<std::string, std::string>> headers_in(std::string_view lines) {
    std::vector<std::pair<std::string, std::string>> found;
    while (!lines.empty()) {
        auto line = lines.substr(0, lines.find('\n'));
        lines.remove_prefix(std::min(line.size() + 1, lines.size()));
        if (line.starts_with("HTTP/")) found.clear();
        auto colon = line.find(':');
        if (colon == std::string_view::npos || line.starts_with("HTTP/")) continue;
        found.emplace_back(lower(trimmed(line.substr(0, colon))), trimmed(line.substr(colon + 1)));
    }
    return found;
}

} // namespace

ise::task<ise::result<ise::http_answer>> curl_http_client::exchange(ise::http_exchange what, ise::duration within) {
    if (auto why = objection(what))
        co_return ise::failure(ise::errc::invalid_argument, "a request that cannot be sent: " + *why);
    curl_easy transfer(what.url, "http,https", options_.ca_file);
    transfer.max_body = max_answer_bytes;
    if (!options_.proxy.empty()) transfer.set(CURLOPT_PROXY, options_.proxy);
    transfer.set(CURLOPT_HTTP_VERSION, static_cast<long>(CURL_HTTP_VERSION_1_1));
    std::vector<std::string> lines{"Expect:"}; // no waiting for a "100 Continue"
    bool typed = false;
    for (const auto& [name, value] : what.headers) {
        lines.push_back(value.empty() ? name + ";" : name + ": " + value);
        typed = typed || lower(name) == "content-type";
    }
    if (!what.body.empty() || what.method == "POST" || what.method == "PUT") {
        if (!typed) lines.push_back("Content-Type:"); // libcurl would call it a form
        curl_easy_setopt(transfer.handle(), CURLOPT_POSTFIELDSIZE_LARGE, static_cast<curl_off_t>(what.body.size()));
        curl_easy_setopt(transfer.handle(), CURLOPT_POSTFIELDS, what.body.data());
    }
    if (what.method == "HEAD") transfer.set(CURLOPT_NOBODY, 1L);
    transfer.set(CURLOPT_CUSTOMREQUEST, what.method);
    transfer.set_list(CURLOPT_HTTPHEADER, lines);
    auto outcome = co_await on_.run(transfer, within);
    if (!outcome) co_return outcome.error();
    // libcurl takes an end in the middle of the headers for an empty answer.
    if (!transfer.header.ends_with("\r\n\r\n") && !transfer.header.ends_with("\n\n"))
        co_return ise::failure(ise::errc::peer_lost, transfer.server() + ": the server went away in its answer",
                               ise::execution::unknown);
    ise::http_answer answer;
    answer.status = static_cast<int>(transfer.number(CURLINFO_RESPONSE_CODE));
    answer.headers = headers_in(transfer.header);
    answer.body = std::move(transfer.body);
    co_return answer;
}

} // namespace atirma
