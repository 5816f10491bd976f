#include "arguments.hpp"

#include "text.hpp"

#include <ise/packet/json.hpp>

#include <CLI/CLI.hpp>

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

} // namespace

std::string json_given(const std::string& text) {
    if (text.empty()) return "{}";
    return text == "-" ? read_input() : text;
}

void add_subscription(CLI::App& command, subscribe_choice& what, std::string& json) {
    command.add_option("NAME", what.name, "path of a component, or endpoint such as tcp://127.0.0.1:7411")->required();
    command.add_option("SERVICE", what.service, "name of a subscription service")->required();
    command.add_option("JSON", json, "subscribe request; - reads standard input (default: {})");
    auto* latest = command.add_flag("--latest", what.latest, "keep only the latest packet");
    command
        .add_flag("--lossless", what.lossless,
                  "every packet, with flow control; a subscription that falls too far behind ends")
        ->excludes(latest);
    command.add_option("--depth", what.depth, "packets queued at either end, 1 to 65536 (default: 1024)")
        ->check(CLI::Range(1u, 65536u))
        ->type_name("N");
}

CLI::Validator one_of(std::vector<std::string> choices) {
    auto name = "{" + CLI::detail::join(choices, ",") + "}"; // completion reads it
    auto check = [choices = std::move(choices)](std::string& word) {
        return std::ranges::find(choices, word) != choices.end()
                   ? std::string()
                   : fmt::format("'{}' is none of {}", printable(word), CLI::detail::join(choices, ", "));
    };
    return {check, name};
}

CLI::Validator positive_count() {
    auto check = [](std::string& word) {
        std::uint64_t number = 0;
        auto [end, problem] = std::from_chars(word.data(), word.data() + word.size(), number);
        bool fits = problem == std::errc() && end == word.data() + word.size() && number > 0;
        return fits ? std::string() : fmt::format("'{}' is not a whole number from 1 on", printable(word));
    };
    return {check, ""};
}

duration positive_time(const std::string& text, std::string_view option) {
    auto parsed = parse_duration(text);
    if (!parsed) throw problem(exit_code::usage, "usage", fmt::format("{}: {}", option, parsed.error().message()));
    if (*parsed <= duration{})
        throw problem(exit_code::usage, "usage", fmt::format("{}: must be longer than nothing", option));
    return *parsed;
}

} // namespace ise::cli
