#include <components/web_server/http_server.hpp>

#include <components/web_server/http_answers.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/error.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/real/room_for_sockets.hpp>
#include <ise/core/waiter.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <asio/ip/address.hpp>
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <map>
#include <optional>
#include <set>
#include <utility>
#include <vector>

namespace atirma {
namespace {

using headers = std::vector<std::pair<std::string, std::string>>;
constexpr std::size_t max_dropped = 64 * 1024; // bytes that a client sends although nobody reads them

/// An answer that is no stream: embedded files are sent from where they lie.
struct page_answer {
    int status = 200;
    std::string content_type;
    std::shared_ptr<const std::string> owned; ///< or
    std::string_view borrowed;                ///< bytes of the binary
    headers extra;
    bool framed = false;

    std::string_view body() const { return owned ? std::string_view(*owned) : borrowed; }
};

page_answer make_page_answer(int status, std::string content_type, std::string body, headers extra = headers()) {
    page_answer made;
    made.status = status;
    made.content_type = std::move(content_type);
    made.owned = std::make_shared<const std::string>(std::move(body));
    made.extra = std::move(extra);
    return made;
}

page_answer error_answer(int status, std::string_view what, headers extra = headers()) {
    extra.emplace_back("Cache-Control", "no-store");
    return make_page_answer(status, "text/html; charset=utf-8", error_page(status, what), std::move(extra));
}

/// The first line and the headers that every answer has, each ending its line.
std::string head_of(ise::loop& on, int status, std::string_view content_type, const headers& extra, bool framed) {
    auto at = std::chrono::floor<std::chrono::seconds>(on.env().wall());
    auto head = fmt::format("HTTP/1.1 {} {}\r\nDate: {:%a, %d %b %Y %H:%M:%S} GMT\r\nContent-Type: {}\r\n", status,
                            reason_of(status), fmt::gmtime(std::chrono::system_clock::to_time_t(at)), content_type);
    auto add = [&](std::string_view name, std::string_view value) {
        head.append(name).append(": ").append(value).append("\r\n");
    };
    for (const auto& [name, value] : extra) add(name, value);
    for (const auto& [name, value] : security_headers(framed)) add(name, value);
    return head;
}

/// One connection: whoever writes to it and whoever reads from it hold it together.
struct conversation {
    conversation(ise::loop& on, std::unique_ptr<ise::stream> line, http_reader_limits limits, http_times times)
        : requests(on, std::move(line), limits, times) {}
    line_with_deadline& line() { return requests.line(); }

    http_requests requests;
};

/// One client's event stream as a chunked response. The connection's coroutine writes what it is given.
class stream_sink final : public sse_sink {
public:
    stream_sink(ise::loop& on, std::shared_ptr<conversation> over)
        : over_(std::move(over)), wake_(on, [this] { wake_.resume(asio::error::operation_aborted); }) {}

    void write(std::shared_ptr<const std::string> text, written done) override {
        if (closed_) return done(asio::error::not_connected);
        text_ = std::move(text);
        done_ = std::move(done);
        wake_.resume({});
    }
    void close() noexcept override {
        if (std::exchange(closed_, true)) return;
        asio::const_buffer last("0\r\n\r\n", 5);
        if (!busy_) over_->line().line().try_write(std::span(&last, 1)); // a client sees an end, not a failure
        over_->line().line().close();
        wake_.resume({});
    }
    bool closed() const noexcept { return closed_; }

    /// Writes until the stream is closed from either side.
    static ise::task<> run(std::shared_ptr<stream_sink> self, std::string head, ise::loop& on, http_limits limits) {
        auto& line = self->over_->line();
        while (!self->closed_) {
            if (!self->text_) {
                co_await self->wake_.wait(); // throws what it was resumed with
                continue;
            }
            auto text = std::exchange(self->text_, nullptr);
            auto done = std::exchange(self->done_, nullptr);
            head += fmt::format("{:x}\r\n", text->size());
            std::vector<std::string_view> pieces(3);
            pieces[0] = head;
            pieces[1] = *text;
            pieces[2] = "\r\n";
            self->busy_ = true;
            line.until(ise::saturating_add(on.now(), limits.write_timeout));
            auto unsent = co_await line.write_all(std::move(pieces));
            line.until(ise::saturating_add(on.now(), limits.silent_stream_timeout));
            self->busy_ = false;
            head.clear();
            done(unsent);
            if (unsent) co_return;
        }
    }
    /// Reads, and keeps nothing, to learn at once that the client has left.
    static ise::task<> watch(std::shared_ptr<stream_sink> self) {
        auto over = self->over_;
        co_await over->line().drop_rest(max_dropped);
        self->close();
    }

private:
    std::shared_ptr<conversation> over_;
    ise::waiter<std::error_code> wake_;
    std::shared_ptr<const std::string> text_;
    written done_;
    bool busy_ = false, closed_ = false;
};

} // namespace

struct http_server::implementation : std::enable_shared_from_this<implementation> {
    implementation(ise::loop& on_, http_options chosen, spawner start)
        : on(on_), options(std::move(chosen)), spawn(std::move(start)) {}

