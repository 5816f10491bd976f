#include <ise/deployment/toml.hpp>

#include <ise/core/toml_text.hpp>

#include <toml++/toml.h>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace ise::deployment {
namespace {

class converter {
public:
    converter(const std::string& file, std::vector<problem>& problems) : file_(file), problems_(problems) {}

    value convert(const toml::node& from) {
        value made;
        made.at = place_of(from.source());
        if (const auto* table = from.as_table()) {
            fill(made, *table);
        } else if (const auto* array = from.as_array()) {
            made.is = value::kind::array;
            for (const auto& one : *array) made.items.push_back(convert(one));
        } else if (const auto* text = from.as_string()) {
            made.is = value::kind::text;
            made.text = text->get();
        } else if (const auto* integer = from.as_integer()) {
            made.is = value::kind::integer;
            made.integer = integer->get();
        } else if (const auto* number = from.as_floating_point()) {
            made.is = value::kind::number;
            made.number = number->get();
            if (!std::isfinite(made.number)) problems_.push_back({made.at, "numbers are finite here"});
        } else if (const auto* boolean = from.as_boolean()) {
            made.is = value::kind::boolean;
            made.boolean = boolean->get();
        } else {
            problems_.push_back({made.at, "dates and times are no values here: write a text"});
        }
        return made;
    }

    place place_of(const toml::source_region& where) const { return {file_, where.begin.line, where.begin.column}; }

private:
    void fill(value& into, const toml::table& from) {
        for (const auto& [key, node] : from)
            into.entries.push_back({std::string(key.str()), place_of(key.source()), convert(node)});
        // The library keeps them by name.
        std::ranges::stable_sort(into.entries, {},
                                 [](const entry& one) { return std::pair(one.at.line, one.at.column); });
    }

    const std::string& file_;
    std::vector<problem>& problems_;
};

// What stands for a value in the line of `at` and is a text without its quotes: of "name = boat" boat, and `at` is its
// place. Empty: nothing does.
std::string bare_word(const std::string& text, place& at) {
    std::size_t from = 0;
    for (std::uint32_t before = 1; before < at.line && from != std::string::npos; ++before) {
        auto end = text.find('\n', from);
        from = end == std::string::npos ? end : end + 1;
    }
    if (from == std::string::npos) return {};
    auto equals = text.find_first_of("=\"'#\n", from);
    if (equals == std::string::npos || text[equals] != '=') return {};
    auto begin = text.find_first_not_of(" \t", equals + 1);
    auto is_letter = [](char one) {
        return (one >= 'a' && one <= 'z') || (one >= 'A' && one <= 'Z') || one == '_' || one == '/' || one == '.' ||
               one == '~' || one == '$';
    };
    if (begin == std::string::npos || !is_letter(text[begin])) return {};
    auto word = text.substr(begin, text.find_first_of(" \t\r\n,#\"'", begin) - begin);
    for (std::string_view value : {"true", "false", "inf", "nan"})
        if (word == value) return {};
    at.column = static_cast<std::uint32_t>(begin - from + 1);
    return word;
}

} // namespace

value parse_toml(const std::string& text, const std::string& file, std::vector<problem>& problems) {
    converter made(file, problems);
    if (auto stray = stray_character(text)) {
        problems.push_back({place{file, stray->line, stray->column}, stray_character_text});
        return {};
    }
    auto parsed = toml::parse(std::string_view(text), std::string_view(file));
    if (parsed) return made.convert(parsed.table());
    auto at = made.place_of(parsed.error().source());
    auto word = bare_word(text, at);
    problems.push_back({at, word.empty() ? std::string(parsed.error().description())
                                         : fmt::format("{0} is not a value: put it in quotes, \"{0}\"", word)});
    return {};
}

} // namespace ise::deployment
