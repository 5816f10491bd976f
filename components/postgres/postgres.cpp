// environment-boundary: libpq owns its sockets
#include <components/postgres/postgres.hpp>

#include <asio/ip/tcp.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <fmt/format.h>
#include <libpq-fe.h>

#include <algorithm>
#include <charconv>
#include <chrono>
#include <deque>
#include <map>

#include <arpa/inet.h>
#include <fcntl.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration again_after = 1s, answer_within = 10s, look_period = 500ms;
constexpr std::size_t max_waiting = 256;

using settings = std::map<std::string, std::string>;
using connection = std::unique_ptr<PGconn, decltype([](PGconn* one) { PQfinish(one); })>;
using answer = std::unique_ptr<PGresult, decltype([](PGresult* one) { PQclear(one); })>;

std::string in_one_line(const char* words) {
    std::string made;
    for (std::string_view rest = words ? words : ""; !rest.empty();) {
        auto end = std::min(rest.find('\n'), rest.size());
        auto line = rest.substr(0, end);
        line.remove_prefix(std::min(line.find_first_not_of(" \t"), line.size()));
        if (!line.empty()) made += (made.empty() ? "" : "; ") + std::string(line);
        rest.remove_prefix(std::min(end + 1, rest.size()));
    }
    return made;
}

ise::result<settings> settings_of(const std::string& url) {
    char* why = nullptr;
    auto* parsed = PQconninfoParse(url.c_str(), &why);
    if (!parsed) {
        PQfreemem(why); // it may repeat the password
        return ise::failure(ise::errc::invalid_argument, "the URL of the store is not one of PostgreSQL; it looks like "
                                                         "postgresql://user@host:5432/database?sslmode=verify-full");
    }
    settings made;
    for (const auto* one = parsed; one->keyword; ++one)
        if (one->val && *one->val) made[one->keyword] = one->val;
    PQconninfoFree(parsed);
    return made;
}

std::string in(const settings& from, const char* key, const char* otherwise = "") {
    auto found = from.find(key);
    return found == from.end() ? otherwise : found->second;
}

std::vector<std::string> parts_of(const std::string& list) {
    std::vector<std::string> made;
    for (std::size_t from = 0;;) {
        auto end = list.find(',', from);
        made.push_back(list.substr(from, end - from));
        if (end == list.npos) return made;
        from = end + 1;
    }
}

bool is_a_name(const std::string& host) {
    in6_addr unused{};
    return !host.empty() && host.front() != '/' && host.front() != '@' &&
           ::inet_pton(AF_INET, host.c_str(), &unused) != 1 && ::inet_pton(AF_INET6, host.c_str(), &unused) != 1;
}

ise::duration connect_limit(const settings& of) {
    auto text = in(of, "connect_timeout");
    unsigned seconds = 0;
    std::from_chars(text.data(), text.data() + text.size(), seconds);
    return seconds == 0 ? 10s : std::chrono::seconds(std::min(seconds, 600u)); // libpq would wait for ever
}

/// With what a lost server is noticed by, and a standby is not taken for the primary.
settings completed(settings from) {
    for (const auto& [key, value] :
         {std::pair{"client_encoding", "UTF8"}, std::pair{"target_session_attrs", "read-write"},
          std::pair{"fallback_application_name", "atirma"},
          // Of one server. One of several is not waited for as long: another may be the primary.
          std::pair{"connect_timeout", in(from, "host").find(',') == std::string::npos ? "10" : "3"},
          std::pair{"keepalives_idle", "10"}, std::pair{"keepalives_interval", "5"}, std::pair{"keepalives_count", "3"},
          std::pair{"tcp_user_timeout", "15000"}})
        from.try_emplace(key, value);
    return from;
}

struct keys_and_values {
    explicit keys_and_values(const settings& of) {
        for (const auto& [key, value] : of) {
            keys.push_back(key.c_str());
            values.push_back(value.c_str());
        }
        keys.push_back(nullptr);
        values.push_back(nullptr);
    }
    std::vector<const char*> keys, values;
};

std::vector<const char*> pointers_to(const std::vector<postgres_value>& bound) {
    std::vector<const char*> made;
    for (const auto& one : bound) made.push_back(one ? one->c_str() : nullptr);
    return made;
}