    struct other_name {
        std::string file;
        bool framed = false;
    };
    struct channel {
        channel(sse_channel::snapshot_source source, sse_limits limits)
            : events(std::move(source), limits), places(limits.max_clients) {}
        sse_channel events;
        ise::net::fair_places places;
    };

    void log(std::string_view line) const {
        if (options.log) options.log(line);
    }
    void log_some(std::string_view line) {
        if (auto left_out = quiet.admit(on.now()))
            log(fmt::format("{} ({} such lines were left out)", line, *left_out));
    }

    page_answer asset_answer(const http_message& request, const asset& file, bool framed) const {
        bool packed = !file.gzip.empty() && takes_gzip(request.header("accept-encoding"));
        // The compressed form is another representation, so it has another tag.
        std::string tag(file.etag);
        if (packed) tag.insert(tag.size() - 1, "-gz");
        page_answer made;
        made.content_type = file.content_type;
        made.borrowed = packed ? file.gzip : file.bytes;
        made.framed = framed;
        made.extra = {{"ETag", tag}, {"Cache-Control", "no-cache"}, {"Vary", "Accept-Encoding"}};
        if (lists_etag(request.header("if-none-match"), tag)) made.status = 304;
        else if (packed) made.extra.emplace_back("Content-Encoding", "gzip");
        return made;
    }

    page_answer handled(const handler& h, const http_request& asked) {
        http_reply reply;
        try {
            reply = h(asked);
        } catch (const std::exception& why) {
            ++statistics.handlers_failed;
            log(fmt::format("GET {} failed: {}", asked.path, why.what()));
            return error_answer(500, "The server could not make this page. It was logged.");
        }
        headers extra = {{"Cache-Control", "no-store"}};
        if (!reply.download_as.empty())
            extra.emplace_back("Content-Disposition",
                               fmt::format("attachment; filename=\"{}\"", safe_file_name(reply.download_as)));
        return make_page_answer(reply.status, reply.content_type, std::move(reply.body), std::move(extra));
    }

    std::pair<const asset*, bool> find_file(const std::string& path) const {
        auto other = other_names.find(path);
        auto file = files.find(other == other_names.end() ? path : other->second.file);
        if (file == files.end()) return {nullptr, false};
        return {&file->second, other != other_names.end() && other->second.framed};
    }

    static http_request asked_by(const http_message& request) {
        http_request made;
        auto mark = std::min(request.target.find('?'), request.target.size());
        made.path = request.target.substr(0, mark);
        if (mark < request.target.size()) made.query = request.target.substr(mark + 1);
        return made;
    }

    page_answer answer(const http_message& request, const http_request& asked) {
        if (request.method != "GET" && request.method != "HEAD")
            return error_answer(405, "This server is read-only.", {{"Allow", "GET, HEAD"}});
        if (request.target.size() > options.limits.max_url_bytes) return error_answer(414, "This address is too long.");
        if (channels.contains(asked.path))
            return make_page_answer(200, "text/event-stream; charset=utf-8", "", {{"Cache-Control", "no-store"}});
        if (auto h = handlers.find(asked.path); h != handlers.end()) return handled(h->second, asked);
        if (auto [file, framed] = find_file(asked.path); file) return asset_answer(request, *file, framed);
        return error_answer(404, "There is no such page.");
    }

    ise::task<std::error_code> send(conversation& over, page_answer what, bool head_only, bool keep) {
        auto body = what.body();
        what.extra.emplace_back("Content-Length", std::to_string(body.size())); // of a 304 too: what a 200 would have
        what.extra.emplace_back("Connection", keep ? "keep-alive" : "close");
        auto head = head_of(on, what.status, what.content_type, what.extra, what.framed) + "\r\n";
        std::vector<std::string_view> pieces(1, head);
        if (what.status != 304 && !head_only && !body.empty()) pieces.push_back(body);
        over.line().until(ise::saturating_add(on.now(), options.limits.write_timeout));
        auto unsent = co_await over.line().write_all(std::move(pieces));
        co_return unsent;
    }

