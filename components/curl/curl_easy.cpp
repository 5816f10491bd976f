// environment-boundary: libcurl owns its sockets
#include <components/curl/curl_easy.hpp>

#include <ise/core/url.hpp>

#include <fmt/format.h>

#include <mutex>
#include <new>

#include <sys/socket.h>

namespace atirma {
namespace {

CURL* new_handle() {
    static std::once_flag once;
    std::call_once(once, [] { curl_global_init(CURL_GLOBAL_ALL); });
    auto* made = curl_easy_init();
    if (!made) throw std::bad_alloc();
    return made;
}

} // namespace

curl_easy::curl_easy(std::string url, const char* protocols, const std::string& ca_file)
    : handle_(new_handle()), url_(std::move(url)) {
    auto* h = handle_.get();
    set(CURLOPT_URL, url_);
    curl_easy_setopt(h, CURLOPT_PROTOCOLS_STR, protocols);
    curl_easy_setopt(h, CURLOPT_PRIVATE, this);
    curl_easy_setopt(h, CURLOPT_ERRORBUFFER, why_);
    set(CURLOPT_NOSIGNAL, 1L);
    set(CURLOPT_QUICK_EXIT, 1L); // giving up does not wait for the thread that resolves a name
    set(CURLOPT_FRESH_CONNECT, 1L);
    set(CURLOPT_FORBID_REUSE, 1L);
    set(CURLOPT_PROXY, std::string()); // not the one of the process's variables
    set(CURLOPT_SSLVERSION, static_cast<long>(CURL_SSLVERSION_TLSv1_2));
    set(CURLOPT_SSL_VERIFYPEER, 1L);
    set(CURLOPT_SSL_VERIFYHOST, 2L);
    if (!ca_file.empty()) {
        set(CURLOPT_CAINFO, ca_file);
        curl_easy_setopt(h, CURLOPT_CAPATH, nullptr); // these and no others
    }
    curl_easy_setopt(h, CURLOPT_WRITEFUNCTION, on_body);
    curl_easy_setopt(h, CURLOPT_WRITEDATA, this);
    curl_easy_setopt(h, CURLOPT_HEADERFUNCTION, on_header);
    curl_easy_setopt(h, CURLOPT_HEADERDATA, this);
    curl_easy_setopt(h, CURLOPT_DEBUGFUNCTION, on_trace);
    curl_easy_setopt(h, CURLOPT_DEBUGDATA, this);
    set(CURLOPT_VERBOSE, 1L); // for on_trace; nothing is printed
}

curl_easy::~curl_easy() = default;

void curl_easy::set_list(CURLoption option, const std::vector<std::string>& lines) {
    std::unique_ptr<curl_slist, slist_free> list;
    for (const auto& line : lines) {
        auto* longer = curl_slist_append(list.get(), line.c_str());
        if (!longer) throw std::bad_alloc();
        if (!list) list.reset(longer);
    }
    curl_easy_setopt(handle_.get(), option, list.get());
    lists_.push_back(std::move(list));
}

long curl_easy::number(CURLINFO what) const noexcept {
    long value = 0;
    curl_easy_getinfo(handle_.get(), what, &value);
    return value;
}

std::size_t curl_easy::on_body(char* data, std::size_t size, std::size_t count, void* self) {
    auto& me = *static_cast<curl_easy*>(self);
    if (me.body.size() + size * count > me.max_body) {
        me.too_much = true;
        return 0;
    }
    me.body.append(data, size * count);
    return size * count;
}

std::size_t curl_easy::on_header(char* data, std::size_t size, std::size_t count, void* self) {
    auto& me = *static_cast<curl_easy*>(self);
    if (me.header.size() + size * count > me.max_header) {
        me.too_much = true;
        return 0;
    }
    me.header.append(data, size * count);
    return size * count;
}

// When libcurl says goodbye (SMTP, IMAP) it waits for the answer and holds up the whole loop meanwhile: a server that
// does not answer would stop a component for minutes. So the goodbye is sent and nobody listens for its answer.
int curl_easy::on_trace(CURL*, curl_infotype what, char* data, std::size_t size, void* self) {
    if (what != CURLINFO_HEADER_OUT) return 0;
    auto& me = *static_cast<curl_easy*>(self);
    std::string_view line(data, size);
    if ((line == "QUIT\r\n" || line.ends_with(" LOGOUT\r\n")) && me.socket != CURL_SOCKET_BAD)
        ::shutdown(me.socket, SHUT_RD);
    return 0;
}

std::string curl_easy::server() const {
    auto parts = ise::parse_url(url_);
    return parts ? parts->server() : "an invalid URL";
}

ise::execution curl_easy::executed() const noexcept {
    return number(CURLINFO_REQUEST_SIZE) > 0 ? ise::execution::unknown : ise::execution::not_executed;
}

ise::failure curl_easy::failure(CURLcode code) const {
    auto whom = server();
    std::string why = why_[0] ? why_ : curl_easy_strerror(code);
    auto fail = [&](ise::errc kind, std::string_view advice, ise::execution done) {
        return ise::failure(kind, fmt::format("{}: {}{}", whom, why, advice), done);
    };
    constexpr auto nothing = ise::execution::not_executed;
    if (too_much)
        return fail(ise::errc::too_large, fmt::format(" (more than {} bytes are not taken)", max_body), executed());
    switch (code) {
        case CURLE_URL_MALFORMAT:
        case CURLE_UNSUPPORTED_PROTOCOL: return fail(ise::errc::invalid_argument, "", nothing);
        case CURLE_SSL_CACERT_BADFILE:
            return fail(ise::errc::invalid_argument, " (name a readable PEM file of the authorities)", nothing);
        case CURLE_PEER_FAILED_VERIFICATION:
            return fail(ise::errc::unreachable,
                        " (the server's certificate is not trusted, or is another server's: look at the CA file and at "
                        "the name)",
                        nothing);
        case CURLE_COULDNT_RESOLVE_HOST:
        case CURLE_COULDNT_RESOLVE_PROXY:
        case CURLE_COULDNT_CONNECT:
        case CURLE_SSL_CONNECT_ERROR:
        case CURLE_SSL_CIPHER:
        case CURLE_USE_SSL_FAILED: return fail(ise::errc::unreachable, "", nothing);
        case CURLE_LOGIN_DENIED: return fail(ise::errc::unauthorized, " (look at user and password)", nothing);
        case CURLE_OPERATION_TIMEDOUT: return fail(ise::errc::timed_out, "", executed());
        case CURLE_SEND_ERROR:
        case CURLE_RECV_ERROR:
        case CURLE_GOT_NOTHING:
        case CURLE_PARTIAL_FILE:
        case CURLE_WEIRD_SERVER_REPLY: return fail(ise::errc::peer_lost, "", executed());
        default: return fail(ise::errc::io_failed, "", executed());
    }
}

} // namespace atirma
