#pragma once
#include <cstdint>
#include <functional>
#include <list>
#include <memory>
#include <optional>
#include <stdexcept>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
} // namespace CLI

/// The command line of a program, by CLI11 and with its names. CLI11 itself is compiled in command_line.cpp only, since
/// it takes seconds in each file that includes it. What options are read into outlives the parse.
namespace command_line {

/// A condition that a value has to meet.
struct validator {
    std::function<std::string(const std::string&)> fault; ///< why a value is refused; empty: it is accepted
    std::string description;                              ///< in the help; empty: not there
};
validator range(int low, int high);
validator range(unsigned low, unsigned high);
validator range(std::uint64_t low, std::uint64_t high);
validator range(double low, double high);
validator is_member(const std::vector<std::string>& choices);
validator existing_file();

/// A flag, an option with a value, or an argument, which is known by its place.
class option {
public:
    explicit option(CLI::Option* of) : of_(of) {}

    option* required(bool is = true);
    option* description(const std::string& text);
    option* type_name(const std::string& name);
    option* check(const validator& what);
    option* as_size(); ///< takes units, such as 500MB; the value is in bytes
    option* needs(const option* other);
    option* excludes(const option* other);
    option* delimiter(char between);
    option* allow_extra_args(bool allow);  ///< several values after one name
    option* expected(int least, int most); ///< values of one option
    option* envname(const std::string& variable);
    option* default_str(const std::string& shown);
    option* capture_default_str();
    std::size_t count() const; ///< how often it was given

private:
    friend class app;
    CLI::Option* of_;
};

/// An option as completion scripts need it.
struct option_info {
    std::vector<std::string> names; ///< "--json", "-n"; of an argument one: "NAME"
    std::string description;
    bool takes_value = false;
    std::vector<std::string> choices;
};

/// A command with everything below it.
struct command_info {
    std::string name;
    std::string description;
    std::vector<option_info> options;
    std::vector<option_info> arguments;
    std::vector<command_info> commands;
};

/// Why a command line is not executed: it is wrong, or asks for help or the version.
class parse_error : public std::runtime_error {
public:
    enum class reason {
        invalid,
        asked, ///< for help or version, which is the text
        no_command,
        extra_word
    };

    /// A value that proves wrong after the parse.
    parse_error(const std::string& option, const std::string& fault) : runtime_error(option + ": " + fault) {}
    parse_error(reason why, const std::string& text, std::string extra = {})
        : runtime_error(text), why_(why), extra_(std::move(extra)) {}

    reason why() const { return why_; }
    const std::string& extra_word() const { return extra_; }

private:
    reason why_ = reason::invalid;
    std::string extra_;
};

/// A program or one of its subcommands.
class app {
public:
    app(const std::string& description, const std::string& name);
    app(const app&) = delete;
    app& operator=(const app&) = delete;

    option* add_option(const std::string& names, std::string& into, const std::string& description);
    option* add_option(const std::string& names, double& into, const std::string& description);
    option* add_option(const std::string& names, unsigned& into, const std::string& description);
    option* add_option(const std::string& names, std::uint64_t& into, const std::string& description);
    option* add_option(const std::string& names, std::optional<double>& into, const std::string& description);
    option* add_option(const std::string& names, std::optional<int>& into, const std::string& description);
    option* add_option(const std::string& names, std::optional<unsigned>& into, const std::string& description);
    option* add_option(const std::string& names, std::optional<std::uint64_t>& into, const std::string& description);
    option* add_option(const std::string& names, std::vector<std::string>& into, const std::string& description);
    option* add_option(const std::string& names, const std::function<void(const std::string&)>& take,
                       const std::string& description);
    option* add_flag(const std::string& names, bool& into, const std::string& description);
    /// A flag that takes a value, too: --gusts=false.
    option* add_flag(const std::string& names, std::vector<std::string>& into, const std::string& description);
    option* add_flag(const std::string& names, const std::function<void()>& given, const std::string& description);
    void set_version_flag(const std::string& name, const std::string& version);
    option* get_option(const std::string& name);

    /// It inherits how help looks, the footer and the group.
    app* add_subcommand(const std::string& name, const std::string& description);
    void require_subcommand(std::size_t number);
    void require_subcommand(std::size_t least, std::size_t most); ///< `most` 0: as many as there are
    void group(const std::string& name);
    void footer(const std::string& text);
    void fallthrough(); ///< its options may be given behind its subcommands
    /// Commands before options, and of an option nothing but its value. Lines fit a terminal in any help.
    void brief_help();
    /// Called for what was given once all has been read.
    void callback(const std::function<void()>& what);

    void parse(int count, const char* const* words);
    void parse(std::vector<std::string> words); ///< without the program's
    bool parsed() const;                        ///< this subcommand was given
    const app* chosen() const;                  ///< its subcommand that was given last
    /// After a failed parse: prints the help that was asked for, or what is wrong, as "PROGRAM: what". Exit code: 0 or
    /// 2.
    int exit(const parse_error& why) const;

    const std::string& name() const;
    const app* parent() const { return parent_; }
    command_info info() const;
    std::string usage(const std::string& as) const; ///< the line of its help, as of a program of that name
    std::string options_help() const;               ///< the lines on its options but --help and --version

private:
    app(std::shared_ptr<CLI::App> made, const app* parent) : app_(std::move(made)), parent_(parent) {}
    option* keep(CLI::Option* made);

    std::shared_ptr<CLI::App> app_;
    const app* parent_ = nullptr;
    std::list<option> options_;
    std::vector<std::unique_ptr<app>> commands_;
};

} // namespace command_line
