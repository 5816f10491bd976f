// environment-boundary: libmosquitto owns its socket
#include <components/mqtt_bridge/broker_session.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/url.hpp>
#include <ise/core/waiter.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <fmt/format.h>

#include <fcntl.h>
#include <mosquitto.h>
#include <mqtt_protocol.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <map>
#include <mutex>
#include <new>

namespace ise::mqtt {
namespace {

constexpr std::size_t max_file = 64 * 1024;
constexpr duration retry_write = std::chrono::milliseconds(50); // while TLS waits for the other side
constexpr int packets_at_once = 64;                             // read in one turn
constexpr int most_unconfirmed = 256;

struct library {
    library() { mosquitto_lib_init(); }
};

struct destroy {
    void operator()(mosquitto* what) const { mosquitto_destroy(what); }
};

/// The properties of a message to be sent.
class property_list {
public:
    property_list() = default;
    property_list(const property_list&) = delete;
    property_list& operator=(const property_list&) = delete;
    ~property_list() { mosquitto_property_free_all(&list_); }
    void text(int which, const std::string& value) {
        if (!value.empty()) check(mosquitto_property_add_string(&list_, which, value.c_str()));
    }
    void binary(int which, const std::string& value) {
        if (!value.empty())
            check(mosquitto_property_add_binary(&list_, which, value.data(), static_cast<std::uint16_t>(value.size())));
    }
    void number(int which, std::uint32_t value) { check(mosquitto_property_add_int32(&list_, which, value)); }
    void pair(const std::string& name, const std::string& value) {
        check(mosquitto_property_add_string_pair(&list_, MQTT_PROP_USER_PROPERTY, name.c_str(), value.c_str()));
    }
    const mosquitto_property* get() const noexcept { return list_; }
    int wrong() const noexcept { return wrong_; }

private:
    void check(int code) {
        if (code != MOSQ_ERR_SUCCESS) wrong_ = code;
    }
    mosquitto_property* list_ = nullptr;
    int wrong_ = MOSQ_ERR_SUCCESS;
};

std::string text_of(const mosquitto_property* from, int which) {
    char* value = nullptr;
    if (!mosquitto_property_read_string(from, which, &value, false) || !value) return {};
    std::string made(value);
    std::free(value); // NOLINT: libmosquitto allocates by malloc
    return made;
}

std::string binary_of(const mosquitto_property* from, int which) {
    void* value = nullptr;
    std::uint16_t size = 0;
    if (!mosquitto_property_read_binary(from, which, &value, &size, false) || !value) return {};
    std::string made(static_cast<const char*>(value), size);
    std::free(value); // NOLINT
    return made;
}

failure bad_option(std::string text) { return failure(errc::invalid_argument, std::move(text)); }

/// The broker wants the same message again later: a quota, or an error of its own.
bool is_temporary(int reason) noexcept {
    return reason == MQTT_RC_UNSPECIFIED || reason == MQTT_RC_IMPLEMENTATION_SPECIFIC ||
           reason == MQTT_RC_QUOTA_EXCEEDED;
}

class mosquitto_session final : public broker_session {
    /// Completion handlers of Asio hold a weak reference to it.
    struct watch {
        watch(const asio::any_io_executor& on, int socket) : descriptor(on, socket) {}
        asio::posix::stream_descriptor descriptor; // a duplicate: libmosquitto closes its own
        bool reading = false, writing = false;
    };

public:
    mosquitto_session(loop& on, broker_options options, session_events events)
        : loop_(on), options_(std::move(options)), events_(std::move(events)), wake_(on),
          misc_(on, [this] { look_after(); }), later_(on, [this] { write(); }) {}
    ~mosquitto_session() override {
        watch_.reset();
        handle_.reset();
    }

