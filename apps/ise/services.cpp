#include "look.hpp"

#include "survey.hpp"
#include "table.hpp"
#include "text.hpp"

#include <ise/component/discover.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <map>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

struct parties {
    std::vector<std::string> providers, requirers;
};
// By name and kind: others may use the same word for something else.
std::map<std::pair<std::string, std::uint8_t>, parties> services_of(const std::vector<surveyed>& all, bool own) {
    std::map<std::pair<std::string, std::uint8_t>, parties> found;
    for (const auto& one : all) {
        if (!one.about) continue;
        for (const auto& service : one.about->services) {
            if (!own && is_own_service(service.name)) continue;
            auto& who = found[{service.name, service.kind}];
            (service.provided ? who.providers : who.requirers).push_back(one.name.path);
        }
    }
    return found;
}

std::string_view kind_name(std::uint8_t kind) {
    return ise::name_of(kind == 0 ? service_kind::request_response : service_kind::subscription);
}

struct type_users {
    schema of;
    std::vector<std::string> users; ///< "atirma/boat position (published packet)"
};
std::map<std::pair<std::string, std::uint64_t>, type_users> types_of(const std::vector<surveyed>& all, bool own) {
    std::map<std::pair<std::string, std::uint64_t>, type_users> found;
    for (const auto& one : all) {
        if (!one.about) continue;
        for (const auto& service : one.about->services) {
            if (!own && is_own_service(service.name)) continue;
            auto contract = contract_of(service);
            if (!contract) continue; // `ise describe` says why
            for (std::size_t place = 0; place < service.packets.size(); ++place) {
                const auto& packet = contract->packet(place);
                if (!own && packet.type().members.empty()) continue; // says nothing
                auto& into = found[{packet.name(), packet.fingerprint()}];
                into.of = packet;
                into.users.push_back(
                    fmt::format("{} {} ({})", one.name.path, service.name, role::name(contract->kind(), place)));
            }
        }
    }
    return found;
}

void tell_silent(const context& in, const std::vector<surveyed>& all, const std::string& prefix) {
    if (all.empty()) note_nothing(in, prefix);
    for (const auto& one : all)
        if (!one.about) note(in.set, fmt::format("{} does not answer: {}", one.name.path, one.trouble));
}

std::string services_as_json(const std::vector<surveyed>& all, bool own) {
    auto list = ordered_json::array();
    for (const auto& [key, who] : services_of(all, own)) {
        ordered_json told;
        told["name"] = key.first;
        told["kind"] = kind_name(key.second);
        told["providers"] = who.providers;
        told["requirers"] = who.requirers;
        list.push_back(std::move(told));
    }
    return list.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

table services_as_table(const std::vector<surveyed>& all, bool own) {
    table rows({"SERVICE", "KIND", "PROVIDED BY", "NEEDED BY"});
    for (const auto& [key, who] : services_of(all, own))
        rows.add({key.first, std::string(kind_name(key.second)),
                  who.providers.empty() ? "nobody" : fmt::format("{}", fmt::join(who.providers, " ")),
                  fmt::format("{}", fmt::join(who.requirers, " "))});
    return rows;
}

std::string types_as_json(const std::vector<surveyed>& all, bool own) {
    auto list = ordered_json::array();
    for (const auto& [key, one] : types_of(all, own)) {
        ordered_json told;
        told["name"] = key.first;
        told["fingerprint"] = fmt::format("{:016x}", key.second);
        told["schema"] = one.of.text();
        told["users"] = one.users;
        list.push_back(std::move(told));
    }
    return list.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

table types_as_table(const std::vector<surveyed>& all, bool own) {
    table rows({"TYPE", "FINGERPRINT", "USED BY"});
    for (const auto& [key, one] : types_of(all, own))
        rows.add({key.first, fmt::format("{:016x}", key.second), fmt::format("{}", fmt::join(one.users, ", "))});
    return rows;
}

using json_maker = std::string (*)(const std::vector<surveyed>&, bool own);
using table_maker = table (*)(const std::vector<surveyed>&, bool own);

task<> look_at_all(context& in, services_options options, json_maker as_json, table_maker as_table) {
    check_prefix(options.prefix);
    survey_options what;
    what.prefix = options.prefix;
    auto all = co_await survey(in, what);
    std::string text;
    if (in.set.json) text = as_json(all, options.all);
    else text = as_table(all, options.all).text(in.out.width()) + show_age(in, all);
    co_await in.out.write(in.self, std::move(text));
    tell_silent(in, all, options.prefix);
}

} // namespace

task<> services(context& in, services_options options) {
    return look_at_all(in, std::move(options), services_as_json, services_as_table);
}
task<> types(context& in, services_options options) {
    return look_at_all(in, std::move(options), types_as_json, types_as_table);
}

} // namespace ise::cli
