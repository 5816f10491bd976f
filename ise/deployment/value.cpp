#include <ise/deployment/value.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::deployment {

std::string place::text() const { return line == 0 ? file : fmt::format("{}:{}:{}", file, line, column); }

std::string problem::text() const { return fmt::format("{}: {}", at.text(), what); }

const entry* value::find(const std::string& key) const {
    auto found = std::ranges::find(entries, key, &entry::key);
    return found == entries.end() ? nullptr : &*found;
}

std::string value::plain() const {
    switch (is) {
        case kind::text: return text;
        case kind::integer: return std::to_string(integer);
        case kind::number: return fmt::format("{}", number);
        case kind::boolean: return boolean ? "true" : "false";
        case kind::array:
        case kind::table:
        case kind::unknown: break;
    }
    return {};
}

std::string_view value::kind_name() const {
    switch (is) {
        case kind::text: return "a text";
        case kind::integer: return "an integer";
        case kind::number: return "a number";
        case kind::boolean: return "true or false";
        case kind::array: return "an array";
        case kind::table: return "a table";
        case kind::unknown: break;
    }
    return "?";
}

value laid_over(value base, value over) {
    if (base.is != value::kind::table || over.is != value::kind::table) return over;
    for (auto& one : over.entries) {
        auto found = std::ranges::find(base.entries, one.key, &entry::key);
        if (found == base.entries.end()) {
            base.entries.push_back(std::move(one));
        } else {
            found->at = one.at;
            found->what = laid_over(std::move(found->what), std::move(one.what));
        }
    }
    base.at = over.at;
    return base;
}

} // namespace ise::deployment