    static task<result<std::unique_ptr<broker_session>>> connect(component& self, broker_options options,
                                                                 session_events events) {
        auto made = std::make_unique<mosquitto_session>(self.on(), std::move(options), std::move(events));
        if (auto ready = made->configure(self.env()); !ready) co_return ready.error();
        auto* raw = made.get();
        auto begin = [raw] { return raw->begin(); };
        int code = co_await self.offload(std::move(begin));
        if (code != MOSQ_ERR_SUCCESS)
            co_return failure(errc::unreachable, fmt::format("{}: {}", raw->server_, raw->trouble(code, raw->errno_)));
        if (auto watched = raw->watch_socket(self.get_executor()); !watched) co_return watched.error();
        bool late = false;
        timer alarm(self.on(), [&] {
            late = true;
            raw->wake_.resume({});
        });
        alarm.arm(saturating_add(self.now(), raw->options_.connect_limit));
        while (!raw->accepted_ && !raw->why_ && !late) co_await raw->wake_.wait(); // throws what it is resumed with
        if (raw->why_) co_return *raw->why_;
        if (!raw->accepted_)
            co_return failure(errc::timed_out,
                              fmt::format("{}: no answer within {} s (is that an MQTT broker, and is TLS as it wants "
                                          "it?)",
                                          raw->server_,
                                          std::chrono::duration<double>(raw->options_.connect_limit).count()));
        raw->established_ = true;
        co_return std::unique_ptr<broker_session>(std::move(made));
    }

    result<int> publish(const message& what) override {
        if (why_) return *why_;
        property_list with;
        if (options_.version_5) {
            with.text(MQTT_PROP_CONTENT_TYPE, what.content_type);
            with.binary(MQTT_PROP_CORRELATION_DATA, what.correlation);
            if (what.expiry_s) with.number(MQTT_PROP_MESSAGE_EXPIRY_INTERVAL, *what.expiry_s);
            for (const auto& [name, value] : what.user) with.pair(name, value);
            if (with.wrong()) return refusal(what, with.wrong());
        }
        int token = 0;
        int code =
            mosquitto_publish_v5(handle_.get(), &token, what.topic.c_str(), static_cast<int>(what.payload.size()),
                                 what.payload.data(), 1, what.retain, with.get());
        want();
        if (code == MOSQ_ERR_SUCCESS) return token;
        if (code == MOSQ_ERR_NO_CONN || code == MOSQ_ERR_CONN_LOST || code == MOSQ_ERR_ERRNO ||
            code == MOSQ_ERR_NOMEM) {
            close(failure(errc::peer_lost, fmt::format("{}: {}", server_, words(code))));
            return *why_;
        }
        return refusal(what, code);
    }

    result<void> subscribe(const std::string& filter) override {
        if (why_) return *why_;
        int token = 0;
        int code = mosquitto_subscribe_v5(
            handle_.get(), &token, filter.c_str(), 1,
            options_.version_5 ? MQTT_SUB_OPT_SEND_RETAIN_NEVER | MQTT_SUB_OPT_RETAIN_AS_PUBLISHED : 0, nullptr);
        want();
        if (code != MOSQ_ERR_SUCCESS)
            return failure(errc::refused, fmt::format("{}: no subscription to {}: {}", server_, filter, words(code)));
        filters_[token] = filter;
        return {};
    }

private:
    static std::string words(int code) { return mosquitto_strerror(code); }
    failure refusal(const message& what, int code) const {
        return failure(code == MOSQ_ERR_OVERSIZE_PACKET || code == MOSQ_ERR_PAYLOAD_SIZE ? errc::too_large
                                                                                         : errc::invalid_argument,
                       fmt::format("a message of {} with {} bytes cannot be sent to {}: {}", what.topic,
                                   what.payload.size(), server_, words(code)));
    }

