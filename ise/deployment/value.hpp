#pragma once
#include <cstdint>
#include <string>
#include <vector>

namespace ise::deployment {

/// Where something stands in a file; line 0: in no file, `file` says where it was given.
struct place {
    std::string file;
    std::uint32_t line = 0, column = 0;

    /// "atirma.toml:12:3"
    std::string text() const;
};

/// What is wrong, and where.
struct problem {
    place at;
    std::string what;

    /// "atirma.toml:12:3: …"
    std::string text() const;
};

struct entry;

/// A value of a deployment file, with its place.
struct value {
    enum class kind : std::uint8_t {
        text,
        integer,
        number,
        boolean,
        array,
        table,
        unknown, ///< made of a variable that there is not: a problem that is told already
    };

    kind is = kind::table;
    std::string text;
    std::int64_t integer = 0;
    double number = 0;
    bool boolean = false;
    std::vector<value> items;
    std::vector<entry> entries; ///< in the order of the file
    place at;

    const entry* find(const std::string& key) const;
    /// What it says, written as a parameter: of a text, a number or a boolean.
    std::string plain() const;
    /// "a text", "a table"…
    std::string_view kind_name() const;
};

struct entry {
    std::string key;
    place at;
    value what;
};

/// `over` laid over `base`: tables are joined key by key, anything else of `over` stands.
value laid_over(value base, value over);

} // namespace ise::deployment
