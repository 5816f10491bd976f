#include "commands.hpp"

#include "hosts.hpp"
#include "table.hpp"
#include "text.hpp"

#include <ise/component/parameter_services.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

ordered_json as_json(const parameter_text& of) {
    ordered_json told;
    told["name"] = of.about.name;
    told["values"] = of.values;
    told["kind"] = ise::name_of(of.about.kind);
    told["allowed"] = allowed_values(of.about);
    told["preset"] = of.about.preset;
    told["changeable"] = of.about.changeable;
    told["description"] = of.about.description;
    return told;
}

std::string line(const ordered_json& told) {
    return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::string as_page(const context& in, const std::vector<parameter_text>& all) {
    table rows({"PARAMETER", "VALUE", "CHANGEABLE", "ALLOWED", "WHAT"});
    for (const auto& one : all)
        rows.add({one.about.name, fmt::format("{}", fmt::join(one.values, ",")),
                  one.about.changeable ? "yes" : "at a start", allowed_values(one.about), one.about.description});
    return rows.text(in.out.width(), {}, {"CHANGEABLE", "ALLOWED"}, 24);
}

/// What was said against it, without the service by which we asked.
problem said_against(const failure& why) {
    auto text = why.message();
    bool answered =
        why.code() == errc::refused || why.code() == errc::invalid_argument || why.code() == errc::handler_failed;
    if (auto end = text.find(": "); answered && text.starts_with("'ise.") && end != text.npos) text.erase(0, end + 2);
    return problem(failure(why.code(), std::move(text), why.executed()));
}

problem without_parameters(const std::string& name, const failure& why) {
    if (why.code() != errc::no_such_service) return said_against(why);
    return {exit_code::not_reached, "no_such_service", fmt::format("'{}' tells of no parameters", name),
            "those of programs built on ise::main do, and what was launched with component_type::live()"};
}

task<std::vector<parameter_text>> ask(context& in, remote who, std::string name, std::vector<std::string> which) {
    parameters_request question;
    question.names = std::move(which);
    auto told = co_await who.try_call(parameters_service, std::move(question), in.left());
    if (!told) throw without_parameters(name, told.error());
    co_return std::move(told->parameters);
}

/// Whoever has started it sets them, so that they hold after a restart too; null where nobody has.
task<std::optional<host_server>> starter_of(context& in, std::string path) {
    std::vector<found_instance> all;
    try {
        all = co_await instances_there(in, "", path);
    } catch (const problem& none) {
        if (none.name() != "no_such_name") throw;
    }
    for (auto& one : all)
        if (one.instance.path == path && one.instance.process_id != 0) co_return one.host;
    co_return std::nullopt;
}

task<> set(context& in, remote who, param_options options) {
    std::optional<host_server> starter;
    std::string path;
    if (options.name.find("://") == std::string::npos) {
        auto about = co_await ask_about(in, who); // its own path: the name may be a role
        path = about.path;
        starter = co_await starter_of(in, path);
    }
    if (starter) {
        instantiation::set_request request;
        request.path = path;
        request.settings.push_back({options.parameter, *options.value});
        auto told = co_await starter->server.try_call(instantiation::services::set, std::move(request), in.left());
        if (!told) throw said_against(told.error());
    } else {
        change_parameters_request request;
        request.settings.push_back({options.parameter, *options.value});
        auto told = co_await who.try_call(change_parameters_service, std::move(request), in.left());
        if (!told) throw without_parameters(options.name, told.error());
    }
}

void check_words(const param_options& options) {
    auto need = [&](bool given, const char* what) {
        if (!given)
            throw problem(exit_code::usage, "usage", fmt::format("ise param {} takes {}", options.act, what),
                          fmt::format("ise param list {}", options.name));
    };
    auto refuse = [&](bool given, const char* what) {
        if (given) throw problem(exit_code::usage, "usage", fmt::format("ise param {} takes no {}", options.act, what));
    };
    if (options.act == "list") return refuse(!options.parameter.empty(), "PARAMETER");
    need(!options.parameter.empty(), "a PARAMETER");
    if (options.act == "set") need(options.value.has_value(), "a VALUE");
    else refuse(options.value.has_value(), "VALUE");
}

} // namespace

task<> param(context& in, param_options options) {
    check_words(options);
    auto who = co_await reach(in, options.name);
    if (options.act == "set") co_await set(in, who, options);
    std::vector<std::string> which;
    if (!options.parameter.empty()) which.push_back(options.parameter);
    auto all = co_await ask(in, who, options.name, std::move(which));
    std::string text;
    if (options.names) {
        for (const auto& one : all) text += printable(one.about.name) + "\n";
    } else if (options.act != "list") {
        for (const auto& value : all.front().values)
            if (!in.set.json) text += printable(value) + "\n";
        if (in.set.json) text = line(as_json(all.front()));
    } else if (in.set.json) {
        auto told = ordered_json::array();
        for (const auto& one : all) told.push_back(as_json(one));
        text = line(told);
    } else {
        text = as_page(in, all);
    }
    co_await in.out.write(in.self, std::move(text));
}

} // namespace ise::cli
