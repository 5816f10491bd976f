// The only file that sees RESTinio.
#include <components/web_server/http_server.hpp>

#include <components/web_server/http_answers.hpp>
#include <components/web_server/room_for_sockets.hpp>
#include <components/web_server/tracked_socket.hpp>

#include <ise/core/error.hpp>

#include <fmt/format.h>
#include <restinio/asio_timer_manager.hpp>
#include <restinio/http_server.hpp>
#include <restinio/message_builders.hpp>
#include <restinio/null_logger.hpp>

#include <map>
#include <unordered_map>

namespace atirma {

namespace {

/// A connection that RESTinio closed (the client left, a time limit passed) takes its stream along.
struct connection_watch {
    std::function<void(restinio::connection_id_t)> closed;

    void state_changed(const restinio::connection_state::notice_t& notice) {
        if (closed && restinio::holds_alternative<restinio::connection_state::closed_t>(notice.cause()))
            closed(notice.connection_id());
    }
};

struct server_traits
    : restinio::traits_t<restinio::asio_timer_manager_t, restinio::null_logger_t, restinio::default_request_handler_t,
                         restinio::noop_strand_t, tracked_socket> {
    using connection_state_listener_t = connection_watch;
};
using restinio_server = restinio::http_server_t<server_traits>;
using stream_response = restinio::response_builder_t<restinio::chunked_output_t>;

/// One client's event stream as a chunked response.
class stream_sink final : public sse_sink {
public:
    explicit stream_sink(stream_response response) : response_(std::move(response)) {}

    void write(std::shared_ptr<const std::string> text, written done) override {
        if (!response_) return done(asio::error::not_connected);
        response_->append_chunk(restinio::writable_item_t(std::move(text)));
        response_->flush([done = std::move(done)](const asio::error_code& failed) { done(failed); });
    }
    void close() noexcept override {
        if (!response_) return;
        auto last = std::move(*response_);
        response_.reset();
        restinio::utils::suppress_exceptions_quietly([&] { last.done(); });
    }

private:
    std::optional<stream_response> response_;
};

} // namespace

struct http_server::implementation : std::enable_shared_from_this<implementation> {
    implementation(asio::io_context& context_, http_options chosen) : context(context_), options(std::move(chosen)) {}

    struct body_view {
        std::string_view content_type;
        std::shared_ptr<const std::string> owned; ///< or
        std::string_view borrowed;                ///< bytes of the binary
        std::size_t size() const { return owned ? owned->size() : borrowed.size(); }
    };

    using headers = std::vector<std::pair<std::string, std::string>>;

    /// Every answer that is no stream goes through here.
    void reply(const restinio::request_handle_t& request, int status, body_view body, const headers& extra = {},
               bool framed = false) {
        auto line = restinio::http_status_line_t(restinio::http_status_code_t(static_cast<std::uint16_t>(status)),
                                                 std::string(reason_of(status)));
        auto response = request->create_response<restinio::user_controlled_output_t>(std::move(line));
        response.append_header_date_field();
        response.append_header(restinio::http_field::content_type, std::string(body.content_type));
        for (const auto& [name, value] : extra) response.append_header(name, value);
        with_security_headers(response, framed);
        response.set_content_length(body.size()); // of a 304 too: what a 200 would have
        if (status != 304 && request->header().method() != restinio::http_method_head() && body.size() != 0) {
            if (body.owned) response.append_body(restinio::writable_item_t(std::move(body.owned)));
            else
                response.append_body(
                    restinio::writable_item_t(restinio::const_buffer(body.borrowed.data(), body.borrowed.size())));
        }
        response.done();
    }

    void fail(const restinio::request_handle_t& request, int status, std::string_view what, headers extra = {}) {
        extra.emplace_back("Cache-Control", "no-store");
        reply(request, status,
              {"text/html; charset=utf-8", std::make_shared<const std::string>(error_page(status, what)), {}}, extra);
    }

    void send_asset(const restinio::request_handle_t& request, const asset& file, bool framed) {
        const auto& header = request->header();
        bool packed =
            !file.gzip.empty() && takes_gzip(header.get_field_or(restinio::http_field::accept_encoding, std::string()));
        // The compressed form is another representation, so it has another tag.
        std::string tag(file.etag);
        if (packed) tag.insert(tag.size() - 1, "-gz");
        headers extra = {{"ETag", tag}, {"Cache-Control", "no-cache"}, {"Vary", "Accept-Encoding"}};
        if (lists_etag(header.get_field_or(restinio::http_field::if_none_match, std::string()), tag))
            return reply(request, 304, {file.content_type, nullptr, packed ? file.gzip : file.bytes}, extra, framed);
        if (packed) extra.emplace_back("Content-Encoding", "gzip");
        reply(request, 200, {file.content_type, nullptr, packed ? file.gzip : file.bytes}, extra, framed);
    }

