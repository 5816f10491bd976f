#include <ise/instantiation/limits.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <charconv>
#include <utility>

namespace ise::instantiation {
namespace {

constexpr std::uint32_t max_pids = 32768;
constexpr std::uint64_t min_memory = std::uint64_t{1} << 20, max_memory = std::uint64_t{1} << 44;
constexpr double min_cpus = 0.01, max_cpus = 1024;

constexpr std::array<std::pair<std::string_view, std::uint64_t>, 8> size_units{{{"", 1},
                                                                                {"B", 1},
                                                                                {"kB", 1000},
                                                                                {"MB", 1000'000},
                                                                                {"GB", 1000'000'000},
                                                                                {"KiB", 1 << 10},
                                                                                {"MiB", 1 << 20},
                                                                                {"GiB", 1 << 30}}};

failure wrong_limit(std::string_view name, std::string_view text, std::string_view allowed) {
    return failure(errc::invalid_argument,
                   fmt::format("the limit {} is {}, not '{}'", name, allowed, text.substr(0, 80)));
}

constexpr std::string_view allowed_pids = "a number of processes and threads from 1 to 32768, such as 64";
constexpr std::string_view allowed_memory = "a size from 1 MiB to 16 TiB, such as \"256 MiB\"";
constexpr std::string_view allowed_cpus = "a number of processors from 0.01 to 1024, such as 0.5";

template <class Number>
bool read_number(std::string_view& text, Number& into) {
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), into);
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
    return problem == std::errc();
}

bool read_size(std::string_view text, std::uint64_t& into) {
    double number = 0;
    if (!read_number(text, number) || !(number >= 0)) return false;
    while (text.starts_with(' ')) text.remove_prefix(1);
    auto unit = std::ranges::find(size_units, text, &std::pair<std::string_view, std::uint64_t>::first);
    if (unit == size_units.end()) return false;
    auto bytes = number * static_cast<double>(unit->second);
    if (!(bytes >= static_cast<double>(min_memory) && bytes <= static_cast<double>(max_memory))) return false;
    into = static_cast<std::uint64_t>(bytes);
    return true;
}

} // namespace

result<void> set_limit(resource_limits& of, std::string_view name, std::string_view text) {
    auto rest = text;
    if (name == "pids") {
        bool read = read_number(rest, of.pids) && rest.empty();
        return read && check(of) ? result<void>() : wrong_limit(name, text, allowed_pids);
    }
    if (name == "memory") return read_size(text, of.memory) ? result<void>() : wrong_limit(name, text, allowed_memory);
    if (name == "cpus") {
        bool read = read_number(rest, of.cpus) && rest.empty() && of.cpus > 0;
        return read && check(of) ? result<void>() : wrong_limit(name, text, allowed_cpus);
    }
    return failure(errc::invalid_argument,
                   fmt::format("there is no limit '{}'; the limits are pids, memory and cpus", name.substr(0, 80)));
}

result<void> check(const resource_limits& limits) {
    if (limits.pids < 1 || limits.pids > max_pids)
        return wrong_limit("pids", fmt::format("{}", limits.pids), allowed_pids);
    if (limits.memory != 0 && (limits.memory < min_memory || limits.memory > max_memory))
        return wrong_limit("memory", fmt::format("{}", limits.memory), allowed_memory);
    if (limits.cpus != 0 && !(limits.cpus >= min_cpus && limits.cpus <= max_cpus))
        return wrong_limit("cpus", fmt::format("{}", limits.cpus), allowed_cpus);
    return {};
}

std::string as_text(const resource_limits& limits) {
    auto text = fmt::format("pids={}", limits.pids);
    if (limits.memory != 0) {
        auto mebi = std::uint64_t{1} << 20;
        text += limits.memory % mebi == 0 ? fmt::format(" memory={}MiB", limits.memory / mebi)
                                          : fmt::format(" memory={}B", limits.memory);
    }
    if (limits.cpus != 0) text += fmt::format(" cpus={}", limits.cpus);
    return text;
}

} // namespace ise::instantiation