    /// Everything that libmosquitto is to know; nothing is sent.
    result<void> configure(environment& env) {
        static const library once;
        auto parts = parse_url(options_.url);
        if (!parts) return bad_option(fmt::format("the broker: {} (--broker)", parts.error().message()));
        const bool secure = parts->scheme == "mqtts";
        if ((!secure && parts->scheme != "mqtt") || parts->host.empty() ||
            !(parts->target.empty() || parts->target == "/"))
            return bad_option("the broker must be such as mqtt://127.0.0.1:1883 or mqtts://broker.example (--broker)");
        host_ = parts->host;
        port_ = parts->port != 0 ? parts->port : secure ? 8883 : 1883;
        server_ = fmt::format("{}://{}:{}", parts->scheme,
                              host_.find(':') == std::string::npos ? host_ : "[" + host_ + "]", port_);
        handle_.reset(mosquitto_new(options_.client_id.c_str(), true, this));
        if (!handle_) throw std::bad_alloc();
        auto* h = handle_.get();
        mosquitto_int_option(h, MOSQ_OPT_PROTOCOL_VERSION, options_.version_5 ? MQTT_PROTOCOL_V5 : MQTT_PROTOCOL_V311);
        mosquitto_int_option(h, MOSQ_OPT_SEND_MAXIMUM, most_unconfirmed);
        mosquitto_int_option(h, MOSQ_OPT_TCP_NODELAY, 1);
        std::string password;
        if (!options_.password_file.empty()) {
            auto read = env.read_secret(options_.password_file, max_file);
            if (!read) return bad_option(fmt::format("the password: {} (--password-file)", read.error().message()));
            password = read->substr(0, read->find_first_of("\r\n"));
        }
        if (!options_.user.empty() || !password.empty())
            mosquitto_username_pw_set(h, options_.user.c_str(), password.c_str());
        if (secure) {
            if (auto set = secure_by(env); !set) return set;
        } else if (!options_.ca_file.empty() || !options_.certificate_file.empty() || !options_.key_file.empty()) {
            return bad_option(
                fmt::format("{} is without TLS, but certificates are given: use mqtts (--broker)", server_));
        }
        const auto& will = options_.will;
        if (!will.topic.empty())
            mosquitto_will_set_v5(h, will.topic.c_str(), static_cast<int>(will.payload.size()), will.payload.data(), 1,
                                  will.retain, nullptr);
        mosquitto_connect_v5_callback_set(h, [](mosquitto*, void* self, int reason, int, const mosquitto_property*) {
            static_cast<mosquitto_session*>(self)->on_connect(reason);
        });
        mosquitto_disconnect_v5_callback_set(h, [](mosquitto*, void* self, int reason, const mosquitto_property*) {
            static_cast<mosquitto_session*>(self)->on_disconnect(reason);
        });
        mosquitto_publish_v5_callback_set(
            h, [](mosquitto*, void* self, int token, int reason, const mosquitto_property* with) {
                static_cast<mosquitto_session*>(self)->on_confirmed(token, reason, with);
            });
        mosquitto_subscribe_v5_callback_set(
            h, [](mosquitto*, void* self, int token, int count, const int* granted, const mosquitto_property*) {
                static_cast<mosquitto_session*>(self)->on_subscribed(token, count > 0 ? granted[0] : 0x80);
            });
        mosquitto_log_callback_set(h, [](mosquitto*, void* self, int level, const char* text) {
            std::string_view line(text);
            if (level == MOSQ_LOG_ERR && line.starts_with("OpenSSL Error"))
                static_cast<mosquitto_session*>(self)->tls_trouble_ = line.substr(line.rfind(':') + 1);
        });
        mosquitto_message_v5_callback_set(
            h, [](mosquitto*, void* self, const mosquitto_message* what, const mosquitto_property* with) {
                static_cast<mosquitto_session*>(self)->on_message(*what, with);
            });
        return {};
    }

    result<void> secure_by(environment& env) {
        auto* h = handle_.get();
        auto file = [](const std::string& name) { return name.empty() ? nullptr : name.c_str(); };
        if (options_.certificate_file.empty() != options_.key_file.empty())
            return bad_option("a certificate needs its key, and the other way round (--certificate, --key-file)");
        if (!options_.ca_file.empty())
            if (auto read = env.read_trusted(options_.ca_file, 1 << 20); !read)
                return bad_option(fmt::format("the authorities: {} (--ca-file)", read.error().message()));
        if (!options_.key_file.empty())
            if (auto read = env.read_secret(options_.key_file, max_file); !read)
                return bad_option(fmt::format("the key: {} (--key-file)", read.error().message()));
        int code = MOSQ_ERR_SUCCESS;
        if (options_.ca_file.empty()) mosquitto_int_option(h, MOSQ_OPT_TLS_USE_OS_CERTS, 1);
        if (!options_.ca_file.empty() || !options_.certificate_file.empty())
            code = mosquitto_tls_set(h, file(options_.ca_file), options_.ca_file.empty() ? "/etc/ssl/certs" : nullptr,
                                     file(options_.certificate_file), file(options_.key_file), nullptr);
        if (code != MOSQ_ERR_SUCCESS)
            return bad_option(fmt::format("TLS: {} (--ca-file, --certificate, --key-file)", words(code)));
        mosquitto_tls_opts_set(h, 1, nullptr, nullptr); // the certificate is verified, the name too
        return {};
    }