postgres_rows rows_in(const PGresult* from) {
    postgres_rows made(static_cast<std::size_t>(PQntuples(from)));
    int width = PQnfields(from);
    for (int row = 0; row < PQntuples(from); ++row) {
        auto& cells = made[static_cast<std::size_t>(row)];
        cells.resize(static_cast<std::size_t>(width));
        for (int column = 0; column < width; ++column)
            if (!PQgetisnull(from, row, column))
                cells[static_cast<std::size_t>(column)] = std::string(
                    PQgetvalue(from, row, column), static_cast<std::size_t>(PQgetlength(from, row, column)));
    }
    return made;
}

bool is_good(const PGresult* of) {
    auto status = PQresultStatus(of);
    return status == PGRES_TUPLES_OK || status == PGRES_COMMAND_OK;
}

std::string_view sqlstate_of(const PGresult* of) {
    const auto* text = PQresultErrorField(of, PG_DIAG_SQLSTATE);
    return text ? text : "";
}

/// A server that became a standby, or is going down: another connection may meet the new primary.
bool ends_the_connection(std::string_view sqlstate) { return sqlstate == "25006" || sqlstate.starts_with("57P"); }

} // namespace

bool has_postgres() noexcept { return true; }

ise::result<void> check_postgres_url(const std::string& url) {
    auto parsed = settings_of(url);
    if (!parsed) return parsed.error();
    if (parsed->contains("password") || parsed->contains("sslpassword"))
        return ise::failure(ise::errc::invalid_argument,
                            "the URL of the store holds a password, which everybody on this host can read in the list "
                            "of processes; put it into a file of mode 0600 named by PGPASSFILE (or ~/.pgpass: "
                            "host:port:database:user:password), or into the variable PGPASSWORD");
    return {};
}

std::string postgres_name(const std::string& url) {
    auto parsed = settings_of(url);
    if (!parsed) return "PostgreSQL";
    auto user = in(*parsed, "user");
    auto hosts = parts_of(in(*parsed, "host", "localhost")), ports = parts_of(in(*parsed, "port"));
    std::string servers;
    for (std::size_t i = 0; i < hosts.size(); ++i) {
        const auto& port = ports[ports.size() == hosts.size() ? i : 0];
        servers += (i == 0 ? "" : ",") + hosts[i] + (port.empty() ? "" : ":" + port);
    }
    return fmt::format("postgresql://{}{}{}/{}", user, user.empty() ? "" : "@", servers, in(*parsed, "dbname"));
}

class postgres_client::state : public std::enable_shared_from_this<state> {
public:
    state(ise::loop& on, const std::string& url, events then)
        : loop_(on), name_(postgres_name(url)), settings_(completed(settings_of(url).value())),
          connect_within_(connect_limit(settings_)), then_(std::move(then)), resolver_(on.get_executor()),
          again_(on, [this] { begin(); }), watch_(on, [this] { look(); }) {}

    void begin() {
        if (stage_ != stage::away) return;
        stage_ = stage::resolving;
        stage_since_ = loop_.now();
        watch_.arm(ise::saturating_add(loop_.now(), look_period));
        servers_.clear();
        reasons_.clear();
        resolve(0);
    }
    void end() { // nothing is called any more
        then_ = events();
        waiting_.clear();
        again_.disarm();
        watch_.disarm();
        resolver_.cancel();
        forget();
    }

    void query(std::string sql, std::vector<postgres_value> bound, postgres_client::then done) {
        if (stage_ != stage::ready) return done(trouble_);
        if (waiting_.size() >= max_waiting)
            return done(ise::failure(ise::errc::overloaded,
                                     fmt::format("{}: {} statements wait for it already", name_, waiting_.size())));
        auto values = pointers_to(bound);
        bool sent = PQsendQueryParams(connection_.get(), sql.c_str(), static_cast<int>(values.size()), nullptr,
                                      values.data(), nullptr, nullptr, 0) == 1 &&
                    PQpipelineSync(connection_.get()) == 1;
        waiting_.emplace_back(std::move(done), loop_.now());
        if (sent) return flush();
        // Not from within this call: the caller may not expect that all its statements end now.
        auto why = failed(PQerrorMessage(connection_.get()));
        loop_.later([weak = weak_from_this(), why] {
            if (auto self = weak.lock()) self->lose(why);
        });
    }

