// environment-boundary: SQLite opens the database file by itself; what is done to it here is done beside that
#include "database.hpp"

#include <ise/core/real/ownership.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>
#include <sqlite3.h>

#include <algorithm>
#include <array>
#include <cerrno>
#include <cstring>
#include <fcntl.h>
#include <map>
#include <ranges>
#include <sys/stat.h>
#include <unistd.h>
#include <utility>

namespace ise {

std::int64_t database_row::integer(std::size_t column) const {
    if (auto real = std::get_if<double>(&cells_.at(column))) return static_cast<std::int64_t>(*real);
    auto value = std::get_if<std::int64_t>(&cells_.at(column));
    return value ? *value : 0;
}

double database_row::real(std::size_t column) const {
    if (auto integer = std::get_if<std::int64_t>(&cells_.at(column))) return static_cast<double>(*integer);
    auto value = std::get_if<double>(&cells_.at(column));
    return value ? *value : 0;
}

std::string database_row::text(std::size_t column) const {
    auto value = std::get_if<std::string>(&cells_.at(column));
    return value ? *value : std::string();
}

std::vector<std::byte> database_row::bytes(std::size_t column) const {
    auto value = std::get_if<std::vector<std::byte>>(&cells_.at(column));
    return value ? *value : std::vector<std::byte>();
}

namespace {

using statement = std::unique_ptr<sqlite3_stmt, decltype([](sqlite3_stmt* s) { sqlite3_finalize(s); })>;

struct binder {
    sqlite3_stmt* to;
    int place;
    int operator()(std::monostate) const { return sqlite3_bind_null(to, place); }
    int operator()(std::int64_t value) const { return sqlite3_bind_int64(to, place, value); }
    int operator()(double value) const { return sqlite3_bind_double(to, place, value); }
    int operator()(const std::string& value) const {
        return sqlite3_bind_text64(to, place, value.data(), value.size(), SQLITE_TRANSIENT, SQLITE_UTF8);
    }
    int operator()(const std::vector<std::byte>& value) const {
        if (value.empty()) return sqlite3_bind_zeroblob(to, place, 0); // a null pointer would bind NULL
        return sqlite3_bind_blob64(to, place, value.data(), value.size(), SQLITE_TRANSIENT);
    }
};

database_value cell(sqlite3_stmt* of, int column) {
    switch (sqlite3_column_type(of, column)) {
        case SQLITE_INTEGER: return std::int64_t{sqlite3_column_int64(of, column)};
        case SQLITE_FLOAT: return sqlite3_column_double(of, column);
        case SQLITE_TEXT: {
            auto text = reinterpret_cast<const char*>(sqlite3_column_text(of, column));
            return std::string(text, static_cast<std::size_t>(sqlite3_column_bytes(of, column)));
        }
        case SQLITE_BLOB: {
            auto data = static_cast<const std::byte*>(sqlite3_column_blob(of, column));
            return std::vector<std::byte>(data, data + sqlite3_column_bytes(of, column));
        }
        default: return std::monostate{};
    }
}

std::vector<database_value> cells_of(sqlite3_stmt* row) {
    std::vector<database_value> cells;
    for (int column = 0; column < sqlite3_column_count(row); ++column) cells.push_back(cell(row, column));
    return cells;
}

constexpr std::string_view memory_prefix = "memory:";
bool in_memory(const std::string& file) { return file.starts_with(memory_prefix); }

/// "memory:NAME" in SQLite's words; others are files.
std::string location_of(const std::string& file) {
    if (!in_memory(file)) return file;
    return fmt::format("file:{}?mode=memory&cache=shared", file.substr(memory_prefix.size()));
}

// The main file, and what SQLite puts beside it with the mode of the main file.
constexpr std::array<const char*, 3> parts_of_a_file{"", "-wal", "-shm"};

/// An existing file is changed by its path: closing a descriptor of it would release SQLite's locks.
void keep_private(const std::string& file) {
    if (in_memory(file)) return;
    int made = ::open(file.c_str(), O_RDWR | O_CREAT | O_EXCL | O_CLOEXEC, 0600);
    if (made >= 0) {
        ::close(made);
        return;
    }
    for (const auto* part : parts_of_a_file) {
        auto path = file + part;
        struct stat now {};
        if (::stat(path.c_str(), &now) == 0 && S_ISREG(now.st_mode) && now.st_uid == ::geteuid() &&
            (now.st_mode & 077) != 0)
            ::chmod(path.c_str(), now.st_mode & 0700);
    }
}

// FNV-1a with 64 bits: each byte's step can be undone, so no change of a single byte goes unseen.
struct row_hash {
    std::uint64_t value = 0xcbf29ce484222325u;
    void byte(unsigned char next) {
        value ^= next;
        value *= 0x100000001b3u;
    }
    void number(std::uint64_t next) {
        for (int shift = 0; shift < 64; shift += 8) byte(static_cast<unsigned char>(next >> shift));
    }
    void bytes(const void* data, int size) {
        number(static_cast<std::uint64_t>(size));
        for (int i = 0; i < size; ++i) byte(static_cast<const unsigned char*>(data)[i]);
    }
};

void row_sum(sqlite3_context* context, int count, sqlite3_value** values) {
    row_hash hash;
    for (int i = 0; i < count; ++i) {
        auto type = sqlite3_value_type(values[i]);
        hash.byte(static_cast<unsigned char>(type));
        if (type == SQLITE_INTEGER) {
            hash.number(static_cast<std::uint64_t>(sqlite3_value_int64(values[i])));
        } else if (type == SQLITE_FLOAT) {
            double real = sqlite3_value_double(values[i]);
            std::uint64_t bits = 0;
            std::memcpy(&bits, &real, sizeof(bits));
            hash.number(bits);
        } else if (type == SQLITE_TEXT) {
            const auto* text = sqlite3_value_text(values[i]); // before its length, which this may change
            hash.bytes(text, sqlite3_value_bytes(values[i]));
        } else if (type == SQLITE_BLOB) {
            const auto* blob = sqlite3_value_blob(values[i]);
            hash.bytes(blob, sqlite3_value_bytes(values[i]));
        }
    }
    sqlite3_result_int64(context, static_cast<sqlite3_int64>(hash.value));
}

} // namespace

class database::state {
public:
    explicit state(std::string file) : file_(std::move(file)) {}
    state(const state&) = delete;
    state& operator=(const state&) = delete;
    ~state() { close(); }