    /// The rest of the connection is an event stream; or an answer says why not.
    ise::task<> stream(std::shared_ptr<conversation> over, channel& of, std::string path, const http_message& request,
                       std::string peer) {
        auto sink = std::make_shared<stream_sink>(on, over);
        auto place = stopped ? nullptr : of.places.take(peer);
        bool added = false, failed = false;
        if (place) {
            place->serve();
            place->on_displaced([&of, raw = sink.get()] { of.events.remove(raw); });
            // A page that opens a new stream by itself cannot set the header, so `?last=` stands for it.
            std::string last_seen(request.header("last-event-id"));
            auto query = asked_by(request).query;
            if (last_seen.empty() && query.starts_with("last=")) last_seen = query.substr(5);
            try {
                added = of.events.add(sink, last_seen);
            } catch (const std::exception& why) { // a snapshot that could not be made
                ++statistics.handlers_failed;
                log(fmt::format("GET {} failed: {}", path, why.what()));
                failed = true;
            }
        }
        if (!added) {
            auto refusal = failed ? error_answer(500, "The server could not make this page. It was logged.")
                                  : error_answer(503, "Too many people are watching right now. Try again in a minute.",
                                                 {{"Retry-After", "30"}});
            auto sending = send(*over, std::move(refusal), false, false);
            co_await std::move(sending);
            co_return;
        }
        struct leaving {
            sse_channel& from;
            stream_sink& who;
            ~leaving() {
                from.remove(&who);
                who.close();
            }
        } guard{of.events, *sink};
        headers extra = {{"Cache-Control", "no-store"}, {"X-Accel-Buffering", "no"}, {"Transfer-Encoding", "chunked"}};
        auto head = head_of(on, 200, "text/event-stream; charset=utf-8", extra, false) + "\r\n";
        spawn("watches " + peer, stream_sink::watch(sink));
        auto running = stream_sink::run(sink, std::move(head), on, options.limits);
        co_await std::move(running);
    }

    ise::task<> converse(std::shared_ptr<conversation> over, ise::net::fair_places::place& place, std::string peer) {
        for (;;) {
            auto request = co_await over->requests.next();
            if (!request) {
                const auto& refused = over->requests.refused();
                if (!refused || refused->status == 0) co_return;
                auto refusal = error_answer(refused->status, "This is not a request that the server understands.");
                auto sending = send(*over, std::move(refusal), false, false);
                co_await std::move(sending);
                over->line().line().shutdown_write();
                co_await over->line().drop_rest(max_dropped);
                co_return;
            }
            place.serve();
            ++statistics.requests;
            auto asked = asked_by(*request);
            auto of = channels.find(asked.path);
            if (request->method == "GET" && of != channels.end()) {
                auto streaming = stream(over, *of->second, asked.path, *request, peer);
                co_await std::move(streaming);
                co_return;
            }
            auto sending = send(*over, answer(*request, asked), request->method == "HEAD", request->keep_alive);
            auto unsent = co_await std::move(sending);
            if (unsent || !request->keep_alive) co_return;
            place.wait();
        }
    }

    /// A connection never takes the component down with it.
    static ise::task<> serve(std::shared_ptr<implementation> self, ise::net::admitted accepted) {
        auto who =
            std::move(accepted); // its place goes before the places; the order of parameters differs among compilers
        struct listed {
            std::set<ise::stream*>& all;
            ise::stream* which;
            ~listed() { all.erase(which); }
        } guard{self->open, *self->open.insert(who.line.get()).first};
        auto peer = who.line->peer();
        const auto& limits = self->options.limits;
        http_reader_limits message;
        message.max_head_bytes = limits.max_header_bytes;
        message.max_headers = limits.max_header_fields;
        message.max_body_bytes = limits.max_body_bytes;
        http_times times;
        times.request = times.idle = limits.request_timeout;
        std::string problem;
        try {
            auto over = std::make_shared<conversation>(self->on, std::move(who.line), message, times);
            auto conversing = self->converse(std::move(over), *who.place, peer);
            co_await std::move(conversing);
        } catch (const std::system_error& why) {
            if (why.code() != asio::error::operation_aborted) problem = why.what();
        } catch (const std::exception& why) {
            problem = why.what();
        }
        if (!problem.empty()) self->log_some(fmt::format("a connection of {} ended: {}", peer, problem));
    }

