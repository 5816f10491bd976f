#include "hosting.hpp"

#include <CLI/CLI.hpp>

#include <fmt/format.h>

#include <cstdlib>
#include <optional>

namespace atirma {
namespace {

/// A subcommand while it is read.
struct reading {
    explicit reading(ise::component_type of) : type(std::move(of)) {}

    ise::component_type type;
    hosted made;
    std::map<std::string, std::vector<std::string>> given; // of each parameter
};

CLI::Validator fits(const ise::parameter& declared) {
    return CLI::Validator(
        [declared](std::string& value) -> std::string {
            auto allowed = ise::check(declared, value);
            return allowed ? std::string() : allowed.error().message();
        },
        "");
}

void add_parameter(CLI::App& to, const ise::parameter& declared, std::vector<std::string>& given) {
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
    if (!declared.many) option->expected(1);
}

} // namespace

void add_components(CLI::App& run, std::vector<hosted>& into, std::vector<ise::component_type> types) {
    for (auto& type : types) {
        auto one = std::make_shared<reading>(std::move(type));
        auto& about = one->type.about;
        auto* sub = run.add_subcommand(about.name, about.description);
        one->made.path = about.path;
        one->made.make = one->type.make;
        sub->add_option("--path", one->made.path, "its name in the system")->capture_default_str();
        sub->add_option("--listen", one->made.listen,
                        "endpoints to listen on, such as tcp://0.0.0.0:7411 (default: in-process, local, loopback)")
            ->allow_extra_args(false);
        sub->add_option("--advertise", one->made.advertise, "further endpoints at which it can be reached")
            ->allow_extra_args(false);
        sub->add_option("--role", one->made.roles, "a role to serve, and the priority in it, such as atirma/gateway=5")
            ->type_name("ROLE=PRIORITY")
            ->allow_extra_args(false);
        for (const auto& declared : one->type.parameters.all())
            add_parameter(*sub, declared, one->given[declared.name]);
        sub->final_callback([one, &into] {
            for (const auto& [name, values] : one->given)
                for (const auto& value : values) {
                    auto set = one->type.parameters.set(name, value);
                    if (!set) throw CLI::ValidationError("--" + name, set.error().message());
                }
            auto taken = one->type.parameters.set_from([](const std::string& name) -> std::optional<std::string> {
                const char* result = std::getenv(name.c_str());
                return result ? std::optional<std::string>(result) : std::nullopt;
            });
            if (!taken) throw CLI::ValidationError(one->type.about.name, taken.error().message());
            one->made.parameters = one->type.live();
            into.push_back(one->made);
        });
    }
}

} // namespace atirma
