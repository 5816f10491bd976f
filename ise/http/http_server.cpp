#include <ise/http/http_server.hpp>

#include <ise/http/http_answers.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/error.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/readable.hpp>
#include <ise/core/real/room_for_sockets.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/core/waiter.hpp>
#include <ise/net/bounded_acceptor.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <optional>
#include <set>
#include <utility>

namespace ise {
namespace {

constexpr std::size_t max_dropped = 1 << 20; // bytes of a request that was refused
constexpr std::size_t max_turned_away = 32;  // connections at a time that are told so; beyond it they are just closed
constexpr duration time_to_turn_away = std::chrono::seconds(1);

using extra_headers = std::vector<std::pair<std::string, std::string>>;

http_response plain_error(int status, std::string_view what) {
    http_response made;
    made.status = status;
    made.body = fmt::format("{}\n", what);
    return made;
}

/// The first line and the headers that every response has, each ending its line.
std::string head_of(const environment& env, const http_response& of, const std::string& images) {
    auto at = std::chrono::floor<std::chrono::seconds>(env.wall());
    auto head =
        fmt::format("HTTP/1.1 {} {}\r\nDate: {:%a, %d %b %Y %H:%M:%S} GMT\r\nContent-Type: {}\r\n", of.status,
                    reason_of(of.status), fmt::gmtime(std::chrono::system_clock::to_time_t(at)), of.content_type);
    auto add = [&](std::string_view name, std::string_view value) {
        head.append(name).append(": ").append(value).append("\r\n");
    };
    if (!of.download_as.empty())
        add("Content-Disposition", fmt::format("attachment; filename=\"{}\"", safe_file_name(of.download_as)));
    for (const auto& [name, value] : of.headers) add(name, value);
    for (const auto& [name, value] : security_headers(of.framed, images)) add(name, value);
    return head;
}

/// The head of a response with a length.
std::string whole_head(const environment& env, const http_response& of, bool keep, const std::string& images) {
    return fmt::format("{}Content-Length: {}\r\nConnection: {}\r\n\r\n", head_of(env, of, images),
                       of.body.bytes().size(),
                       keep ? "keep-alive" : "close"); // the length of a 304, too: what a 200 would have
}

http_request request_of(http_message message, const std::string& peer) {
    http_request made;
    auto mark = std::min(message.target.find('?'), message.target.size());
    made.path = message.target.substr(0, mark);
    if (mark < message.target.size()) made.query = message.target.substr(mark + 1);
    made.peer = peer;
    made.message = std::move(message);
    return made;
}

http_response response_of(const static_file& file, bool framed) {
    http_response made;
    made.content_type = file.content_type;
    made.body = http_body::in_place(file.bytes);
    made.gzip = http_body::in_place(file.gzip);
    made.etag = file.etag;
    made.framed = framed;
    return made;
}

/// What of a request chooses the form of its response.
struct wished_form {
    bool gzip = false;
    std::string known; ///< If-None-Match
};

wished_form form_of(const http_message& request) {
    return {takes_gzip(request.header("accept-encoding")), std::string(request.header("if-none-match"))};
}

void take_form(http_response& made, const wished_form& wished) {
    bool has_both = !made.gzip.bytes().empty();
    bool packed = has_both && wished.gzip;
    if (has_both) made.headers.emplace_back("Vary", "Accept-Encoding");
    if (packed) made.body = made.gzip;
    bool known = false;
    if (!made.etag.empty()) {
        // The compressed form is another representation, so it has another tag.
        if (packed) made.etag.insert(made.etag.size() - 1, "-gz");
        known = lists_etag(wished.known, made.etag);
        made.headers.emplace_back("ETag", made.etag);
    }
    made.headers.emplace_back("Cache-Control", made.etag.empty() ? "no-store" : "no-cache");
    if (known) made.status = 304;
    else if (packed) made.headers.emplace_back("Content-Encoding", "gzip");
}

http_server::handler in_turn(http_server::quick_handler answer) {
    return [answer = std::move(answer)](http_request asked) -> task<http_response> { co_return answer(asked); };
}

/// Passes one client's events to its connection.
class event_sink final : public sse_sink {
public:
    explicit event_sink(loop& on) : wake_(on) {}