    void send_handled(const restinio::request_handle_t& request, const handler& h, const http_request& asked) {
        http_reply made;
        try {
            made = h(asked);
        } catch (const std::exception& why) {
            ++statistics.handlers_failed;
            if (options.log) options.log(fmt::format("GET {} failed: {}", asked.path, why.what()));
            return fail(request, 500, "The server could not make this page. It was logged.");
        }
        headers extra = {{"Cache-Control", "no-store"}};
        if (!made.download_as.empty())
            extra.emplace_back("Content-Disposition",
                               fmt::format("attachment; filename=\"{}\"", safe_file_name(made.download_as)));
        reply(request, made.status, {made.content_type, std::make_shared<const std::string>(std::move(made.body)), {}},
              extra);
    }

    std::pair<const asset*, bool> find_file(const std::string& path) const {
        auto other = other_names.find(path);
        auto file = files.find(other == other_names.end() ? path : other->second.file);
        if (file == files.end()) return {nullptr, false};
        return {&file->second, other != other_names.end() && other->second.framed};
    }

    void open_stream(const restinio::request_handle_t& request, sse_channel& channel) {
        if (request->header().method() == restinio::http_method_head())
            return reply(request, 200, {"text/event-stream", nullptr, {}}, {{"Cache-Control", "no-store"}});
        if (stopped || channel.clients() >= options.limits.streams.max_clients)
            return fail(request, 503, "Too many people are watching right now. Try again in a minute.",
                        {{"Retry-After", "30"}});
        // A page that opens a new stream by itself cannot set the header, so `?last=` stands for it.
        auto last_seen = request->header().get_field_or("Last-Event-ID", std::string());
        std::string_view query(request->header().query().data(), request->header().query().size());
        if (last_seen.empty() && query.starts_with("last=")) last_seen = query.substr(5);
        auto response = request->create_response<restinio::chunked_output_t>();
        response.append_header(restinio::http_field::content_type, "text/event-stream; charset=utf-8");
        response.append_header(restinio::http_field::cache_control, "no-store");
        response.append_header("X-Accel-Buffering", "no");
        with_security_headers(response);
        auto sink = std::make_shared<stream_sink>(std::move(response));
        streams[request->connection_id()] = {&channel, sink};
        if (!channel.add(sink, last_seen)) sink->close();
    }

    restinio::request_handling_status_t handle(const restinio::request_handle_t& request) {
        ++statistics.requests;
        const auto& header = request->header();
        std::string path(header.path());
        if (header.method() != restinio::http_method_get() && header.method() != restinio::http_method_head()) {
            fail(request, 405, "This server is read-only.", {{"Allow", "GET, HEAD"}});
            return restinio::request_accepted();
        }
        try {
            if (auto channel = channels.find(path); channel != channels.end()) open_stream(request, *channel->second);
            else if (auto h = handlers.find(path); h != handlers.end())
                send_handled(request, h->second, {path, std::string(header.query())});
            else if (auto [file, framed] = find_file(path); file) send_asset(request, *file, framed);
            else fail(request, 404, "There is no such page.");
        } catch (const std::exception& why) { // a snapshot that could not be made
            ++statistics.handlers_failed;
            if (options.log) options.log(fmt::format("GET {} failed: {}", path, why.what()));
            throw; // RESTinio closes the connection
        }
        return restinio::request_accepted();
    }

    void on_connection_closed(restinio::connection_id_t id) {
        auto known = streams.find(id);
        if (known == streams.end()) return;
        auto [channel, sink] = known->second;
        streams.erase(known);
        channel->remove(sink.get());
    }

    /// Called for each accepted socket, before anything is read from it; throwing closes it.
    void admit() {
        ++statistics.connections;
        if (registry->open() > options.limits.max_connections) {
            ++statistics.connections_refused;
            throw std::runtime_error("too many connections");
        }
    }

    std::unique_ptr<restinio_server> make_server();

    struct stream {
        sse_channel* channel;
        std::shared_ptr<sse_sink> sink;
    };

