#include "database.hpp"

#include <fmt/format.h>
#include <sqlite3.h>

#include <map>

namespace atirma {

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

/// "memory:NAME" in SQLite's words; others are files.
std::string location_of(const std::string& file) {
    constexpr std::string_view memory = "memory:";
    if (!file.starts_with(memory)) return file;
    return fmt::format("file:{}?mode=memory&cache=shared", file.substr(memory.size()));
}

} // namespace

class database::state {
public:
    explicit state(std::string file) : file_(std::move(file)) {}
    state(const state&) = delete;
    state& operator=(const state&) = delete;
    ~state() {
        statements_.clear();
        sqlite3_close_v2(handle_);
    }

    ise::failure failed(std::string_view doing) const {
        return ise::failure(ise::errc::io_failed, fmt::format("{}: {}: {}", file_, doing, sqlite3_errmsg(handle_)));
    }

    ise::result<void> connect() {
        int flags = SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX;
        if (sqlite3_open_v2(location_of(file_).c_str(), &handle_, flags, nullptr) != SQLITE_OK)
            return failed("cannot be opened");
        sqlite3_busy_timeout(handle_, 2000);
        return script("PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA foreign_keys=ON");
    }

    ise::result<void> connect_to_read() {
        int flags = SQLITE_OPEN_READONLY | SQLITE_OPEN_URI | SQLITE_OPEN_NOMUTEX;
        if (sqlite3_open_v2(location_of(file_).c_str(), &handle_, flags, nullptr) != SQLITE_OK)
            return failed("cannot be opened");
        sqlite3_busy_timeout(handle_, 2000);
        return {};
    }

    ise::result<void> script(std::string_view sql) {
        if (sqlite3_exec(handle_, std::string(sql).c_str(), nullptr, nullptr, nullptr) != SQLITE_OK)
            return failed(sql.substr(0, sql.find('\n')));
        return {};
    }

    /// Calls `on_row` for each row. Statements are compiled once; their number is that of the texts in the program.
    template <class OnRow>
    ise::result<void> run(std::string_view sql, std::initializer_list<database_value> values, OnRow on_row) {
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
    const std::string& file() const noexcept { return file_; }

private:
    ise::failure finish(sqlite3_stmt* step, std::string_view sql) {
        auto why = failed(sql);
        sqlite3_reset(step);
        sqlite3_clear_bindings(step);
        return why;
    }

    std::string file_;
    sqlite3* handle_ = nullptr;
    std::map<std::string, statement, std::less<>> statements_;
};

database::database(std::unique_ptr<state> opened) : state_(std::move(opened)) {}
database::database(database&&) noexcept = default;
database& database::operator=(database&&) noexcept = default;
database::~database() = default;

ise::result<database> database::open(const std::string& file, std::span<const std::string_view> schema) {
    auto opening = std::make_unique<state>(file);
    auto connected = opening->connect();
    if (!connected) return connected.error();
    database opened(std::move(opening));

    auto rows = opened.query("PRAGMA user_version");
    if (!rows) return rows.error();
    auto version = static_cast<std::size_t>(rows->at(0).integer(0));
    if (version > schema.size()) {
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("{}: was written by a newer program (schema {}, this one knows {}): use that, or "
                                        "another file", file, version, schema.size()));
    }
    for (; version < schema.size(); ++version) {
        auto whole = fmt::format("BEGIN IMMEDIATE;\n{};\nPRAGMA user_version={};\nCOMMIT", schema[version], version + 1);
        auto done = opened.state_->script(whole);
        if (!done) {
            opened.rollback();
            return done.error();
        }
    }
    return opened;
}

ise::result<database> database::open_to_read(const std::string& file) {
    auto opening = std::make_unique<state>(file);
    auto connected = opening->connect_to_read();
    if (!connected) return connected.error();
    return database(std::move(opening));
}

ise::result<std::int64_t> database::execute(std::string_view sql, values bound) {
    auto done = state_->run(sql, bound, [](sqlite3_stmt*) {});
    if (!done) return done.error();
    return std::int64_t{sqlite3_changes64(state_->handle())};
}

ise::result<std::vector<database_row>> database::query(std::string_view sql, values bound) {
    std::vector<database_row> rows;
    auto done = state_->run(sql, bound, [&](sqlite3_stmt* row) {
        std::vector<database_value> cells;
        for (int column = 0; column < sqlite3_column_count(row); ++column) cells.push_back(cell(row, column));
        rows.emplace_back(std::move(cells));
    });
    if (!done) return done.error();
    return rows;
}

ise::result<void> database::begin() { return state_->script("BEGIN IMMEDIATE"); }

ise::result<void> database::commit() {
    auto done = state_->script("COMMIT");
    if (!done) rollback();
    return done;
}

void database::rollback() noexcept {
    if (sqlite3_get_autocommit(state_->handle()) == 0) sqlite3_exec(state_->handle(), "ROLLBACK", nullptr, nullptr, nullptr);
}

std::int64_t database::last_insert_id() const noexcept { return sqlite3_last_insert_rowid(state_->handle()); }
const std::string& database::file() const noexcept { return state_->file(); }

} // namespace atirma