    void lose(const ise::failure& why) {
        if (stage_ == stage::away) return;
        auto self = shared_from_this();
        forget();
        stage_ = stage::away;
        trouble_ = why;
        again_.arm(ise::saturating_add(loop_.now(), again_after));
        for (auto dropped = std::exchange(waiting_, {}); auto& one : dropped)
            one.done(ise::failure(ise::errc::io_failed, why.message(), ise::execution::unknown));
        if (then_.lost) then_.lost(why);
    }

    ise::failure failed(const char* words) const {
        return ise::failure(ise::errc::io_failed, fmt::format("{}: {}", name_, in_one_line(words)));
    }

private:
    enum class stage { away, resolving, connecting, ready };
    struct statement {
        statement(postgres_client::then what, ise::time_point at) : done(std::move(what)), since(at) {}
        postgres_client::then done;
        ise::time_point since;
        answer got;
    };
    /// A duplicate of libpq's socket, which libpq may close and replace while it connects.
    struct watched {
        watched(ise::loop& on, int socket) : descriptor(on.get_executor(), ::fcntl(socket, F_DUPFD_CLOEXEC, 0)) {}
        asio::posix::stream_descriptor descriptor;
        bool reading = false, writing = false;
    };

    void forget() {
        watched_.reset();
        connection_.reset();
    }

    // libpq would block for a name; it gets addresses, with the name for TLS and the password.
    void resolve(std::size_t index) {
        auto hosts = parts_of(in(settings_, "host")), ports = parts_of(in(settings_, "port"));
        auto addresses = parts_of(in(settings_, "hostaddr"));
        if (index >= std::max(hosts.size(), addresses.size())) return connect();
        auto at = [index](const std::vector<std::string>& list) {
            return index < list.size() ? list[index] : list.size() == 1 ? list.front() : std::string();
        };
        auto host = at(hosts), port = at(ports), address = at(addresses);
        if (!address.empty() || !is_a_name(host)) {
            servers_.push_back({host, address, port});
            return resolve(index + 1);
        }
        resolver_.async_resolve(
            host, "", [weak = weak_from_this(), host, port, index](std::error_code problem, const auto& found) {
                auto self = weak.lock();
                if (!self || self->stage_ != stage::resolving) return;
                ise::loop::turn in(self->loop_);
                if (problem)
                    self->add_reason(fmt::format("the name {} is not resolved: {}", host, problem.message()).c_str());
                for (const auto& one : found)
                    self->servers_.push_back({host, one.endpoint().address().to_string(), port});
                self->resolve(index + 1);
            });
    }

    void connect() {
        left_ = servers_.size();
        next_server();
    }

    // Begins behind the server of the last attempt: one that accepts connections and answers nothing does not hide the
    // others.
    void next_server() {
        if (left_ == 0) return lose(failed(reasons_.c_str()));
        --left_;
        const auto& to = servers_[next_++ % servers_.size()];
        auto chosen = settings_;
        for (const auto& [key, value] :
             {std::pair("host", to.host), std::pair("hostaddr", to.address), std::pair("port", to.port)})
            if (value.empty()) chosen.erase(key);
            else chosen[key] = value;
        keys_and_values parameters(chosen);
        connection_.reset(PQconnectStartParams(parameters.keys.data(), parameters.values.data(), 0));
        if (!connection_ || PQstatus(connection_.get()) == CONNECTION_BAD)
            return refused(connection_ ? PQerrorMessage(connection_.get()) : "out of memory");
        PQsetnonblocking(connection_.get(), 1);
        PQsetNoticeProcessor(
            connection_.get(), [](void*, const char*) {}, nullptr);
        stage_ = stage::connecting;
        stage_since_ = loop_.now();
        wait(PGRES_POLLING_WRITING);
    }

    void refused(const char* why) {
        add_reason(why);
        forget();
        next_server();
    }

    void add_reason(const char* why) { reasons_ += (reasons_.empty() ? "" : "\n") + std::string(why); }

