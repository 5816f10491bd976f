#include "names.hpp"

#include "text.hpp"

#include <ise/naming/services.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <set>

namespace ise::cli {

void check_name(const std::string& name) {
    if (name.size() <= naming::max_path && naming::is_path(name)) return;
    std::string advice = "a path has letters, digits, '_', '-' and '.', with a '/' between its parts: atirma/boat";
    if (name.find(':') != name.npos) advice += "; an endpoint is written tcp://127.0.0.1:7411";
    if (name.size() > naming::max_path)
        advice = fmt::format("it has {} bytes, at most {} are allowed", name.size(), naming::max_path);
    throw problem(exit_code::usage, "usage", fmt::format("'{}' is not a name of a component", printable(cut(name, 80))),
                  std::move(advice));
}

void check_prefix(const std::string& prefix) {
    auto path = prefix;
    while (path.ends_with('/')) path.pop_back();
    if (!path.empty()) check_name(path);
    else if (!prefix.empty())
        throw problem(exit_code::usage, "usage", fmt::format("'{}' is not a prefix", prefix),
                      "paths do not begin with '/': ise list atirma");
}

void note_nothing(const context& in, const std::string& prefix, const std::vector<std::string>& known) {
    if (prefix.empty()) return note(in.set, "no component is registered");
    std::set<std::string> prefixes; // whatever would have found something
    for (const auto& path : known)
        for (auto at = path.find('/');; at = path.find('/', at + 1)) {
            prefixes.insert(path.substr(0, at));
            if (at == path.npos) break;
        }
    auto near = nearest(prefix, std::vector<std::string>(prefixes.begin(), prefixes.end()));
    for (auto& one : near) one = fmt::format("'{}'", one);
    note(in.set, fmt::format("no component is registered under '{}'{}", prefix,
                             near.empty() ? "" : fmt::format("; did you mean {}?", fmt::join(near, " or "))));
}

std::string names_are(std::size_t count) { return fmt::format("{} name{}", count, count == 1 ? " is" : "s are"); }

} // namespace ise::cli
