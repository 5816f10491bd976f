#include <ise/http/http_reader.hpp>

#include <fmt/format.h>
#include <http_parser.h>

#include <algorithm>
#include <optional>

namespace ise {

std::string_view http_message::header(std::string_view name) const noexcept {
    for (const auto& [known, value] : headers)
        if (known == name) return value;
    return {};
}

struct http_reader::parser {
    parser(reads what, http_reader_limits bounds)
        : kind(what == reads::requests ? HTTP_REQUEST : HTTP_RESPONSE), limits(bounds) {
        reset();
    }

    void reset() {
        http_parser_init(&state, kind);
        state.data = this;
        now = {};
        head_bytes = 0;
        whole = started = continues = in_value = false;
        wrong.reset();
    }
    /// What a callback returns: 0 goes on.
    int too_large(int answered_with, std::string why) {
        if (!wrong) wrong.emplace(errc::too_large, std::move(why));
        status = answered_with;
        return 1;
    }
    int head(std::size_t more) {
        head_bytes += more;
        if (head_bytes <= limits.max_head_bytes) return 0;
        return too_large(431, fmt::format("the headers have more than {} bytes", limits.max_head_bytes));
    }

    static parser& of(http_parser* p) { return *static_cast<parser*>(p->data); }

    static http_parser_settings settings() {
        http_parser_settings s;
        http_parser_settings_init(&s);
        s.on_message_begin = [](http_parser* p) { return of(p).started = true, 0; };
        s.on_url = [](http_parser* p, const char* at, std::size_t size) {
            auto& self = of(p);
            self.now.target.append(at, size);
            if (self.now.target.size() > self.limits.max_url_bytes)
                return self.too_large(414, fmt::format("the URL has more than {} bytes", self.limits.max_url_bytes));
            return self.head(size);
        };
        s.on_header_field = [](http_parser* p, const char* at, std::size_t size) {
            auto& self = of(p);
            auto& headers = self.now.headers;
            if (self.in_value || headers.empty()) {
                if (headers.size() >= self.limits.max_headers)
                    return self.too_large(431, fmt::format("more than {} headers", self.limits.max_headers));
                headers.emplace_back();
            }
            self.in_value = false;
            for (char c : std::string_view(at, size))
                headers.back().first += c >= 'A' && c <= 'Z' ? static_cast<char>(c + 32) : c;
            return self.head(size);
        };
        s.on_header_value = [](http_parser* p, const char* at, std::size_t size) {
            auto& self = of(p);
            self.in_value = true;
            if (!self.now.headers.empty()) self.now.headers.back().second.append(at, size);
            return self.head(size);
        };
        s.on_headers_complete = [](http_parser* p) {
            auto& self = of(p);
            bool known = p->content_length != static_cast<std::uint64_t>(-1);
            if (known && p->content_length > self.limits.max_body_bytes)
                return self.too_large(413, fmt::format("the body has {} bytes, {} at most", p->content_length,
                                                       self.limits.max_body_bytes));
            auto expects = self.now.header("expect");
            self.continues = expects.size() == 12 && (expects[0] == '1') && expects.substr(0, 4) == "100-";
            return 0;
        };
        s.on_body = [](http_parser* p, const char* at, std::size_t size) {
            auto& self = of(p);
            if (self.now.body.size() + size > self.limits.max_body_bytes)
                return self.too_large(413, fmt::format("the body has more than {} bytes", self.limits.max_body_bytes));
            self.now.body.append(at, size);
            return 0;
        };
        s.on_message_complete = [](http_parser* p) {
            auto& self = of(p);
            self.whole = true;
            self.now.keep_alive = http_should_keep_alive(p) != 0;
            self.now.takes_chunks = p->http_major > 1 || (p->http_major == 1 && p->http_minor >= 1);
            self.now.status = static_cast<int>(p->status_code);
            if (p->type == HTTP_REQUEST) self.now.method = http_method_str(static_cast<http_method>(p->method));
            http_parser_pause(p, 1); // what follows belongs to the next one
            return 0;
        };
        return s;
    }

    http_parser_type kind;
    http_reader_limits limits;
    http_parser state{};
    http_message now;
    std::optional<failure> wrong;
    int status = 400; // of the answer to what is wrong
    std::size_t head_bytes = 0;
    bool whole = false, started = false, continues = false, in_value = false;
};

http_reader::http_reader(reads what, http_reader_limits limits) : parser_(std::make_unique<parser>(what, limits)) {}
http_reader::~http_reader() = default;

result<std::size_t> http_reader::feed(bytes_view in) {
    auto& p = *parser_;
    if (p.wrong) return *p.wrong;
    if (p.whole) return std::size_t{0};
    if (in.empty()) return std::size_t{0};
    static const auto settings = parser::settings();
    auto used = http_parser_execute(&p.state, &settings, reinterpret_cast<const char*>(in.data()), in.size());
    auto problem = HTTP_PARSER_ERRNO(&p.state);
    if (p.wrong) return *p.wrong;
    if (problem == HPE_PAUSED) return std::min(used, in.size());
    if (problem != HPE_OK) {
        p.wrong.emplace(errc::malformed, fmt::format("no HTTP: {}", http_errno_description(problem)));
        return *p.wrong;
    }
    if (p.state.upgrade != 0 && !p.whole) p.whole = true; // CONNECT and the like have no body for us
    return used;
}

result<void> http_reader::end() {
    auto& p = *parser_;
    if (p.wrong) return *p.wrong;
    if (p.whole) return {};
    static const auto settings = parser::settings();
    http_parser_execute(&p.state, &settings, nullptr, 0);
    if (p.wrong) return *p.wrong;
    if (!p.whole) return failure(errc::malformed, "the message is cut off");
    return {};
}

int http_reader::refusal() const noexcept { return parser_->status; }
bool http_reader::begun() const noexcept { return parser_->started; }
bool http_reader::complete() const noexcept { return parser_->whole; }
bool http_reader::wants_continue() { return std::exchange(parser_->continues, false) && !parser_->whole; }

http_message http_reader::take() {
    auto message = std::move(parser_->now);
    parser_->reset();
    return message;
}

} // namespace ise
