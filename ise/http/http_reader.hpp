#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>

#include <memory>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

namespace ise {

/// One HTTP message as it was read.
struct http_message {
    std::string method;                                       ///< of a request
    std::string target;                                       ///< of a request: "/mo?x=1"
    int status = 0;                                           ///< of an answer
    std::vector<std::pair<std::string, std::string>> headers; ///< names in lower case
    std::string body;
    bool keep_alive = false;
    bool takes_chunks = false; ///< its sender speaks HTTP/1.1: an answer may come in chunks

    /// The value of a header by its name in lower case; empty if there is none.
    std::string_view header(std::string_view name) const noexcept;
};

struct http_reader_limits {
    std::size_t max_url_bytes = 2048;
    std::size_t max_head_bytes = 8 * 1024; ///< first line and headers
    std::size_t max_headers = 64;
    std::size_t max_body_bytes = 64 * 1024;
};

/// Reads HTTP/1.1 messages out of bytes as they come, bounded by its limits. Not thread safe.
class http_reader {
public:
    enum class reads { requests, answers };
    http_reader(reads what, http_reader_limits limits);
    ~http_reader();
    http_reader(const http_reader&) = delete;
    http_reader& operator=(const http_reader&) = delete;

    /// Takes bytes until one message is whole; says how many. The rest belongs to the next one: `take()`, then feed it.
    /// Errors: malformed, too_large (URL, head or body: the message says which). After an error it is of no more use.
    result<std::size_t> feed(bytes_view in);
    /// The stream has ended: completes an answer that has no length of its own. Error: malformed where it is cut off.
    result<void> end();

    /// The status that answers a request after an error of `feed`: 400, 413, 414 or 431.
    int refusal() const noexcept;
    bool begun() const noexcept; ///< something of a message is there
    bool complete() const noexcept;
    /// The sender waits for `100 Continue` before it sends the body; said once a message.
    bool wants_continue();
    /// The message; the next one may be fed then.
    http_message take();

private:
    struct parser;
    std::unique_ptr<parser> parser_;
};

} // namespace ise
