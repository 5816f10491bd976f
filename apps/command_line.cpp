#include "command_line.hpp"

#include <ise/core/readable.hpp>

#include <CLI/CLI.hpp>

#include <algorithm>
#include <iostream>
#include <sstream>
#include <string_view>
#include <utility>

namespace command_line {
namespace {

// Lines that fit a terminal.
class wrapped_help : public CLI::Formatter {
public:
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
        return ise::wrapped(CLI::Formatter::make_help(app, std::move(name), mode));
    }
};

class brief_format final : public CLI::Formatter {
public:
    brief_format() {
        column_width(28);
        label("Positionals", "Arguments");
        label("SUBCOMMAND", "COMMAND");
    }
    std::string make_option_opts(const CLI::Option* of) const override {
        if (of->get_positional() || of->get_type_size() == 0) return {};
        auto type = of->get_type_name();
        if (auto choices = type.find('{'); choices != type.npos) {
            type.erase(0, choices);
            std::ranges::replace(type, ',', '|');
        }
        return " " + type.substr(0, type.find(':')); // behind it is what checks it
    }
    std::string make_subcommand(const CLI::App* one) const override {
        std::ostringstream line;
        CLI::detail::format_help(line, one->get_name(), one->get_description(), 14);
        return line.str();
    }
    std::string make_help(const CLI::App* app, std::string name, CLI::AppFormatMode mode) const override {
        return ise::wrapped(make_description(app) + make_usage(app, std::move(name)) + make_subcommands(app, mode) +
                            make_positionals(app) + make_groups(app, mode) + "\n" + make_footer(app));
    }
};

const CLI::Formatter& format_of(const CLI::App& app) {
    return static_cast<const CLI::Formatter&>(*app.get_formatter());
}

validator validator_of(const CLI::Validator& of) {
    return {[of](std::string word) { return of(word); }, of.get_description()};
}

option_info info_of(const CLI::Option& of) {
    option_info made;
    made.description = of.get_description();
    made.takes_value = of.get_items_expected_max() > 0;
    auto type = of.get_type_name(); // "TEXT:{bash,fish,zsh}"
    if (auto from = type.find('{'), to = type.find('}'); from != type.npos && to > from)
        made.choices = CLI::detail::split(type.substr(from + 1, to - from - 1), ',');
    if (of.get_positional()) made.names = {of.get_name()};
    else {
        for (const auto& name : of.get_lnames()) made.names.push_back("--" + name);
        for (const auto& name : of.get_snames()) made.names.push_back("-" + name);
    }
    return made;
}

constexpr std::string_view no_command_text = "A subcommand is required"; // which CLI11 does not name

} // namespace

validator range(int low, int high) { return validator_of(CLI::Range(low, high)); }
validator range(unsigned low, unsigned high) { return validator_of(CLI::Range(low, high)); }
validator range(std::uint64_t low, std::uint64_t high) { return validator_of(CLI::Range(low, high)); }
validator range(double low, double high) { return validator_of(CLI::Range(low, high)); }
validator is_member(const std::vector<std::string>& choices) { return validator_of(CLI::IsMember(choices)); }
validator existing_file() { return validator_of(CLI::ExistingFile); }

option* option::required(bool is) { return of_->required(is), this; }
option* option::description(const std::string& text) { return of_->description(text), this; }
option* option::type_name(const std::string& name) { return of_->type_name(name), this; }
option* option::check(const validator& what) { return of_->check(what.fault, what.description), this; }
option* option::as_size() { return of_->transform(CLI::AsSizeValue(true)), this; }
option* option::needs(const option* other) { return of_->needs(other->of_), this; }
option* option::excludes(const option* other) { return of_->excludes(other->of_), this; }
option* option::delimiter(char between) { return of_->delimiter(between), this; }
option* option::allow_extra_args(bool allow) { return of_->allow_extra_args(allow), this; }
option* option::expected(int least, int most) { return of_->expected(least, most), this; }
option* option::envname(const std::string& variable) { return of_->envname(variable), this; }
option* option::default_str(const std::string& shown) { return of_->default_str(shown), this; }
option* option::capture_default_str() { return of_->capture_default_str(), this; }
std::size_t option::count() const { return of_->count(); }

app::app(const std::string& description, const std::string& name)
    : app_(std::make_shared<CLI::App>(description, name)) {
    app_->formatter(std::make_shared<wrapped_help>());
}