    void write(std::shared_ptr<const std::string> text, written done) override {
        if (closed_) return done(asio::error::not_connected);
        text_ = std::move(text);
        done_ = std::move(done);
        wake_.resume({});
    }
    void close() noexcept override {
        if (std::exchange(closed_, true)) return;
        if (over_) over_->close();
        wake_.resume({});
    }

    static task<> run(std::shared_ptr<event_sink> self, std::shared_ptr<http_stream> over) {
        struct leaving {
            event_sink& mine;
            ~leaving() {
                if (auto left = std::exchange(mine.over_, nullptr)) left->on_closed(nullptr);
            }
        } guard{*self};
        self->over_ = over;
        over->on_closed([raw = self.get()] { raw->close(); });
        while (!self->closed_) {
            if (!self->text_) {
                co_await self->wake_.wait(); // throws what it was resumed with
                continue;
            }
            auto text = std::exchange(self->text_, nullptr);
            auto done = std::exchange(self->done_, nullptr);
            auto unsent = co_await over->write(*text);
            done(unsent);
            if (unsent) co_return;
        }
        over->close();
    }

private:
    waiter<std::error_code> wake_;
    std::shared_ptr<http_stream> over_; ///< while it runs
    std::shared_ptr<const std::string> text_;
    written done_;
    bool closed_ = false;
};

/// The bodies that are being sent, by host.
class unsent_bodies {
public:
    explicit unsent_bodies(std::size_t most) : most_(most) {}

    /// Counts until it is destroyed; before the bodies.
    class part {
    public:
        part(unsent_bodies& in, std::string host, const http_body& what)
            : in_(in), host_(std::move(host)), what_(what) {
            auto& of = in_.hosts_[host_];
            if (of.bodies[what_.owned()]++ == 0) of.bytes += what_.bytes().size();
        }
        ~part() {
            auto found = in_.hosts_.find(host_);
            auto& of = found->second;
            if (--of.bodies[what_.owned()] == 0) {
                of.bodies.erase(what_.owned());
                of.bytes -= what_.bytes().size();
            }
            if (of.bodies.empty()) in_.hosts_.erase(found);
        }
        part(const part&) = delete;
        part& operator=(const part&) = delete;

    private:
        unsent_bodies& in_;
        std::string host_;
        http_body what_;
    };

    /// Whether a host that takes nothing meanwhile may have it, too.
    bool fits(const std::string& host, const http_body& what) const {
        auto found = hosts_.find(host);
        if (found == hosts_.end() || found->second.bodies.contains(what.owned())) return true;
        return found->second.bytes + what.bytes().size() <= most_;
    }

private:
    struct of_host {
        std::size_t bytes = 0;
        std::map<const std::string*, std::size_t> bodies;
    };
    std::size_t most_;
    std::map<std::string, of_host> hosts_;
};

/// A path with an event stream.
struct event_path {
    event_path(sse_channel::snapshot_source source, sse_limits limits)
        : events(std::move(source), limits), places(limits.max_clients) {}
    sse_channel events;
    net::fair_places places;
};

/// One client of an event stream.
struct event_client {
    event_client(loop& on, sse_channel& of) : from(of), sink(std::make_shared<event_sink>(on)) {}
    ~event_client() {
        from.remove(sink.get());
        sink->close();
    }
    event_client(const event_client&) = delete;
    event_client& operator=(const event_client&) = delete;

    sse_channel& from;
    std::shared_ptr<event_sink> sink;
    std::unique_ptr<net::fair_places::place> place;
};

} // namespace

struct http_server::implementation : std::enable_shared_from_this<implementation> {
    implementation(loop& on_, logger to, http_limits chosen, spawner start)
        : on(on_), log(std::move(to)), limits(chosen), spawn(std::move(start)),
          unsent_by_host(chosen.max_unsent_bytes) {}

    struct other_name {
        std::string file;
        bool framed = false;
        std::string link;
    };

    time_point after(duration time) const { return saturating_add(on.now(), time); }

