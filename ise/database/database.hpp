#pragma once
#include <ise/core/log.hpp>
#include <ise/core/result.hpp>

#include <chrono>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <initializer_list>
#include <memory>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <variant>
#include <vector>

namespace ise {

/// What a database cell holds, and what is bound to a `?` of a statement.
using database_value = std::variant<std::monostate, std::int64_t, double, std::string, std::vector<std::byte>>;

/// One row that a query gave; columns count from 0. A column of another type gives an empty value.
class database_row {
public:
    explicit database_row(std::vector<database_value> cells) : cells_(std::move(cells)) {}

    std::size_t size() const noexcept { return cells_.size(); }
    bool is_null(std::size_t column) const { return cells_.at(column).index() == 0; }
    std::int64_t integer(std::size_t column) const; ///< a real is cut off
    double real(std::size_t column) const;
    std::string text(std::size_t column) const;
    std::vector<std::byte> bytes(std::size_t column) const;

private:
    std::vector<database_value> cells_;
};

class database;

/// How a component goes on when its file is damaged: the file is set aside, and a new one is begun in its place.
struct when_damaged {
    /// The file is left as it is, and each call that meets the damage fails.
    when_damaged() = default;
    when_damaged(logger log_to, std::function<std::chrono::system_clock::time_point()> clock)
        : log(std::move(log_to)), wall(std::move(clock)) {}

    logger log;                                                           ///< gets an error with the file's new name
    std::function<std::chrono::system_clock::time_point()> wall;          ///< for that name; empty: nothing is done
    std::function<void(database& fresh, const std::string& aside)> begun; ///< called with the new file; may be empty

    /// `begun` first copies what can still be read into the new file (`database::keep_readable`), and logs how much.
    static when_damaged keeping_readable(when_damaged how);
};

/// What must not be lost when a component or its host dies: SQLite, one file.
///
/// What `execute` of a write or `commit` of a transaction returned success for is on the disk, also after a loss of
/// power. The name "memory:NAME" makes a database in memory that all openings of that name in this process share, and
/// that goes with the last of them: the disk of a virtual world (its script holds it open over crashes of components).
///
/// Files are made for their owner alone (mode 0600, also SQLite's `-wal` and `-shm`); an existing file of this user
/// loses the rights of others when it is opened.
///
/// Statements may use `row_sum(a, b, …)`: a checksum of 64 bits over the values and their types, for rows that shall
/// show when the disk has changed them.
///
/// Not thread-safe: used by one component, on its loop. Each call blocks for as long as the disk takes.
/// Errors: io_failed, with the file, what was tried, and SQLite's words ("database or disk is full"); malformed where
/// the file is damaged or no database. With `when_damaged` the latter is left to a transaction that met the damage:
/// nothing of it is kept, and whatever follows goes to the new file.
class database {
public:
    using values = std::initializer_list<database_value>;

    /// Opens or makes the file; its folder exists. Another process that writes to it is waited for, two seconds at
    /// most. `schema`: scripts that bring version n of the file to n+1; those that the file has not seen run, each
    /// whole or not at all. A file of a newer program (more scripts) is refused with invalid_argument. The texts of
    /// `schema` outlive the database.
    static result<database> open(const std::string& file, std::span<const std::string_view> schema,
                                 when_damaged how = when_damaged());

    /// Opens a file that another program writes, to look at it: what is written through this fails. Whatever its
    /// schema.
    static result<database> open_to_read(const std::string& file);

    /// Makes `to` hold exactly what `from` holds: backup and restore. Both may be open here meanwhile, without a
    /// transaction; no other process may use `to`.
    static result<void> copy(const std::string& from, const std::string& to);

    database(database&&) noexcept;
    database& operator=(database&&) noexcept;
    ~database(); ///< rolls back a transaction that is not committed

    /// Runs one statement that gives no rows; `bound` stand for its `?`. The number of rows that it changed.
    result<std::int64_t> execute(std::string_view sql, values bound = {});
    /// Runs one statement and gives its rows, all at once: bound it with LIMIT.
    result<std::vector<database_row>> query(std::string_view sql, values bound = {});

    /// What is executed until `commit` happens together or, after `rollback` or a failure of `commit`, not at all.
    result<void> begin();
    result<void> commit();
    void rollback() noexcept;
    /// Runs `write`, which returns a result, between `begin` and `commit`: what it executes is kept together, or not at
    /// all where it fails or throws. Gives its result, or why nothing of it could be kept.
    template <class Write>
    auto transaction(Write write) -> decltype(write());

    /// Copies from a damaged file what can be read of the tables and columns that this one has too; rows that are here
    /// already stay. What lies between the first and the last unreadable part of a table is left out, and so are tables
    /// without row ids. Gives the number of rows. Outside a transaction.
    result<std::uint64_t> keep_readable(const std::string& damaged);

    std::int64_t last_insert_id() const noexcept;
    const std::string& file() const noexcept;

    /// Every call fails from then on.
    void close() noexcept;
    bool is_open() const noexcept;

private:
    class state;
    struct replacing;
    explicit database(std::unique_ptr<state> opened);
    static result<database> open_as_it_is(const std::string& file, std::span<const std::string_view> schema);
    template <class Run>
    auto attempt(Run run) -> decltype(run());
    result<void> replace_damaged();

    std::unique_ptr<state> state_;
    std::unique_ptr<replacing> replacing_; ///< null: a damaged file is left as it is
};

template <class Write>
auto database::transaction(Write write) -> decltype(write()) {
    if (auto begun = begin(); !begun) return begun.error();
    struct unless_committed {
        database& of;
        ~unless_committed() { of.rollback(); }
    } guard{*this};
    auto made = write();
    if (!made) return made;
    if (auto done = commit(); !done) return done.error();
    return made;
}

/// Renames a database file that is damaged, with its `-wal` and `-shm`, so that a new one can be made in its place, and
/// logs that as an error with the cause and the new name, which it gives. Nothing is deleted or overwritten. The new
/// name is that of the file with ".damaged" and the time behind it. Nobody in this process has the file open. Errors:
/// io_failed.
result<std::string> set_aside(const std::string& file, const failure& cause, std::chrono::system_clock::time_point now,
                              const logger& log);

} // namespace ise