    /// On another thread: looks the name up.
    int begin() {
        auto seconds = std::chrono::duration_cast<std::chrono::seconds>(options_.keep_alive).count();
        int code = mosquitto_connect_async(handle_.get(), host_.c_str(), port_, static_cast<int>(seconds));
        errno_ = errno;
        return code;
    }

    result<void> watch_socket(const asio::any_io_executor& on) {
        int copy = ::fcntl(mosquitto_socket(handle_.get()), F_DUPFD_CLOEXEC, 0);
        if (copy < 0) return io_failure("cannot watch the connection", std::error_code(errno, std::system_category()));
        watch_ = std::make_shared<watch>(on, copy);
        misc_.arm(saturating_add(loop_.now(), std::chrono::seconds(1)));
        want();
        return {};
    }

    void want() {
        if (!watch_ || why_) return;
        wait(asio::posix::descriptor_base::wait_read, &watch::reading, &mosquitto_session::read);
        if (mosquitto_want_write(handle_.get()) && !later_.armed())
            wait(asio::posix::descriptor_base::wait_write, &watch::writing, &mosquitto_session::write);
    }
    void wait(asio::posix::descriptor_base::wait_type kind, bool watch::*waits, void (mosquitto_session::*act)()) {
        if ((*watch_).*waits) return;
        (*watch_).*waits = true;
        watch_->descriptor.async_wait(kind, [this, weak = std::weak_ptr(watch_), waits, act](std::error_code) {
            auto here = weak.lock();
            if (!here) return; // and so is the session
            (*here).*waits = false;
            loop::turn in(loop_);
            (this->*act)();
        });
    }

    void read() { after(mosquitto_loop_read(handle_.get(), packets_at_once)); }
    void write() {
        if (!watch_ || why_) return;
        const bool wanted = mosquitto_want_write(handle_.get());
        int code = mosquitto_loop_write(handle_.get(), packets_at_once);
        // The socket would take more at once, but it is the other side's turn.
        if (wanted && !accepted_ && code == MOSQ_ERR_SUCCESS && mosquitto_want_write(handle_.get()))
            later_.arm(saturating_add(loop_.now(), retry_write));
        after(code);
    }
    void look_after() {
        if (!watch_ || why_) return;
        misc_.arm(saturating_add(loop_.now(), std::chrono::seconds(1)));
        after(mosquitto_loop_misc(handle_.get()));
    }
    void after(int code) {
        if (code != MOSQ_ERR_SUCCESS && !why_) ended(code);
        want();
    }
    void ended(int code) {
        close(failure(accepted_ ? errc::peer_lost : errc::unreachable,
                      fmt::format("{}: {}", server_, trouble(code, errno))));
    }
    /// `number`: the errno of that time. TLS may fail while connecting already.
    std::string trouble(int code, int number) const {
        std::string why = code == MOSQ_ERR_ERRNO ? std::strerror(number) : words(code);
        if (!tls_trouble_.empty() || code == MOSQ_ERR_TLS)
            why += fmt::format(" ({}: is the broker's certificate signed by --ca-file and made for this name, and does "
                               "it accept --certificate?)",
                               tls_trouble_.empty() ? "TLS" : tls_trouble_);
        return why;
    }

    void close(failure why) {
        if (why_) return;
        why_ = std::move(why);
        watch_.reset();
        misc_.disarm();
        later_.disarm();
        wake_.resume({});
        if (established_) events_.closed(*why_);
    }