    void note(std::string_view what, const std::string& peer) {
        if (auto left_out = quiet.admit(on.now()))
            log.warning(what, {{"peer", peer}, {"left_out", std::to_string(*left_out)}});
    }

    http_response error(int status, std::string_view what, extra_headers headers = extra_headers()) const {
        auto made = error_text(status, what);
        made.status = status;
        made.headers.insert(made.headers.end(), headers.begin(), headers.end());
        made.headers.emplace_back("Cache-Control", "no-store");
        return made;
    }

    /// With what the path says of it, if it is another name.
    std::pair<const static_file*, const other_name*> find_file(const std::string& path) const {
        auto other = other_names.find(path);
        bool named = other != other_names.end();
        auto file = files.find(named ? other->second.file : path);
        return {file == files.end() ? nullptr : &file->second, named ? &other->second : nullptr};
    }

    http_response open_events(event_path& of, const http_request& asked) {
        http_response made;
        made.content_type = "text/event-stream; charset=utf-8";
        made.headers = {{"Cache-Control", "no-store"}, {"X-Accel-Buffering", "no"}};
        if (asked.message.method == "HEAD") return made;
        auto client = std::make_shared<event_client>(on, of.events);
        if (!stopped) client->place = of.places.take(asked.peer);
        bool added = false;
        if (client->place) {
            client->place->serve();
            client->place->on_displaced([&of, raw = client->sink.get()] { of.events.remove(raw); });
            // A page that opens a new stream by itself cannot set the header, so `?last=` stands for it.
            std::string last_seen(asked.message.header("last-event-id"));
            if (last_seen.empty() && asked.query.starts_with("last=")) last_seen = asked.query.substr(5);
            added = of.events.add(client->sink, last_seen);
        }
        if (!added)
            return error(503, "Too many people are watching right now. Try again in a minute.",
                         {{"Retry-After", "30"}});
        made.stream = [client](std::shared_ptr<http_stream> over) {
            return event_sink::run(client->sink, std::move(over));
        };
        return made;
    }

    /// What answers a request by itself; null where a file, an event stream or an error does.
    const handler* handler_of(const http_request& asked) const {
        auto known = handlers.find(asked.path);
        if (known != handlers.end()) return reads(asked) ? &known->second : nullptr;
        bool elsewhere = channels.contains(asked.path) || find_file(asked.path).first;
        return fallback && !elsewhere ? &fallback : nullptr;
    }
    static bool reads(const http_request& asked) {
        return asked.message.method == "GET" || asked.message.method == "HEAD";
    }

    http_response answer(const http_request& asked) {
        if (!reads(asked)) return error(405, "Only GET and HEAD are allowed here.", {{"Allow", "GET, HEAD"}});
        if (auto of = channels.find(asked.path); of != channels.end()) return open_events(*of->second, asked);
        if (auto [file, name] = find_file(asked.path); file) {
            auto made = response_of(*file, name && name->framed);
            if (name && !name->link.empty()) made.headers.emplace_back("Link", name->link);
            take_form(made, form_of(asked.message));
            return made;
        }
        return error(404, "There is no such page.");
    }

    task<http_response> respond(http_request asked) {
        http_response made;
        const auto* by = handler_of(asked);
        if (by) {
            auto wished = form_of(asked.message);
            auto answering = (*by)(std::move(asked));
            made = co_await std::move(answering);
            if (made.status != 101) take_form(made, wished);
        } else {
            made = answer(asked);
        }
        co_return made;
    }

    task<std::error_code> send(http_requests& over, http_response what, bool with_body, bool keep) {
        auto head = whole_head(on.env(), what, keep, images);
        std::vector<std::string_view> pieces(1, head);
        if (with_body && what.status != 304) pieces.push_back(what.body.bytes());
        over.line().until(after(limits.sending.write));
        auto unsent = co_await over.line().write_all(std::move(pieces));
        co_return unsent;
    }

