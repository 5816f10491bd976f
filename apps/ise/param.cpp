// ise param: the parameters of a running component.
#include "hosts.hpp"
#include "json.hpp"
#include "options.hpp"
#include "table.hpp"
#include "text.hpp"

#include <ise/component/parameter_services.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <memory>

namespace ise::cli {
namespace {

struct param_options {
    std::string act, name, parameter;
    std::optional<std::string> value;
    bool names = false; ///< nothing but their names
};

struct param_line {
    std::string name;
    std::vector<std::string> values;
    std::string_view kind;
    std::string allowed, preset;
    bool changeable = false;
    std::string description;
};

param_line parameter_line(const parameter_info& of) {
    return {of.about.name,   of.values,           ise::name_of(of.about.kind), allowed_values(of.about),
            of.about.preset, of.about.changeable, of.about.description};
}

std::string parameter_table(const context& in, const std::vector<parameter_info>& all) {
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
    return {exit_code::not_reached, "no_such_service", fmt::format("'{}' has no parameters that can be read", name),
            "those of programs built on ise::main do, and what was launched with component_type::live()"};
}

task<std::vector<parameter_info>> ask_parameters(context& in, remote who, std::string name,
                                                 std::vector<std::string> which) {
    parameters_request question;
    question.names = std::move(which);
    auto response = co_await who.try_call(parameters_service, std::move(question), in.left());
    if (!response) throw without_parameters(name, response.error());
    co_return std::move(response->parameters);
}

/// The instantiation server that has started a component sets its parameters, so that they hold after a restart too;
/// none if it was started otherwise. Throws a problem if a server that may have started it does not answer.
task<std::optional<host_server>> starter_of(context& in, std::string path) {
    std::vector<host_server> hosts;
    try {
        hosts = co_await hosts_there(in, "");
    } catch (const problem& none) {
        if (none.name() != "no_such_name") throw;
    }
    std::optional<problem> unknown;
    for (const auto& host : hosts) {
        auto started = co_await instances_of(in, host, path);
        if (!started) {
            failure why(started.error().code(),
                        fmt::format("nothing was set: the instantiation server of {} may have started '{}', and does "
                                    "not answer: {}",
                                    host.name, path, started.error().message()));
            unknown.emplace(why, "a value that is set without that server holds until the next start only: try again");
            continue;
        }
        for (const auto& one : *started)
            if (one.path == path && one.process_id != 0) co_return host;
    }
    if (unknown) throw problem(*unknown);
    co_return std::nullopt;
}

task<> note_lost_starter(context& in, component_info about) {
    for (const auto& lost : co_await lost_hosts(in))
        if (lost.host_name == about.host_name)
            note(in.set, fmt::format("{} on {} was lost without being stopped: if it has started {}, the value holds "
                                     "until the next start only; start that server again with the same --state, and "
                                     "set the value again",
                                     lost.path, lost.host_name, about.path));
}

task<> set_parameter(context& in, remote who, param_options options) {
    std::optional<host_server> starter;
    std::string path;
    if (options.name.find("://") == std::string::npos) {
        auto about = co_await ask_about(in, who); // its own path: the name may be a role
        path = about.path;
        starter = co_await starter_of(in, path);
        if (!starter) co_await note_lost_starter(in, std::move(about));
    }
    if (starter) {
        instantiation::set_request request;
        request.path = path;
        request.settings.push_back({options.parameter, *options.value});
        auto response = co_await starter->server.try_call(instantiation::services::set, std::move(request), in.left());
        if (!response) throw said_against(response.error());
    } else {
        change_parameters_request request;
        request.settings.push_back({options.parameter, *options.value});
        auto response = co_await who.try_call(change_parameters_service, std::move(request), in.left());
        if (!response) throw without_parameters(options.name, response.error());
    }
}

void check_words(const param_options& options) {
    auto need = [&](bool given, const char* what) {
        if (!given)
            throw problem(exit_code::usage, "usage", fmt::format("ise param {} requires {}", options.act, what),
                          fmt::format("ise param list {}", options.name));
    };
    auto refuse = [&](bool given, const char* what) {
        if (given)
            throw problem(exit_code::usage, "usage", fmt::format("ise param {} does not accept {}", options.act, what));
    };
    if (options.act == "list") return refuse(!options.parameter.empty(), "PARAMETER");
    need(!options.parameter.empty(), "a PARAMETER");
    if (options.act == "set") need(options.value.has_value(), "a VALUE");
    else refuse(options.value.has_value(), "VALUE");
}

task<> param(context& in, param_options options) {
    check_words(options);
    auto who = co_await reach(in, options.name);
    if (options.act == "set") co_await set_parameter(in, who, options);
    std::vector<std::string> which;
    if (!options.parameter.empty()) which.push_back(options.parameter);
    auto all = co_await ask_parameters(in, who, options.name, std::move(which));
    std::string text;
    if (options.names) {
        for (const auto& one : all) text += printable(one.about.name) + "\n";
    } else if (options.act != "list") {
        for (const auto& value : all.front().values)
            if (!in.set.json) text += printable(value) + "\n";
        if (in.set.json) text = json_line(parameter_line(all.front()));
    } else if (in.set.json) {
        std::vector<param_line> lines;
        for (const auto& one : all) lines.push_back(parameter_line(one));
        text = json_line(lines);
    } else {
        text = parameter_table(in, all);
    }
    co_await in.out.write(in.self, std::move(text));
}

void declare_param(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<param_options>();
    app.add_option("ACTION", given->act, "list, get or set")->required()->check(one_of({"get", "list", "set"}));
    add_component(app, given->name);
    app.add_option("PARAMETER", given->parameter, "of get and set: its name");
    auto read_value = [given](const std::string& text) { given->value = text; };
    app.add_option("VALUE", read_value, "of set: the new value");
    app.add_flag("--names", given->names, "of list: only the names");
    app.callback([&made, given] {
        made.patience = std::chrono::seconds(15);
        made.work = [given](context& in) { return param(in, *given); };
    });
}

} // namespace

extern const command param_command{
    "param", talk_group, "lists, reads or sets parameters of a running component",
    "  ise param list atirma/wind\n  ise param get atirma/wind speed\n  ise param set atirma/wind speed 8\n",
    declare_param};

} // namespace ise::cli
