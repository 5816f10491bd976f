#include "options.hpp"

#include "text.hpp"

#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <iostream>

namespace ise::cli {
namespace {

// At most what a JSON text may have anyway.
std::string read_input() {
    const std::size_t most = json_limits().max_text_bytes;
    std::string text;
    char piece[4096];
    while (std::cin.read(piece, sizeof piece) || std::cin.gcount() > 0) {
        text.append(piece, static_cast<std::size_t>(std::cin.gcount()));
        if (text.size() > most)
            throw problem(exit_code::mismatch, "too_large", fmt::format("standard input has more than {} bytes", most));
    }
    return text;
}

command_line::validator positive_count() {
    auto check = [](const std::string& word) {
        std::uint64_t number = 0;
        auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), number);
        bool fits = problem == std::errc() && end == word.data() + word.size() && number > 0;
        return fits ? std::string() : fmt::format("'{}' is not a whole number from 1 on", printable(word));
    };
    return {check, ""};
}

duration positive_time(const std::string& text, const std::string& option) {
    auto parsed = parse_duration(text);
    if (!parsed) throw problem(exit_code::usage, "usage", fmt::format("{}: {}", option, parsed.error().message()));
    if (*parsed <= duration{})
        throw problem(exit_code::usage, "usage", fmt::format("{}: must be longer than nothing", option));
    return *parsed;
}

template <class Into>
command_line::option* add_time_to(command_line::app& app, const std::string& name, Into& into,
                                  const std::string& description) {
    auto read = [&into, name](const std::string& text) { into = positive_time(text, name); };
    return app.add_option(name, read, description)->type_name("TIME");
}

} // namespace

std::string json_given(const std::string& text) {
    if (text.empty()) return "{}";
    return text == "-" ? read_input() : text;
}

void add_component(command_line::app& app, std::string& name) {
    app.add_option("NAME", name, component_name)->required();
}

void add_prefix(command_line::app& app, std::string& prefix) {
    app.add_option("PREFIX", prefix, "only this path and what is below it");
}

command_line::option* add_count(command_line::app& app, std::optional<std::uint64_t>& into,
                                const std::string& description) {
    return app.add_option("--count,-n", into, description)->type_name("N")->check(positive_count());
}

command_line::option* add_time(command_line::app& app, const std::string& name, duration& into,
                               const std::string& description) {
    return add_time_to(app, name, into, description);
}

command_line::option* add_time(command_line::app& app, const std::string& name, std::optional<duration>& into,
                               const std::string& description) {
    return add_time_to(app, name, into, description);
}

command_line::option* add_each(command_line::app& app, const std::string& name, std::vector<std::string>& into,
                               const std::string& description, const std::string& type) {
    return app.add_option(name, into, description)->type_name(type)->allow_extra_args(false);
}

std::pair<std::string, std::string> name_and_value(const std::string& text, std::string_view option,
                                                   std::string_view type) {
    auto equals = text.find('=');
    if (equals == 0 || equals == std::string::npos)
        throw problem(exit_code::usage, "usage", fmt::format("{} takes {}, not '{}'", option, type, text));
    return {text.substr(0, equals), text.substr(equals + 1)};
}

command_line::validator one_of(std::vector<std::string> choices) {
    auto name = fmt::format("{{{}}}", fmt::join(choices, ",")); // completion reads it
    auto check = [choices = std::move(choices)](const std::string& word) {
        return std::ranges::find(choices, word) != choices.end()
                   ? std::string()
                   : fmt::format("'{}' is none of {}", printable(word), fmt::join(choices, ", "));
    };
    return {check, name};
}

} // namespace ise::cli