    void wait(PostgresPollingStatusType what) {
        int socket = PQsocket(connection_.get());
        if (socket < 0) return refused("the connection has no socket");
        watched_ = std::make_shared<watched>(loop_, socket); // another one after each step
        await(what == PGRES_POLLING_WRITING);
    }

    void await(bool writable) {
        auto& flag = writable ? watched_->writing : watched_->reading;
        if (std::exchange(flag, true)) return;
        auto kind = writable ? asio::posix::descriptor_base::wait_write : asio::posix::descriptor_base::wait_read;
        watched_->descriptor.async_wait(
            kind, [weak = weak_from_this(), at = std::weak_ptr(watched_), writable](std::error_code problem) {
                auto self = weak.lock();
                auto here = at.lock();
                if (!self || !here || self->watched_ != here) return;
                (writable ? here->writing : here->reading) = false;
                ise::loop::turn in(self->loop_);
                if (problem) self->lose(self->failed(problem.message().c_str()));
                else if (self->stage_ == stage::connecting) self->advance();
                else if (writable) self->flush();
                else self->read();
            });
    }

    void advance() {
        switch (auto next = PQconnectPoll(connection_.get())) {
            case PGRES_POLLING_OK:
                if (PQserverVersion(connection_.get()) < 150000)
                    return refused(fmt::format("the server has version {}; 15 or newer is needed",
                                               PQserverVersion(connection_.get()) / 10000)
                                       .c_str());
                if (PQenterPipelineMode(connection_.get()) != 1) return lose(failed(PQerrorMessage(connection_.get())));
                stage_ = stage::ready;
                wait(PGRES_POLLING_READING);
                if (then_.connected) then_.connected();
                return;
            case PGRES_POLLING_FAILED: return refused(PQerrorMessage(connection_.get()));
            default: return wait(next);
        }
    }

    void flush() {
        if (stage_ != stage::ready) return;
        int left = PQflush(connection_.get());
        if (left < 0) {
            auto why = failed(PQerrorMessage(connection_.get()));
            loop_.later([weak = weak_from_this(), why] {
                if (auto self = weak.lock()) self->lose(why);
            });
        } else if (left > 0) {
            await(true);
        }
    }

    void read() {
        auto self = shared_from_this(); // what is called may end it
        if (PQconsumeInput(connection_.get()) != 1) return lose(failed(PQerrorMessage(connection_.get())));
        while (stage_ == stage::ready && !waiting_.empty() && !PQisBusy(connection_.get())) {
            answer got(PQgetResult(connection_.get()));
            if (!got) continue; // between a statement and its end
            if (PQresultStatus(got.get()) != PGRES_PIPELINE_SYNC) {
                if (PQresultStatus(got.get()) != PGRES_PIPELINE_ABORTED) waiting_.front().got = std::move(got);
                continue;
            }
            auto one = std::move(waiting_.front());
            waiting_.pop_front();
            finish(one);
        }
        if (stage_ != stage::ready) return;
        if (PQstatus(connection_.get()) == CONNECTION_BAD) return lose(failed(PQerrorMessage(connection_.get())));
        flush();
        if (watched_) await(false);
    }

    void finish(statement& one) {
        if (one.got && is_good(one.got.get())) return one.done(rows_in(one.got.get()));
        auto why = failed(one.got ? PQresultErrorMessage(one.got.get()) : "a statement without an answer");
        bool over = one.got && ends_the_connection(sqlstate_of(one.got.get()));
        one.done(why);
        if (over) lose(why);
    }

    void look() {
        if (stage_ == stage::away) return;
        watch_.arm(ise::saturating_add(loop_.now(), look_period));
        auto waits = loop_.now() - stage_since_;
        if (stage_ == stage::resolving && waits > answer_within) lose(failed("its name was not resolved within 10 s"));
        else if (stage_ == stage::connecting && waits > connect_within_)
            refused(fmt::format("the server at {}, port {}, did not accept the connection within {} s",
                                PQhost(connection_.get()), PQport(connection_.get()), connect_within_ / 1s)
                        .c_str());
        else if (!waiting_.empty() && loop_.now() - waiting_.front().since > answer_within)
            lose(failed("the server did not answer within 10 s"));
    }