    task<> stream(std::shared_ptr<http_requests> over, http_response what, bool chunked, std::string peer) {
        over->line().on_late(nullptr);
        what.headers.emplace_back("Connection", "close");
        if (chunked) what.headers.emplace_back("Transfer-Encoding", "chunked");
        auto body = std::make_shared<http_stream>(on, std::move(over), head_of(on.env(), what, images) + "\r\n",
                                                  chunked, limits.sending);
        struct leaving {
            http_stream& which;
            ~leaving() { which.close(); }
        } guard{*body};
        spawn("watches " + peer, http_stream::watch(body));
        auto running = what.stream(body);
        co_await std::move(running);
        co_await body->finish();
    }

    task<> upgrade(std::shared_ptr<http_requests> over, http_response what, std::string peer) {
        over->line().on_late(nullptr);
        std::string head = "HTTP/1.1 101 Switching Protocols\r\n";
        for (const auto& [name, value] : what.headers) head.append(name).append(": ").append(value).append("\r\n");
        head += "\r\n";
        over->line().until(after(limits.sending.write));
        auto unsent = co_await over->line().write_all(head);
        if (unsent) co_return;
        ++statistics.web_sockets;
        auto socket = std::make_shared<web_socket>(on, std::move(over), limits.web_sockets, limits.web_socket);
        struct leaving {
            web_socket& which;
            ~leaving() {
                which.on_room(nullptr);
                which.abort();
            }
        } guard{*socket};
        spawn("writes to " + peer, web_socket::write(socket));
        auto talking = what.upgrade(socket);
        co_await std::move(talking);
        if (!socket->cause().empty()) note(fmt::format("a WebSocket was closed: {}", socket->cause()), peer);
    }

    /// Gives the reason before the end: a client that is still sending would lose it.
    task<> refuse(http_requests& over, http_response why) {
        over.line().on_late(nullptr); // one answer is enough
        auto sending = send(over, std::move(why), true, false);
        co_await std::move(sending);
        over.line().line().shutdown_write();
        co_await over.line().drop_rest(max_dropped);
    }

    task<> converse(std::shared_ptr<http_requests> over, net::fair_places::place& place, std::string peer) {
        over->line().on_late([this, raw = over.get()] {
            if (!raw->under_way()) return;
            auto text = text_of_error(408, "The request did not come to its end in time.");
            asio::const_buffer all(text.data(), text.size());
            raw->line().line().try_write(std::span(&all, 1));
        });
        for (std::size_t served = 1;; ++served) {
            auto message = co_await over->next();
            if (!message) {
                const auto& refused = over->refused();
                if (place.displaced())
                    note(fmt::format("{} connections are open (max_connections): the oldest idle one of the host with "
                                     "the most was closed",
                                     places->most()),
                         peer);
                if (!refused) co_return;
                ++statistics.requests_refused;
                note(fmt::format("a request is refused ({}): {}", refused->status, refused->why), peer);
                if (refused->status == 408) co_return; // answered, and closed
                auto refusing = refuse(*over, error(refused->status, refused->why));
                co_await std::move(refusing);
                co_return;
            }
            if (stopped) co_return; // it had come before the connection was closed
            place.serve();
            ++statistics.requests;
            bool keep = message->keep_alive && served < limits.max_requests;
            bool chunks = message->takes_chunks;
            bool with_body = message->method != "HEAD";
            auto what = fmt::format("{} {}", message->method, message->target);
            http_response made;
            std::optional<std::string> failed;
            over->line().until(time_point::max());
            try {
                auto responding = respond(request_of(std::move(*message), peer));
                made = co_await std::move(responding);
            } catch (const std::exception& why) {
                if (is_cancellation(std::current_exception())) throw;
                failed = why.what();
            }
            if (failed) {
                ++statistics.handlers_failed;
                if (auto left_out = quiet_failures.admit(on.now()))
                    log.warning(fmt::format("{} failed: {}", what, *failed),
                                {{"peer", peer}, {"left_out", std::to_string(*left_out)}});
                made = error(500, "The server could not answer. It was logged.");
            }
            if (made.upgrade && made.status == 101) {
                auto upgrading = upgrade(over, std::move(made), peer);
                co_await std::move(upgrading);
                co_return;
            }
            if (made.stream && with_body) {
                auto streaming = stream(over, std::move(made), chunks, peer);
                co_await std::move(streaming);
                co_return;
            }
            std::optional<unsent_bodies::part> counted;
            if (with_body && made.body.owned()) {
                auto host = net::host_of(peer);
                if (unsent_by_host.fits(host, made.body)) {
                    counted.emplace(unsent_by_host, host, made.body);
                } else {
                    note(fmt::format("more than {} bytes wait for one host, which does not take them "
                                     "(max_unsent_bytes): it gets no more",
                                     limits.max_unsent_bytes),
                         peer);
                    made = error(503, "Your host has not taken what it asked for. Try again in a minute.",
                                 {{"Retry-After", "60"}});
                }
            }
            auto sending = send(*over, std::move(made), with_body, keep);
            auto unsent = co_await std::move(sending);
            if (unsent || !keep) co_return;
            place.wait();
        }
    }

