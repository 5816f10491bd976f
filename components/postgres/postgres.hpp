#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/unique_function.hpp>

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace atirma {

/// A value of a row, or of a `$1` of a statement, in PostgreSQL's text form; empty: NULL.
using postgres_value = std::optional<std::string>;
using postgres_row = std::vector<postgres_value>;
using postgres_rows = std::vector<postgres_row>;

std::string postgres_bytes(const std::vector<std::byte>& raw);           ///< text form of a bytea
std::vector<std::byte> bytes_of_postgres(const postgres_value& text);    ///< and back
std::string postgres_array(const std::vector<std::string>& values);      ///< text form of an array
std::int64_t integer_of(const postgres_row& row, std::size_t column);    ///< 0 for NULL
const std::string& text_of(const postgres_row& row, std::size_t column); ///< empty for NULL

/// Whether this program was built with libpq.
bool has_postgres() noexcept;
/// Whether a store is named by such a URL: "postgresql://…" or "postgres://…".
bool is_postgres_url(std::string_view text) noexcept;
/// Errors: invalid_argument for a URL that libpq does not understand, or that holds a password, which everybody on the
/// host could read in the list of processes; also without libpq. The messages do not repeat the URL.
ise::result<void> check_postgres_url(const std::string& url);
/// "postgresql://user@host:port/database", for logs and messages.
std::string postgres_name(const std::string& url);

/// A connection on a component's loop: it never blocks it, also not to resolve names. Statements are sent at once, many
/// under way (pipeline mode), each a transaction of its own. The connection is made again a second after it was lost.
/// The password comes from PGPASSFILE, ~/.pgpass or PGPASSWORD. Real world only; used on its loop.
class postgres_client {
public:
    using then = ise::unique_function<void(ise::result<postgres_rows>)>;
    struct events {
        std::function<void()> connected;               ///< statements may follow from within
        std::function<void(const ise::failure&)> lost; ///< also where it could not be made
    };

    /// `url` has passed check_postgres_url. Throws ise::error (invalid_argument) on a virtual loop.
    postgres_client(ise::loop& on, const std::string& url, events then);
    ~postgres_client(); ///< calls nothing any more
    postgres_client(const postgres_client&) = delete;
    postgres_client& operator=(const postgres_client&) = delete;

    void start();
    /// `done` is called in a turn of the loop, at once if there is no connection. Errors: io_failed with the server's
    /// words; of a lost connection, and after 10 s without an answer, `executed()` is unknown; overloaded if 256
    /// statements wait already.
    void query(std::string sql, std::vector<postgres_value> bound, then done);
    /// Ends the connection as if it was lost; it is made again.
    void drop(const ise::failure& why);

private:
    class state;
    std::shared_ptr<state> state_;
};

/// A connection for programs without a loop: each call blocks. Errors: io_failed with the server's words.
class postgres_session {
public:
    /// Errors: also those of check_postgres_url.
    static ise::result<postgres_session> open(const std::string& url);
    postgres_session(postgres_session&&) noexcept;
    postgres_session& operator=(postgres_session&&) noexcept;
    ~postgres_session();

    ise::result<postgres_rows> query(const std::string& sql, const std::vector<postgres_value>& bound = {});
    /// Several statements, as one transaction.
    ise::result<void> run_script(const std::string& sql);
    /// COPY … FROM STDIN of lines in its text form. Errors end the transaction that it is in.
    ise::result<void> copy_in(const std::string& sql, const std::string& lines);

private:
    class state;
    explicit postgres_session(std::unique_ptr<state> made);
    std::unique_ptr<state> state_;
};

} // namespace atirma