    std::string reason_text(int reason) const {
        return options_.version_5 ? mosquitto_reason_string(reason) : mosquitto_connack_string(reason);
    }

    void on_connect(int reason) {
        if (reason == 0) {
            accepted_ = true;
            wake_.resume({});
            return;
        }
        const bool login =
            options_.version_5
                ? reason == MQTT_RC_NOT_AUTHORIZED || reason == MQTT_RC_BAD_USERNAME_OR_PASSWORD
                : reason == CONNACK_REFUSED_BAD_USERNAME_PASSWORD || reason == CONNACK_REFUSED_NOT_AUTHORIZED;
        if (login)
            close(failure(errc::unauthorized,
                          fmt::format("{} does not accept user '{}' with this password or certificate: {} (--user, "
                                      "--password-file)",
                                      server_, options_.user, reason_text(reason))));
        else close(failure(errc::refused, fmt::format("{} refuses the connection: {}", server_, reason_text(reason))));
    }

    void on_disconnect(int reason) {
        if (!options_.version_5 || reason < 0x80) return ended(reason == 0 ? MOSQ_ERR_CONN_LOST : reason);
        close(failure(accepted_ ? errc::peer_lost : errc::unreachable,
                      fmt::format("{} ended the connection: {}", server_, mosquitto_reason_string(reason))));
    }

    void on_confirmed(int token, int reason, const mosquitto_property* with) {
        if (why_ || !established_) return;
        std::optional<failure> why;
        if (reason >= 0x80) {
            auto more = text_of(with, MQTT_PROP_REASON_STRING);
            why.emplace(
                reason == MQTT_RC_NOT_AUTHORIZED ? errc::access_denied : errc::refused,
                fmt::format("{}: {}{}{}", server_, mosquitto_reason_string(reason), more.empty() ? "" : ": ", more));
        }
        events_.confirmed(token, why, is_temporary(reason));
    }

    void on_subscribed(int token, int granted) {
        auto found = filters_.find(token);
        if (why_ || !established_ || found == filters_.end()) return;
        auto filter = std::move(found->second);
        filters_.erase(found);
        if (granted < 0x80) return;
        events_.not_subscribed(
            filter, failure(errc::access_denied,
                            fmt::format("{} refuses the subscription to {}: {}", server_, filter,
                                        options_.version_5 ? mosquitto_reason_string(granted) : "not allowed")));
    }

    void on_message(const mosquitto_message& what, const mosquitto_property* with) {
        if (why_ || !established_) return;
        message made;
        made.topic = what.topic;
        made.payload.assign(static_cast<const char*>(what.payload), static_cast<std::size_t>(what.payloadlen));
        made.retain = what.retain;
        made.content_type = text_of(with, MQTT_PROP_CONTENT_TYPE);
        made.response_topic = text_of(with, MQTT_PROP_RESPONSE_TOPIC);
        made.correlation = binary_of(with, MQTT_PROP_CORRELATION_DATA);
        std::uint32_t expiry = 0;
        if (mosquitto_property_read_int32(with, MQTT_PROP_MESSAGE_EXPIRY_INTERVAL, &expiry, false))
            made.expiry_s = expiry;
        events_.received(std::move(made));
    }

    loop& loop_;
    broker_options options_;
    session_events events_;
    std::string host_, server_;
    std::string tls_trouble_; // in OpenSSL's words
    std::uint16_t port_ = 0;
    int errno_ = 0;
    bool accepted_ = false, established_ = false;
    std::optional<failure> why_;         // it is over
    std::map<int, std::string> filters_; // of subscriptions that are not confirmed
    waiter<std::error_code> wake_;
    timer misc_, later_;
    std::unique_ptr<mosquitto, destroy> handle_;
    std::shared_ptr<watch> watch_;
};

} // namespace

task<result<std::unique_ptr<broker_session>>> connect_mosquitto(component& self, broker_options options,
                                                                session_events events) {
    if (self.env().is_virtual())
        co_return failure(errc::invalid_argument,
                          "libmosquitto needs the real world: give the bridge another connector");
    auto made = co_await mosquitto_session::connect(self, std::move(options), std::move(events));
    co_return made;
}

} // namespace ise::mqtt