    void close() noexcept {
        statements_.clear();
        sqlite3_close_v2(handle_);
        handle_ = nullptr;
    }

    failure failed(std::string_view doing) const {
        if (!handle_) return failure(errc::io_failed, fmt::format("{}: {}: it is closed", file_, doing));
        auto code = sqlite3_errcode(handle_) & 0xff;
        bool damaged = code == SQLITE_CORRUPT || code == SQLITE_NOTADB;
        return failure(damaged ? errc::malformed : errc::io_failed,
                       fmt::format("{}: {}: {}", file_, doing, sqlite3_errmsg(handle_)));
    }

    result<void> connect() {
        // Nobody else can put another file, or a link to one, where this one is or will be.
        auto own = in_memory(file_) ? result<void>() : check_own_file(file_, "open");
        if (!own) return own;
        keep_private(file_);
        auto done = connect_by(SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE);
        if (!done) return done;
        return script("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON");
    }

    result<void> connect_to_read() { return connect_by(SQLITE_OPEN_READONLY); }

    result<void> script(std::string_view sql) {
        if (!handle_) return failed(sql);
        if (sqlite3_exec(handle_, std::string(sql).c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
            return failed(sql.substr(0, sql.find('\n')));
        return {};
    }

    /// Calls `on_row` for each row. Statements are compiled once; their number is that of the texts in the program.
    template <class OnRow>
    result<void> run(std::string_view sql, std::span<const database_value> values, OnRow on_row) {
        if (!handle_) return failed(sql);
        auto found = statements_.find(sql);
        if (found == statements_.end()) {
            sqlite3_stmt* made = nullptr;
            if (sqlite3_prepare_v3(handle_, sql.data(), static_cast<int>(sql.size()), SQLITE_PREPARE_PERSISTENT, &made,
                                   nullptr) != SQLITE_OK)
                return failed(sql);
            found = statements_.emplace(std::string(sql), made).first;
        }
        sqlite3_stmt* step = found->second.get();
        int place = 0;
        for (const auto& value : values) {
            if (std::visit(binder{step, ++place}, value) != SQLITE_OK) return finish(step, sql);
        }
        int outcome;
        while ((outcome = sqlite3_step(step)) == SQLITE_ROW) on_row(step);
        if (outcome != SQLITE_DONE) return finish(step, sql);
        sqlite3_reset(step);
        sqlite3_clear_bindings(step);
        return {};
    }

    sqlite3* handle() const noexcept { return handle_; }
    bool in_transaction() const noexcept { return handle_ && sqlite3_get_autocommit(handle_) == 0; }
    const std::string& file() const noexcept { return file_; }

private:
    result<void> connect_by(int how) {
        int flags = how | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX;
        if (sqlite3_open_v2(location_of(file_).c_str(), &handle_, flags, nullptr) != SQLITE_OK)
            return failed("cannot be opened");
        sqlite3_busy_timeout(handle_, 2000);
        if (sqlite3_create_function_v2(handle_, "row_sum", -1, SQLITE_UTF8 | SQLITE_DETERMINISTIC, nullptr, row_sum,
                                       nullptr, nullptr, nullptr) != SQLITE_OK)
            return failed("cannot count sums");
        return {};
    }

    failure finish(sqlite3_stmt* step, std::string_view sql) {
        auto why = failed(sql);
        sqlite3_reset(step);
        sqlite3_clear_bindings(step);
        return why;
    }

    std::string file_;
    sqlite3* handle_ = nullptr;
    std::map<std::string, statement, std::less<>> statements_;
};

/// What a database needs to begin anew.
struct database::replacing {
    std::vector<std::string_view> schema;
    when_damaged how;
    std::optional<failure> damage = std::nullopt; ///< the file is not set aside yet
    std::string aside = std::string();            ///< and this one has no successor yet
    bool under_way = false;
};

database::database(std::unique_ptr<state> opened) : state_(std::move(opened)) {}
database::database(database&&) noexcept = default;
database& database::operator=(database&&) noexcept = default;
database::~database() = default;

result<database> database::open(const std::string& file, std::span<const std::string_view> schema, when_damaged how) {
    auto opened = open_as_it_is(file, schema);
    if (!how.wall || (!opened && opened.error().code() != errc::malformed)) return opened;
    auto made = opened ? std::move(*opened) : database(std::make_unique<state>(file));
    made.replacing_ = std::make_unique<replacing>();
    made.replacing_->schema.assign(schema.begin(), schema.end());
    made.replacing_->how = std::move(how);
    if (!opened) made.replacing_->damage = opened.error();
    if (auto ready = made.replace_damaged(); !ready) return ready.error();
    return made;
}

/// Where the damage was met, or an earlier attempt to replace the file failed: the next one.
result<void> database::replace_damaged() {
    if (!replacing_ || replacing_->under_way) return {};
    auto& r = *replacing_;
    if (r.damage) {
        state_->close();
        auto aside = set_aside(file(), *r.damage, r.how.wall(), r.how.log);
        if (!aside)
            return failure(errc::io_failed, fmt::format("{}; {}", r.damage->message(), aside.error().message()));
        r.aside = *aside;
        r.damage.reset();
    }
    if (r.aside.empty()) return {};
    auto fresh = open_as_it_is(file(), r.schema);
    if (!fresh) return fresh.error();
    state_ = std::move(fresh->state_);
    auto aside = std::exchange(r.aside, {});
    r.under_way = true;
    if (r.how.begun) r.how.begun(*this, aside);
    r.under_way = false;
    return {};
}

/// Once more on the new file where the damage was met outside a transaction.
template <class Run>
auto database::attempt(Run run) -> decltype(run()) {
    if (auto ready = replace_damaged(); !ready) return ready.error();
    bool whole = !state_->in_transaction();
    auto done = run();
    if (done || done.error().code() != errc::malformed || !replacing_ || replacing_->under_way) return done;
    replacing_->damage = done.error();
    if (auto replaced = replace_damaged(); !replaced) return replaced.error();
    if (!whole) return done;
    return run();
}

result<database> database::open_as_it_is(const std::string& file, std::span<const std::string_view> schema) {
    auto opening = std::make_unique<state>(file);
    auto connected = opening->connect();
    if (!connected) return connected.error();
    database opened(std::move(opening));

    auto rows = opened.query("PRAGMA user_version");
    if (!rows) return rows.error();
    auto version = static_cast<std::size_t>(rows->at(0).integer(0));
    if (version > schema.size()) {
        return failure(errc::invalid_argument,
                       fmt::format("{}: was written by a newer program (schema {}, this one knows {}): use that, or "
                                   "another file",
                                   file, version, schema.size()));
    }
    for (; version < schema.size(); ++version) {
        auto whole =
            fmt::format("BEGIN IMMEDIATE;\n{};\nPRAGMA user_version={};\nCOMMIT", schema[version], version + 1);
        auto done = opened.state_->script(whole);
        if (!done) {
            opened.rollback();
            return done.error();
        }
    }
    return opened;
}

result<database> database::open_to_read(const std::string& file) {
    auto opening = std::make_unique<state>(file);
    auto connected = opening->connect_to_read();
    if (!connected) return connected.error();
    return database(std::move(opening));
}

result<std::int64_t> database::execute(std::string_view sql, values bound) {
    auto done = attempt([&] { return state_->run(sql, std::span(bound.begin(), bound.size()), [](sqlite3_stmt*) {}); });
    if (!done) return done.error();
    return std::int64_t{sqlite3_changes64(state_->handle())};
}

result<std::vector<database_row>> database::query(std::string_view sql, values bound) {
    std::vector<database_row> rows;
    auto keep = [&](sqlite3_stmt* row) { rows.emplace_back(cells_of(row)); };
    auto done = attempt([&] {
        rows.clear();
        return state_->run(sql, std::span(bound.begin(), bound.size()), keep);
    });
    if (!done) return done.error();
    return rows;
}

result<void> database::begin() {
    return attempt([&] { return state_->script("BEGIN IMMEDIATE"); });
}

result<void> database::commit() {
    auto done = attempt([&] { return state_->script("COMMIT"); });
    if (!done) rollback();
    return done;
}

void database::rollback() noexcept {
    if (!is_open()) return;
    if (state_->in_transaction()) sqlite3_exec(state_->handle(), "ROLLBACK", nullptr, nullptr, nullptr);
}

std::int64_t database::last_insert_id() const noexcept { return sqlite3_last_insert_rowid(state_->handle()); }
const std::string& database::file() const noexcept { return state_->file(); }
void database::close() noexcept {
    replacing_.reset();
    state_->close();
}
bool database::is_open() const noexcept { return state_->handle() != nullptr; }

result<void> database::copy(const std::string& from, const std::string& to) {
    state source(from), target(to);
    if (auto opened = source.connect_to_read(); !opened) return opened;
    if (auto opened = target.connect(); !opened) return opened;
    auto* copying = sqlite3_backup_init(target.handle(), "main", source.handle(), "main");
    if (!copying) return target.failed("cannot be written over");
    sqlite3_backup_step(copying, -1);
    if (sqlite3_backup_finish(copying) != SQLITE_OK)
        return target.failed(fmt::format("cannot become a copy of {}", from));
    return {};
}

result<std::uint64_t> database::keep_readable(const std::string& damaged) {
    constexpr std::string_view tables =
        "SELECT name FROM sqlite_master WHERE type = 'table' AND name NOT LIKE 'sqlite%'";
    constexpr std::string_view columns = "SELECT name FROM pragma_table_info(?)";
    auto source = open_to_read(damaged);
    if (!source) return source.error();
    auto here = query(tables);
    if (!here) return here.error();
    if (auto begun = begin(); !begun) return begun.error();
    std::uint64_t kept = 0;
    for (const auto& row : *here) {
        auto table = row.text(0);
        auto ours = query(columns, {table}), theirs = source->query(columns, {table});
        if (!ours || !theirs) continue;
        std::string names = "rowid", places = "?";
        for (const auto& column : *ours) {
            auto same = [&](const database_row& other) { return other.text(0) == column.text(0); };
            if (std::ranges::none_of(*theirs, same)) continue;
            names += fmt::format(", \"{}\"", column.text(0));
            places += ", ?";
        }
        auto put = fmt::format("INSERT OR IGNORE INTO \"{}\"({}) VALUES({})", table, names, places);
        std::optional<failure> refused;
        auto keep = [&](sqlite3_stmt* found) {
            auto done = refused ? result<void>() : state_->run(put, cells_of(found), [](sqlite3_stmt*) {});
            if (!done) refused = done.error();
            else if (!refused) kept += static_cast<std::uint64_t>(sqlite3_changes64(state_->handle()));
        };
        // From both ends up to where it is damaged.
        for (const auto* order : {"", " DESC"}) {
            auto all = fmt::format("SELECT {} FROM \"{}\" ORDER BY rowid{}", names, table, order);
            if (source->state_->run(all, {}, keep)) break;
        }
        if (refused) {
            rollback();
            return *refused;
        }
    }
    if (auto done = commit(); !done) return done.error();
    return kept;
}

when_damaged when_damaged::keeping_readable(when_damaged how) {
    how.begun = [log = how.log, then = std::move(how.begun)](database& fresh, const std::string& aside) {
        auto kept = fresh.keep_readable(aside);
        if (kept)
            log.warning("what can be read of the damaged database is kept again", {{"rows", std::to_string(*kept)}});
        else log.error("nothing of the damaged database can be kept again", {{"cause", kept.error().message()}});
        if (then) then(fresh, aside);
    };
    return how;
}

result<std::string> set_aside(const std::string& file, const failure& cause, std::chrono::system_clock::time_point now,
                              const logger& log) {
    auto failed = [&](const std::string& why) {
        return failure(errc::io_failed, fmt::format("{}: cannot be set aside: {}", file, why));
    };
    if (in_memory(file)) return failed("it lies in memory");
    auto stamp = fmt::format("{}.damaged-{:%Y%m%dT%H%M%SZ}", file, std::chrono::floor<std::chrono::seconds>(now));
    auto taken = [](const std::string& path) {
        struct stat there {};
        return ::lstat(path.c_str(), &there) == 0;
    };
    if (!taken(file)) return failed("it is not there");
    auto aside = stamp;
    for (int i = 2; taken(aside); ++i) aside = fmt::format("{}-{}", stamp, i);
    // The main file last: a log that stayed behind would be played into the next file of that name.
    for (const auto* part : parts_of_a_file | std::views::reverse) {
        auto path = file + part;
        if (!taken(path)) continue;
        if (::rename(path.c_str(), (aside + part).c_str()) != 0) return failed(std::strerror(errno));
    }
    log.error("a database is damaged and was set aside; a new one takes its place",
              {{"cause", cause.message()}, {"set aside as", aside}});
    return aside;
}

} // namespace ise
