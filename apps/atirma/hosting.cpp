#include "hosting.hpp"

#include <components/boat/boat_names.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cstdlib>
#include <optional>
#include <set>
#include <sstream>
#include <string_view>

namespace atirma {
namespace {

using given_values = std::map<std::string, std::vector<std::string>>; // of each parameter

constexpr std::size_t max_boats = 1000;
// Each boat has its own.
constexpr std::array<std::string_view, 6> of_each_boat{"boat-simulator", "xbee-link",     "xbee-proxy",
                                                       "gprs-proxy",     "iridium-proxy", "communication-node"};
// Paths that several boats may share: these files are only read.
constexpr std::array<std::string_view, 4> read_only{"ca-file", "fence", "jwt-key", "wind"};

/// A subcommand while it is read.
struct reading {
    explicit reading(ise::component_type of) : type(std::move(of)) {}

    ise::component_type type;
    hosted made;
    given_values given;
    std::size_t boats = 1;
};

ise::component_type type_named(const std::string& name, const ise::type_maker& types) {
    auto all = types();
    return std::move(*std::find_if(all.begin(), all.end(), [&](const auto& one) { return one.about.name == name; }));
}

void set_values(ise::component_type& of, const given_values& values) {
    for (const auto& [name, all] : values)
        for (const auto& value : all) {
            auto set = of.parameters.set(name, value);
            if (!set) throw command_line::parse_error("--" + name, set.error().message());
        }
    auto taken = of.parameters.set_from([](const std::string& name) -> std::optional<std::string> {
        const char* result = std::getenv(name.c_str());
        return result ? std::optional<std::string>(result) : std::nullopt;
    });
    if (!taken) throw command_line::parse_error(of.about.name, taken.error().message());
}

std::vector<std::string> parts_of(const std::string& list) {
    std::vector<std::string> parts;
    std::istringstream from(list);
    for (std::string part; std::getline(from, part, ',');) parts.push_back(part);
    return parts;
}

/// The values for a boat, given those of the first: presets name the boat, too. Each boat has gusts of its own.
given_values values_of(const ise::component_type& type, given_values values, std::size_t number) {
    auto boat = boat_name(number);
    for (const auto& declared : type.parameters.all()) {
        auto& all = values[declared.name];
        bool preset = all.empty() && !declared.preset.empty();
        if (preset && declared.many) all = parts_of(declared.preset);
        else if (preset) all = {declared.preset};
        auto before = all;
        for (auto& one : all) one = of_boat(one, boat);
        if (declared.name == "seed") all = {std::to_string(std::stoull(all.front()) + number - 1)};
        else if (preset && all == before) all.clear(); // it may come from the environment
    }
    return values;
}

/// Two boats must not use one database, key or device; `used` has those of the boats before.
void check_own_paths(const ise::parameter_set& of, std::set<std::pair<std::string, std::string>>& used) {
    for (const auto& declared : of.all()) {
        if (declared.kind != ise::parameter_kind::path ||
            std::ranges::find(read_only, declared.name) != read_only.end())
            continue;
        for (const auto& path : of.values(declared)) {
            if (path.empty() || used.emplace(declared.name, path).second) continue;
            auto own = path;
            own.insert(own.rfind('/') + 1, "{boat}-");
            throw command_line::parse_error("--" + declared.name,
                                            fmt::format("several boats cannot use '{}' together; give each its own, "
                                                        "such as --{} '{}'",
                                                        path, declared.name, own));
        }
    }
}

command_line::validator fits(const ise::parameter& declared) {
    auto fault = [declared](const std::string& value) {
        auto allowed = ise::check(declared, value);
        return allowed ? std::string() : allowed.error().message();
    };
    return {fault, ""};
}

void add_parameter(command_line::app& to, const ise::parameter& declared, std::vector<std::string>& given) {
    auto name = "--" + declared.name;
    auto about = declared.description;
    if (!declared.preset.empty()) about += fmt::format(" (default: {})", declared.preset);
    if (declared.kind == ise::parameter_kind::boolean) {
        // Accepts "--gusts", "--gusts=false" and "--no-gusts".
        to.add_flag(name + ",!--no-" + declared.name, given, about)->check(fits(declared));
        return;
    }
    auto* option = to.add_option(name, given, about)->check(fits(declared))->type_name(ise::allowed_values(declared));
    option->allow_extra_args(false);
    if (!declared.many) option->expected(1, 1);
}

} // namespace

void add_components(command_line::app& run, std::vector<hosted>& into, const ise::type_maker& types) {
    for (auto& type : types()) {
        auto one = std::make_shared<reading>(std::move(type));
        auto& about = one->type.about;
        auto* sub = run.add_subcommand(about.name, about.description);
        one->made.path = about.path;
        sub->add_option("--path", one->made.path, "its name in the system")->capture_default_str();
        sub->add_option(
               "--listen", one->made.listen,
               "endpoints to listen on, such as tcp://0.0.0.0:7411 (default: in-process, shared memory, a local "
               "socket and a port of the loopback interface)")
            ->allow_extra_args(false);
        sub->add_option("--advertise", one->made.advertise, "further endpoints at which it can be reached")
            ->allow_extra_args(false);
        sub->add_option("--role", one->made.roles, "a role to serve, and the priority in it, such as atirma/gateway=5")
            ->type_name("ROLE=PRIORITY")
            ->allow_extra_args(false);
        if (std::ranges::find(of_each_boat, about.name) != of_each_boat.end())
            sub->add_option("--boats", one->boats,
                            "run it for so many boats: atirma, boat-2, boat-3...; in values {boat} is the boat's name, "
                            "and atirma/shore becomes boat-2/shore")
                ->check(command_line::range(std::size_t{1}, max_boats))
                ->capture_default_str();
        for (const auto& declared : one->type.parameters.all())
            add_parameter(*sub, declared, one->given[declared.name]);
        sub->callback([one, &into, types] {
            std::set<std::pair<std::string, std::string>> used;
            for (std::size_t number = 1; number <= one->boats; ++number) {
                auto own = type_named(one->type.about.name, types);
                set_values(own, one->boats > 1 ? values_of(own, one->given, number) : one->given);
                check_own_paths(own.parameters, used);
                auto made = one->made;
                if (one->boats > 1) {
                    auto boat = boat_name(number);
                    made.path = of_boat(made.path, boat);
                    for (auto& role : made.roles) role = of_boat(role, boat);
                }
                made.make = own.make;
                made.parameters = own.live();
                into.push_back(std::move(made));
            }
        });
    }
}

} // namespace atirma