    /// A connection never takes the component down with it.
    static task<> serve(std::shared_ptr<implementation> self, net::admitted accepted) {
        // Its place goes before the places; the order of parameters differs among compilers.
        auto who = std::move(accepted);
        struct listed {
            std::set<ise::stream*>& all;
            ise::stream* which;
            ~listed() { all.erase(which); }
        } guard{self->open, *self->open.insert(who.line.get()).first};
        auto peer = who.line->peer();
        std::string problem;
        try {
            auto over = std::make_shared<http_requests>(self->on, std::move(who.line), self->limits.message,
                                                        self->limits.times);
            auto conversing = self->converse(std::move(over), *who.place, peer);
            co_await std::move(conversing);
        } catch (const std::exception& why) {
            if (!is_cancellation(std::current_exception())) problem = why.what();
        }
        if (!problem.empty()) self->note("a connection ended: " + problem, peer);
    }

    std::string text_of_error(int status, std::string_view what, extra_headers headers = extra_headers()) const {
        auto made = error(status, what, std::move(headers));
        return whole_head(on.env(), made, false, images).append(made.body.bytes());
    }

    static task<> turn_away(std::shared_ptr<implementation> self, std::unique_ptr<ise::stream> stranger) {
        struct counted {
            std::size_t& count;
            explicit counted(std::size_t& of) : count(of) { ++count; }
            ~counted() { --count; }
        } here(self->turned_away);
        line_with_deadline line(self->on, std::move(stranger));
        line.until(self->after(time_to_turn_away));
        auto text = self->text_of_error(503, "Too many connections. Try again in a minute.");
        co_await line.write_all(text);
        line.line().shutdown_write();
        co_await line.drop_rest(max_dropped);
    }

    void take(net::admitted who) {
        if (stopped) return; // accepted just before: it is closed
        ++statistics.connections;
        auto peer = who.line->peer();
        if (!who.refused) return spawn("http " + peer, serve(shared_from_this(), std::move(who)));
        note(fmt::format("{} connections are open: another one is turned away", places->taken()), peer);
        if (turned_away < max_turned_away) spawn("http " + peer, turn_away(shared_from_this(), std::move(who.line)));
    }