option* app::keep(CLI::Option* made) { return &options_.emplace_back(made); }

option* app::add_option(const std::string& names, std::string& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, double& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, unsigned& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, std::uint64_t& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, std::optional<double>& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, std::optional<int>& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, std::optional<unsigned>& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, std::optional<std::uint64_t>& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, std::vector<std::string>& into, const std::string& description) {
    return keep(app_->add_option(names, into, description));
}
option* app::add_option(const std::string& names, const std::function<void(const std::string&)>& take,
                        const std::string& description) {
    return keep(app_->add_option_function<std::string>(names, take, description));
}
option* app::add_flag(const std::string& names, bool& into, const std::string& description) {
    return keep(app_->add_flag(names, into, description));
}
option* app::add_flag(const std::string& names, std::vector<std::string>& into, const std::string& description) {
    return keep(app_->add_flag(names, into, description));
}
option* app::add_flag(const std::string& names, const std::function<void()>& given, const std::string& description) {
    return keep(app_->add_flag_callback(names, given, description));
}
void app::set_version_flag(const std::string& name, const std::string& version) {
    app_->set_version_flag(name, version);
}

option* app::get_option(const std::string& name) {
    const auto* wanted = app_->get_option(name);
    return &*std::ranges::find(options_, wanted, &option::of_);
}

app* app::add_subcommand(const std::string& name, const std::string& description) {
    auto* made = app_->add_subcommand(name, description);
    commands_.emplace_back(new app(std::shared_ptr<CLI::App>(app_, made), this));
    return commands_.back().get();
}

void app::require_subcommand(std::size_t number) { app_->require_subcommand(static_cast<int>(number)); }
void app::require_subcommand(std::size_t least, std::size_t most) { app_->require_subcommand(least, most); }
void app::group(const std::string& name) { app_->group(name); }
void app::footer(const std::string& text) { app_->footer(text); }
void app::fallthrough() { app_->fallthrough(); }
void app::brief_help() { app_->formatter(std::make_shared<brief_format>()); }
void app::callback(const std::function<void()>& what) { app_->callback(what); }

void app::parse(int count, const char* const* words) { parse(std::vector<std::string>(words + 1, words + count)); }

void app::parse(std::vector<std::string> words) {
    using enum parse_error::reason;
    std::ranges::reverse(words); // the last word first, as CLI11 takes them
    try {
        app_->parse(std::move(words));
    } catch (const CLI::CallForHelp&) {
        throw parse_error(asked, app_->help());
    } catch (const CLI::CallForVersion& version) {
        throw parse_error(asked, std::string(version.what()) + "\n");
    } catch (const CLI::ExtrasError& wrong) {
        throw parse_error(extra_word, wrong.what(), app_->remaining(true).at(0));
    } catch (const CLI::ParseError& wrong) {
        throw parse_error(wrong.what() == no_command_text ? no_command : invalid, wrong.what());
    }
}

bool app::parsed() const { return app_->parsed(); }

const app* app::chosen() const {
    auto given = app_->get_subcommands();
    if (given.empty()) return nullptr;
    return std::ranges::find(commands_, given.back(), [](const auto& one) { return one->app_.get(); })->get();
}

int app::exit(const parse_error& why) const {
    if (why.why() == parse_error::reason::asked) {
        std::cout << why.what() << std::flush;
        return 0;
    }
    std::string text = why.what();
    if (why.why() == parse_error::reason::no_command) {
        text = "one of these is required:";
        const auto* of = this;
        while (const auto* below = of->chosen()) of = below;
        for (const auto& one : of->commands_) text += " " + one->name();
    }
    std::cerr << name() << ": " << text << "\nRun with --help for more information.\n" << std::flush;
    return 2;
}

const std::string& app::name() const { return app_->get_name(); }

command_info app::info() const {
    command_info made{name(), app_->get_description(), {}, {}, {}};
    for (const auto* one : std::as_const(*app_).get_options())
        (one->get_positional() ? made.arguments : made.options).push_back(info_of(*one));
    for (const auto& below : commands_) made.commands.push_back(below->info());
    return made;
}

std::string app::usage(const std::string& as) const { return format_of(*app_).make_usage(app_.get(), as); }

std::string app::options_help() const {
    std::string lines;
    for (const auto* one : std::as_const(*app_).get_options())
        if (one != app_->get_help_ptr() && !one->check_lname("version"))
            lines += format_of(*app_).make_option(one, false);
    return lines;
}

} // namespace command_line