    ise::loop& loop_;
    std::string name_;
    settings settings_;
    ise::duration connect_within_;
    events then_;
    asio::ip::tcp::resolver resolver_;
    ise::timer again_, watch_;
    stage stage_ = stage::away;
    ise::time_point stage_since_{};
    ise::failure trouble_{ise::errc::io_failed, name_ + ": not connected yet"};
    struct server {
        std::string host, address, port; // empty: libpq's own choice
    };
    std::vector<server> servers_;
    std::size_t next_ = 0, left_ = 0; // the next one's number; how many are left of this attempt
    std::string reasons_;             // of those that were tried, a line each
    connection connection_;
    std::shared_ptr<watched> watched_;
    std::deque<statement> waiting_;
};

postgres_client::postgres_client(ise::loop& on, const std::string& url, events handler) {
    if (on.env().is_virtual())
        throw ise::error(ise::errc::invalid_argument,
                         "a store on PostgreSQL needs the real world; in the virtual one use memory:NAME");
    check_postgres_url(url).value();
    state_ = std::make_shared<state>(on, url, std::move(handler));
}
postgres_client::~postgres_client() { state_->end(); }

void postgres_client::start() { state_->begin(); }
void postgres_client::query(std::string sql, std::vector<postgres_value> bound, then done) {
    state_->query(std::move(sql), std::move(bound), std::move(done));
}
void postgres_client::drop(const ise::failure& why) { state_->lose(why); }

class postgres_session::state {
public:
    ise::failure failed(const char* words) const {
        return ise::failure(ise::errc::io_failed, fmt::format("{}: {}", name, in_one_line(words)));
    }
    ise::result<void> outcome(const answer& of) const {
        if (of && is_good(of.get())) return {};
        return failed(of ? PQresultErrorMessage(of.get()) : PQerrorMessage(to.get()));
    }

    std::string name;
    connection to;
};

ise::result<postgres_session> postgres_session::open(const std::string& url) {
    if (auto good = check_postgres_url(url); !good) return good.error();
    auto parsed = completed(settings_of(url).value());
    keys_and_values parameters(parsed);
    auto made = std::make_unique<state>();
    made->name = postgres_name(url);
    made->to.reset(PQconnectdbParams(parameters.keys.data(), parameters.values.data(), 0));
    if (PQstatus(made->to.get()) != CONNECTION_OK) return made->failed(PQerrorMessage(made->to.get()));
    PQsetNoticeProcessor(
        made->to.get(), [](void*, const char*) {}, nullptr);
    return postgres_session(std::move(made));
}

postgres_session::postgres_session(std::unique_ptr<state> made) : state_(std::move(made)) {}
postgres_session::postgres_session(postgres_session&&) noexcept = default;
postgres_session& postgres_session::operator=(postgres_session&&) noexcept = default;
postgres_session::~postgres_session() = default;

ise::result<postgres_rows> postgres_session::query(const std::string& sql, const std::vector<postgres_value>& bound) {
    auto values = pointers_to(bound);
    answer got(PQexecParams(state_->to.get(), sql.c_str(), static_cast<int>(values.size()), nullptr, values.data(),
                            nullptr, nullptr, 0));
    if (auto good = state_->outcome(got); !good) return good.error();
    return rows_in(got.get());
}

ise::result<void> postgres_session::run_script(const std::string& sql) {
    return state_->outcome(answer(PQexec(state_->to.get(), sql.c_str())));
}

ise::result<void> postgres_session::copy_in(const std::string& sql, const std::string& lines) {
    auto* to = state_->to.get();
    answer begun(PQexec(to, sql.c_str()));
    if (!begun || PQresultStatus(begun.get()) != PGRES_COPY_IN) return state_->failed(PQerrorMessage(to));
    constexpr std::size_t piece = 1 << 20;
    for (std::size_t at = 0; at < lines.size(); at += piece)
        if (PQputCopyData(to, lines.data() + at, static_cast<int>(std::min(piece, lines.size() - at))) != 1)
            return state_->failed(PQerrorMessage(to));
    if (PQputCopyEnd(to, nullptr) != 1) return state_->failed(PQerrorMessage(to));
    ise::result<void> made;
    while (answer got{PQgetResult(to)})
        if (auto good = state_->outcome(got); !good) made = good;
    return made;
}

} // namespace atirma