    loop& on;
    logger log;
    http_limits limits;
    spawner spawn;
    unsent_bodies unsent_by_host;
    log_limiter quiet, quiet_failures; // of peers, of handlers
    error_page error_text = plain_error;
    std::string images; ///< origins that pages may load pictures from, besides this server
    std::map<std::string, static_file, std::less<>> files;
    std::map<std::string, other_name, std::less<>> other_names = {{"/", {"/index.html", false, {}}}};
    std::map<std::string, handler, std::less<>> handlers;
    std::map<std::string, std::unique_ptr<event_path>, std::less<>> channels;
    handler fallback;
    std::unique_ptr<net::fair_places> places; // of the listener; made once, connections hold them
    std::shared_ptr<ise::listener> listener;
    std::set<ise::stream*> open;
    std::size_t turned_away = 0;
    http_statistics statistics;
    bool stopped = false;
};

http_response accept_web_socket(const http_request& asked, const std::vector<std::string>& protocols,
                                std::function<task<>(std::shared_ptr<web_socket>)> talk) {
    const auto& request = asked.message;
    if (request.method != "GET" || !lists_token(request.header("upgrade"), "websocket") ||
        !lists_token(request.header("connection"), "upgrade")) {
        auto made = plain_error(426, "This address takes WebSockets only.");
        made.headers.emplace_back("Upgrade", "websocket");
        return made;
    }
    if (request.header("sec-websocket-version") != "13") {
        auto made = plain_error(426, "Only version 13 of the WebSocket protocol (RFC 6455) is spoken here.");
        made.headers.emplace_back("Sec-WebSocket-Version", "13");
        return made;
    }
    if (!is_web_socket_key(request.header("sec-websocket-key")))
        return plain_error(400, "Sec-WebSocket-Key is not 16 bytes in base64.");
    auto offered = request.header("sec-websocket-protocol");
    auto chosen = std::ranges::find_if(protocols, [&](const auto& one) { return lists_token(offered, one); });
    if (!protocols.empty() && chosen == protocols.end())
        return plain_error(400, fmt::format("None of the subprotocols offered ({}) is spoken here: {}.",
                                            offered.empty() ? "none" : readable(offered), fmt::join(protocols, ", ")));
    http_response made;
    made.status = 101;
    made.headers = {{"Upgrade", "websocket"},
                    {"Connection", "Upgrade"},
                    {"Sec-WebSocket-Accept", web_socket_accept(request.header("sec-websocket-key"))}};
    if (chosen != protocols.end()) made.headers.emplace_back("Sec-WebSocket-Protocol", *chosen);
    made.upgrade = std::move(talk);
    return made;
}

http_server::http_server(loop& on, logger log, http_limits limits, spawner spawn)
    : self_(std::make_shared<implementation>(on, std::move(log), limits, std::move(spawn))) {}

http_server::~http_server() { stop(); }

void http_server::serve(std::span<const static_file> files) {
    for (const auto& file : files) self_->files.insert_or_assign(std::string(file.path), file);
}

void http_server::serve_as(std::string path, std::string file, bool framed, std::string link) {
    self_->other_names.insert_or_assign(std::move(path),
                                        implementation::other_name{std::move(file), framed, std::move(link)});
}

void http_server::get(std::string path, handler answer) {
    self_->handlers.insert_or_assign(std::move(path), std::move(answer));
}

void http_server::get(std::string path, quick_handler answer) { get(std::move(path), in_turn(std::move(answer))); }

void http_server::otherwise(quick_handler answer) { otherwise(in_turn(std::move(answer))); }

void http_server::otherwise(handler answer) { self_->fallback = std::move(answer); }

void http_server::allow_images(std::string origin) { self_->images.append(" ").append(origin); }

void http_server::on_error(error_page page) { self_->error_text = std::move(page); }

sse_channel& http_server::events(std::string path, sse_channel::snapshot_source snapshot) {
    auto& place = self_->channels[path];
    if (place) throw error(errc::invalid_argument, fmt::format("two event streams under one path: {}", path));
    place = std::make_unique<event_path>(std::move(snapshot), self_->limits.streams);
    return place->events;
}

result<void> http_server::listen(const endpoint& at) {
    auto& self = *self_;
    auto made = self.on.env().listen(self.on, at);
    if (!made) return made.error();
    self.listener = std::move(*made);
    if (!self.places) {
        auto wanted = self.limits.max_connections;
        auto room = self.on.env().is_virtual() ? wanted : room_for_sockets(wanted);
        if (room < wanted)
            self.log.warning(
                fmt::format("this process may open too few files for {} connections: at most {} are served "
                            "at once; raise the limit (ulimit -Hn, or LimitNOFILE= of systemd)",
                            wanted, room));
        self.places = std::make_unique<net::fair_places>(room);
    }
    self.stopped = false;
    self.spawn("http at " + where().text(),
               net::accept_each(self.on, self.listener, self.places.get(), net::log_to(self.on, self.log),
                                [self = self_](net::admitted who) { self->take(std::move(who)); }));
    return {};
}

endpoint http_server::where() const { return self_->listener ? self_->listener->where() : endpoint(); }

std::string http_server::url() const {
    auto at = where();
    bool v6 = at.host.find(':') != std::string::npos;
    return fmt::format("http://{}{}{}:{}/", v6 ? "[" : "", at.host, v6 ? "]" : "", at.port);
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

} // namespace ise