    asio::io_context& context;
    http_options options;
    struct other_name {
        std::string file;
        bool framed = false;
    };
    std::map<std::string, asset, std::less<>> files;
    std::map<std::string, other_name, std::less<>> other_names = {{"/", {"/index.html", false}}};
    std::map<std::string, handler, std::less<>> handlers;
    std::map<std::string, std::unique_ptr<sse_channel>, std::less<>> channels;
    std::unordered_map<restinio::connection_id_t, stream> streams;
    std::shared_ptr<socket_registry> registry = std::make_shared<socket_registry>();
    std::unique_ptr<restinio_server> server;
    http_statistics statistics;
    std::uint16_t bound_port = 0;
    bool stopped = false;
};

std::unique_ptr<restinio_server> http_server::implementation::make_server() {
    std::error_code bad_address;
    auto address = asio::ip::make_address(options.address, bad_address);
    if (bad_address)
        throw ise::error(
            ise::errc::invalid_argument,
            fmt::format("web server: \"{}\" is no numeric IP address; use such as 127.0.0.1, 0.0.0.0 or ::",
                        options.address));
    // Connections may live on in the loop for a turn after this object: they hold it weakly.
    auto weak = weak_from_this();
    auto watch = std::make_shared<connection_watch>();
    watch->closed = [weak](restinio::connection_id_t id) {
        if (auto self = weak.lock()) self->on_connection_closed(id);
    };
    restinio::server_settings_t<server_traits> settings;
    settings.address(address)
        .protocol(address.is_v6() ? asio::ip::tcp::v6() : asio::ip::tcp::v4())
        .port(options.port)
        .read_next_http_message_timelimit(options.limits.request_timeout)
        .write_http_response_timelimit(options.limits.write_timeout)
        .handle_request_timeout(options.limits.silent_stream_timeout) // only streams are ever unfinished
        // While a stream is open the connection goes on reading, and so notices at once that a client left.
        .max_pipelined_requests(2)
        .incoming_http_msg_limits(restinio::incoming_http_msg_limits_t{}
                                      .max_url_size(options.limits.max_url_bytes)
                                      .max_field_name_size(256)
                                      .max_field_value_size(options.limits.max_header_value_bytes)
                                      .max_field_count(options.limits.max_header_fields)
                                      .max_body_size(options.limits.max_body_bytes))
        .connection_state_listener(watch)
        .acceptor_options_setter([](restinio::acceptor_options_t& acceptor) {
            acceptor.set_option(asio::ip::tcp::acceptor::reuse_address(true));
        })
        .acceptor_post_bind_hook([weak](asio::ip::tcp::acceptor& acceptor) {
            if (auto self = weak.lock()) self->bound_port = acceptor.local_endpoint().port();
        })
        .socket_options_setter([weak](restinio::socket_options_t& socket) {
            socket.set_option(asio::ip::tcp::no_delay(true));
            if (auto self = weak.lock()) self->admit();
        })
        .request_handler([weak](restinio::request_handle_t request) {
            auto self = weak.lock();
            return self ? self->handle(request) : restinio::request_rejected();
        });
    tracked_socket::current = registry;
    auto made = std::make_unique<restinio_server>(restinio::external_io_context(context), std::move(settings));
    tracked_socket::current.reset();
    return made;
}

http_server::http_server(asio::io_context& context, http_options options)
    : self_(std::make_shared<implementation>(context, std::move(options))) {}

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
    place = std::make_unique<sse_channel>(std::move(snapshot), self_->options.limits.streams);
    return *place;
}

void http_server::listen() {
    auto& self = *self_;
    if (self.server) return;
    if (auto poor = make_room_for_sockets(self.options.limits.max_connections); !poor.empty() && self.options.log)
        self.options.log(poor);
    auto server = self.make_server();
    try {
        server->open_sync();
    } catch (const std::system_error& why) {
        self.bound_port = 0;
        // Asio 1.22's own category does not compare with std::errc; the system's does, and the numbers are the same.
        std::error_code code(why.code().value(), std::system_category());
        auto cause = ise::io_failure(
            fmt::format("web server: cannot listen on {} port {}", self.options.address, self.options.port), code);
        throw ise::error(cause);
    }
    self.server = std::move(server);
    self.stopped = false;
}

std::uint16_t http_server::port() const noexcept { return self_->bound_port; }

std::string http_server::url() const {
    bool v6 = self_->options.address.find(':') != std::string::npos;
    return fmt::format("http://{}{}{}:{}/", v6 ? "[" : "", self_->options.address, v6 ? "]" : "", port());
}

void http_server::stop() noexcept {
    auto& self = *self_;
    self.stopped = true;
    self.bound_port = 0;
    for (auto& [path, channel] : self.channels) channel->close();
    self.streams.clear();
    if (self.server) {
        restinio::utils::suppress_exceptions_quietly([&] { self.server->close_sync(); });
        self.server.reset();
    }
    self.registry->close_all();
}

http_statistics http_server::statistics() const noexcept {
    auto counted = self_->statistics;
    counted.open_connections = self_->registry->open();
    return counted;
}

} // namespace atirma
