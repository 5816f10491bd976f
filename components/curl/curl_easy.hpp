#pragma once
// Private to this folder: the one header that brings libcurl along.
#include <ise/core/error.hpp>

#include <curl/curl.h>

#include <memory>
#include <string>
#include <vector>

namespace atirma {

/// One transfer as libcurl sees it: its options, and what it brings. Bounded; verifies certificates; uses no proxy but
/// the one it is told, and never an old connection, so that nothing is sent twice behind our back.
class curl_easy {
public:
    /// `url` as libcurl takes it; `protocols` are those that it may have: "http,https". `ca_file`: who signs the
    /// servers' certificates; empty: whom the system trusts.
    curl_easy(std::string url, const char* protocols, const std::string& ca_file);
    ~curl_easy();
    curl_easy(const curl_easy&) = delete;
    curl_easy& operator=(const curl_easy&) = delete;

    void set(CURLoption option, long value) { curl_easy_setopt(handle_.get(), option, value); }
    void set(CURLoption option, const std::string& value) { curl_easy_setopt(handle_.get(), option, value.c_str()); }
    void set_list(CURLoption option, const std::vector<std::string>& lines);

    CURL* handle() const noexcept { return handle_.get(); }
    long number(CURLINFO what) const noexcept;

    /// Why it ended so, for people: "https://gateway.example: …", without user, password and query.
    ise::failure failure(CURLcode code) const;
    /// Whether the server may have acted.
    ise::execution executed() const noexcept;
    /// "https://gateway.example:8443".
    std::string server() const;

    std::size_t max_body = 1 << 20;
    std::size_t max_header = 256 * 1024;
    std::string body;
    std::string header;    ///< all header lines, or replies of SMTP and IMAP, with their line ends
    bool too_much = false; ///< it was ended because of one of these limits

    curl_socket_t socket = CURL_SOCKET_BAD; ///< it was watched last for this transfer

private:
    static std::size_t on_body(char* data, std::size_t size, std::size_t count, void* self);
    static std::size_t on_header(char* data, std::size_t size, std::size_t count, void* self);
    static int on_trace(CURL* handle, curl_infotype what, char* data, std::size_t size, void* self);

    struct slist_free {
        void operator()(curl_slist* list) const { curl_slist_free_all(list); }
    };
    struct cleanup {
        void operator()(CURL* handle) const { curl_easy_cleanup(handle); }
    };
    std::unique_ptr<CURL, cleanup> handle_;
    std::vector<std::unique_ptr<curl_slist, slist_free>> lists_;
    std::string url_;
    char why_[CURL_ERROR_SIZE] = {};
};

} // namespace atirma
