// ise_seeds: plays random deployments on the virtual world and checks the invariants. See --help.
#include "pool.hpp"
#include "run.hpp"

#include <fmt/format.h>

#include <charconv>
#include <cstdio>
#include <cstring>
#include <optional>
#include <string>
#include <thread>

namespace {

constexpr const char* usage = R"(usage: ise_seeds [options]

Plays one deployment a seed on the virtual world: random components, traffic and faults, with the invariants of the
design checked after each event. A seed is played the same way every time.
  --seeds N     how many (default 200)
  --from S      the first one (default 1)
  --seed S      only this one
  --verbose     prints the plan and each event; with --seed
  --jobs N      processes at once (default: one a core)
  --time T      begins no further seed after so many seconds
  --plant BUG   with a bug planted between the library and the models, which are to find it
  --help        this text

Exit codes: 0 all passed, 1 an invariant did not hold, 2 wrong arguments.
)";

std::optional<std::uint64_t> number(std::string_view text) {
    std::uint64_t value = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (problem != std::errc() || end != text.data() + text.size() || text.empty()) return {};
    return value;
}

int refuse(const std::string& why) {
    fmt::print(stderr, "ise_seeds: {}\n\n{}", why, usage);
    return 2;
}

} // namespace

int main(int count, char** words) {
    seeds::pool_options options;
    options.jobs = std::max(1u, std::thread::hardware_concurrency());
    bool only = false;
    for (int at = 1; at < count; ++at) {
        std::string_view word = words[at];
        if (word == "--help") {
            fmt::print("{}", usage);
            return 0;
        }
        if (word == "--verbose") {
            options.run.verbose = true;
            continue;
        }
        bool known = word == "--seeds" || word == "--from" || word == "--seed" || word == "--jobs" ||
                     word == "--time" || word == "--plant";
        if (!known) return refuse(fmt::format("unknown argument: {}", word));
        if (at + 1 == count) return refuse(fmt::format("{} needs a value", word));
        std::string_view text = words[++at];
        if (word == "--plant") {
            for (const auto& one : seeds::all_bugs())
                if (one.name == text) options.run.planted = one.what;
            if (options.run.planted == seeds::bug::none) return refuse(fmt::format("no such bug: {}", text));
            continue;
        }
        auto value = number(text);
        if (!value || (*value == 0 && word != "--from" && word != "--seed"))
            return refuse(fmt::format("{} takes a number, not: {}", word, text));
        if (word == "--seeds") options.seeds = *value;
        if (word == "--from") options.from = *value;
        if (word == "--seed") options.from = *value, options.seeds = 1, only = true;
        if (word == "--jobs") options.jobs = static_cast<unsigned>(std::min<std::uint64_t>(*value, 256));
        if (word == "--time") options.seconds = static_cast<double>(*value);
    }
    if (options.run.verbose && !only) return refuse("--verbose goes with --seed");
    return seeds::play_all(options) ? 0 : 1;
}
