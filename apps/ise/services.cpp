// ise services, ise types: the services and packet types of all components.
#include "cpp_header.hpp"
#include "json.hpp"
#include "needs.hpp"
#include "options.hpp"
#include "survey.hpp"
#include "table.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/component/discover.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <map>
#include <memory>

namespace ise::cli {
namespace {

struct services_options {
    std::string prefix;
    bool all = false; ///< ISE's own too
    bool cpp = false; ///< of types: as a header
};

struct listed_service {
    std::string name;
    std::string_view kind;
    std::vector<std::string> providers, requirers;
    bool missing = false;
};
struct type_line {
    std::string name, fingerprint, schema;
    std::vector<std::string> users; ///< "atirma/boat position (published packet)"
};

std::vector<listed_service> listed_services(const std::vector<surveyed>& all, bool own, const std::string& prefix) {
    std::vector<listed_service> lines;
    for (auto& one : services_of(all, own))
        if (one.concerns(prefix))
            lines.push_back({std::move(one.name), kind_name(*one.example), std::move(one.providers),
                             std::move(one.users), one.missing});
    return lines;
}

std::vector<type_line> types_of(const std::vector<surveyed>& all, bool own, const std::string& prefix) {
    std::map<std::pair<std::string, std::uint64_t>, type_line> found;
    for (const auto& one : all) {
        if (!one.about || !naming::lies_below(one.name.path, prefix)) continue;
        for (const auto& service : one.about->services) {
            if (!own && is_own_service(service.name)) continue;
            auto contract = contract_of(service);
            if (!contract) continue; // `ise describe` says why
            for (std::size_t place = 0; place < service.packets.size(); ++place) {
                const auto& packet = contract->packet(place);
                if (!own && packet.type().members.empty()) continue; // says nothing
                auto& into = found[{packet.name(), packet.fingerprint()}];
                into.schema = packet.text();
                into.users.push_back(
                    fmt::format("{} {} ({})", one.name.path, service.name, role::name(contract->kind(), place)));
            }
        }
    }
    std::vector<type_line> lines;
    for (auto& [key, line] : found) {
        line.name = key.first;
        line.fingerprint = fmt::format("{:016x}", key.second);
        lines.push_back(std::move(line));
    }
    return lines;
}

void tell_silent(const context& in, const std::vector<surveyed>& all, const std::string& prefix) {
    auto asked_for = [&](const surveyed& one) { return naming::lies_below(one.name.path, prefix); };
    if (std::ranges::none_of(all, asked_for)) note_nothing(in, prefix);
    for (const auto& one : all)
        if (!one.about) note(in.set, fmt::format("{} does not answer: {}", one.name.path, one.trouble));
}

table table_of(const std::vector<listed_service>& lines) {
    table rows({"SERVICE", "KIND", "PROVIDED BY", "NEEDED BY"});
    for (const auto& one : lines)
        rows.add({one.name, std::string(one.kind),
                  one.missing             ? "MISSING"
                  : one.providers.empty() ? "nobody"
                                          : fmt::format("{}", fmt::join(one.providers, " ")),
                  fmt::format("{}", fmt::join(one.requirers, " "))});
    return rows;
}

table table_of(const std::vector<type_line>& lines) {
    table rows({"TYPE", "FINGERPRINT", "USED BY"});
    for (const auto& one : lines) rows.add({one.name, one.fingerprint, fmt::format("{}", fmt::join(one.users, ", "))});
    return rows;
}

using show_services = std::string (*)(const std::vector<surveyed>&, const services_options&, const context&);

template <auto lines_of>
std::string show_lines(const std::vector<surveyed>& all, const services_options& options, const context& in) {
    auto lines = lines_of(all, options.all, options.prefix);
    return in.set.json ? json_line(lines) : table_of(lines).text(in.out.width()) + show_age(in, all);
}

task<> look_at_all(context& in, services_options options, show_services show) {
    check_prefix(options.prefix);
    survey_options what; // of everything: others may use what these provide
    auto all = co_await survey(in, what);
    auto text = show(all, options, in);
    co_await in.out.write(in.self, std::move(text));
    tell_silent(in, all, options.prefix);
}

std::shared_ptr<services_options> declare_for_all(command_line::app& app, parsed_command& made, show_services show) {
    auto given = std::make_shared<services_options>();
    add_prefix(app, given->prefix);
    app.add_flag("--all", given->all, "ISE's own services too");
    app.callback([&made, given, show] {
        made.looks = true;
        made.work = [given, show](context& in) { return look_at_all(in, *given, show); };
    });
    return given;
}

task<> print_header(context& in, services_options options) {
    check_prefix(options.prefix);
    survey_options what;
    what.prefix = options.prefix;
    auto all = co_await survey(in, what);
    std::vector<header_part> parts;
    for (const auto& one : all) {
        if (!one.about) continue;
        header_part part{one.name.path, {}};
        for (const auto& service : one.about->services) {
            if (!service.provided || (!options.all && is_own_service(service.name))) continue;
            auto contract = contract_of(service);
            if (contract) part.services.push_back(std::move(*contract));
            else note(in.set, fmt::format("{}: {}", one.name.path, contract.error().message()));
        }
        if (!part.services.empty()) parts.push_back(std::move(part));
    }
    tell_silent(in, all, options.prefix);
    if (parts.empty())
        throw problem(exit_code::not_reached, "no_such_service", "there is no service to declare",
                      "ise services lists them; --all includes ISE's own");
    co_await in.out.write(in.self, cpp_header(parts));
}

void declare_services(command_line::app& app, parsed_command& made) {
    declare_for_all(app, made, show_lines<listed_services>);
}

void declare_types(command_line::app& app, parsed_command& made) {
    auto given = declare_for_all(app, made, show_lines<types_of>);
    app.add_flag("--cpp", given->cpp, "a C++ header with the packets and services that the components provide");
    app.callback([&made, given] {
        made.looks = true;
        made.work = [given](context& in) {
            return given->cpp ? print_header(in, *given) : look_at_all(in, *given, show_lines<types_of>);
        };
    });
}

} // namespace

extern const command services_command{"services", see_group, "lists services with their providers and users",
                                      "  ise services\n", declare_services};

extern const command types_command{
    "types", see_group, "the packet types, and where they are used",
    "  ise types atirma\n"
    "  ise types atirma/boat --cpp > boat.hpp   its packets and services, to be included\n",
    declare_types};

} // namespace ise::cli