    static ise::task<> accept(std::shared_ptr<implementation> self, std::shared_ptr<ise::listener> from) {
        ise::net::bounded_acceptor entrance(self->on, from, self->places.get(),
                                            [raw = self.get()](const std::string& what, const std::string& at) {
                                                raw->log_some(fmt::format("{}: {}", at, what));
                                            });
        for (;;) {
            auto who = co_await entrance.next();
            if (!who.line) co_return;
            ++self->statistics.connections;
            if (who.refused) continue; // closes it
            auto peer = who.line->peer();
            self->spawn("http " + peer, serve(self, std::move(who)));
        }
    }

    ise::loop& on;
    http_options options;
    spawner spawn;
    ise::log_limiter quiet;
    std::map<std::string, asset, std::less<>> files;
    std::map<std::string, other_name, std::less<>> other_names = {{"/", {"/index.html", false}}};
    std::map<std::string, handler, std::less<>> handlers;
    std::map<std::string, std::unique_ptr<channel>, std::less<>> channels;
    std::unique_ptr<ise::net::fair_places> places; // of the listener; made once, connections hold them
    std::shared_ptr<ise::listener> listener;
    std::set<ise::stream*> open;
    http_statistics statistics;
    bool stopped = false;
};

http_server::http_server(ise::loop& on, http_options options, spawner spawn)
    : self_(std::make_shared<implementation>(on, std::move(options), std::move(spawn))) {}

http_server::~http_server() { stop(); }

void http_server::serve(std::span<const asset> files) {
    for (const auto& file : files) self_->files.insert_or_assign(std::string(file.path), file);
}

void http_server::serve_as(std::string path, std::string file, bool framed) {
    self_->other_names.insert_or_assign(std::move(path), implementation::other_name{std::move(file), framed});
}

void http_server::get(std::string path, handler h) { self_->handlers.insert_or_assign(std::move(path), std::move(h)); }

sse_channel& http_server::events(std::string path, sse_channel::snapshot_source snapshot) {
    auto& place = self_->channels[std::move(path)];
    if (place) throw ise::error(ise::errc::invalid_argument, "web server: two event streams under one path");
    place = std::make_unique<implementation::channel>(std::move(snapshot), self_->options.limits.streams);
    return place->events;
}

void http_server::listen() {
    auto& self = *self_;
    if (self.listener) return;
    const auto& options = self.options;
    std::error_code not_numeric;
    auto address = asio::ip::make_address(options.address, not_numeric);
    if (not_numeric)
        throw ise::error(
            ise::errc::invalid_argument,
            fmt::format("web server: \"{}\" is not a numeric IP address; use such as 127.0.0.1, 0.0.0.0 or ::",
                        options.address));
    auto room = ise::room_for_sockets(options.limits.max_connections);
    if (room < options.limits.max_connections)
        self.log(fmt::format(
            "this process may open too few files for {} viewers: at most {} are served at once; raise the limit "
            "(ulimit -Hn, or LimitNOFILE= of systemd)",
            options.limits.max_connections, room));
    ise::endpoint at;
    at.kind = ise::protocol::tcp;
    at.host = address.to_string();
    at.port = options.port;
    auto made = self.on.env().listen(self.on, at);
    if (!made)
        throw ise::error(made.error().code(), fmt::format("web server: {} (--address {}, --port {})",
                                                          made.error().message(), options.address, options.port));
    self.listener = std::move(*made);
    if (!self.places) self.places = std::make_unique<ise::net::fair_places>(room);
    self.stopped = false;
    self.spawn("http at " + self.listener->where().text(), implementation::accept(self_, self.listener));
}

std::uint16_t http_server::port() const noexcept {
    return self_->listener ? self_->listener->where().port : std::uint16_t{0};
}

std::string http_server::url() const {
    bool v6 = self_->options.address.find(':') != std::string::npos;
    return fmt::format("http://{}{}{}:{}/", v6 ? "[" : "", self_->options.address, v6 ? "]" : "", port());
}

void http_server::stop() noexcept {
    auto& self = *self_;
    self.stopped = true;
    if (auto listener = std::exchange(self.listener, nullptr)) listener->close();
    for (auto& [path, channel] : self.channels) channel->events.close();
    for (auto* line : std::exchange(self.open, {})) line->close();
}

http_statistics http_server::statistics() const noexcept {
    auto counted = self_->statistics;
    counted.open_connections = self_->open.size();
    if (self_->places) {
        counted.connections_refused = self_->places->refused();
        counted.connections_displaced = self_->places->displaced();
    }
    for (const auto& [path, channel] : self_->channels) counted.connections_displaced += channel->places.displaced();
    return counted;
}

} // namespace atirma
