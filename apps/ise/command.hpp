#pragma once
#include "exit_code.hpp"
#include "output.hpp"

#include <apps/command_line.hpp>
#include <ise/component/component.hpp>
#include <ise/core/loop.hpp>
#include <ise/transport/security.hpp>

#include <algorithm>
#include <functional>
#include <memory>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <string_view>

namespace ise::cli {

/// The options of all commands.
struct settings {
    std::string name_server; ///< empty: ISE_NAME_SERVER, else the default
    duration timeout = std::chrono::seconds(5);
    bool wait = false;         ///< for a component that is not there yet
    bool json = false;         ///< for programs
    bool pretty = false;       ///< JSON over several lines
    std::string as;            ///< the path that it claims; empty: none
    bool verbose = false;      ///< the log goes to standard error
    security_options security; ///< empty: ISE_KEY and ISE_TLS
};

/// Ctrl-C, SIGTERM or the end of its terminal, for a command that has something to put right before it ends. Without a
/// handler it just ends.
class interrupt {
public:
    /// From now on the first one calls `first` on the loop; the next one ends the command at once.
    void care(loop& on, std::function<void()> first);
    /// Removes the handler. It is not called once this returns, on the loop of `care`.
    void leave();
    /// A signal came; from any thread. False: the command is to end.
    bool raise();

private:
    std::mutex mutex_;
    std::shared_ptr<loop_gate> gate_;
    std::function<void()> first_;
    std::shared_ptr<bool> valid_ = std::make_shared<bool>(true); // of the loop
};

/// A command while it talks to components: the anonymous component that it is, and where its answer goes.
struct context {
    component& self;
    const settings& set;
    output& out;
    time_point until; ///< the answer, or the first of them, is waited for so long
    interrupt& ctrl_c;

    duration left() const { return std::max(duration(std::chrono::milliseconds(1)), until - self.now()); }
};

/// Commands that look at everything call themselves so, in order not to see themselves.
inline constexpr std::string_view looker_prefix = "ise/cli/";

/// A command line that was read: what is to be done.
struct parsed_command {
    settings set;
    std::function<task<>(context&)> work; ///< empty: print `text`
    std::string text;
    bool endless = false;             ///< ended by Ctrl-C in the usual way
    bool looks = false;               ///< under a name of its own, so that it is known where sessions are shown
    std::string stands_in;            ///< it runs as this component, which is registered when it is ready
    std::string listens_at;           ///< and listens there; empty: as every component
    std::optional<duration> patience; ///< the timeout where none is given
};

/// A command of `ise`: its file defines one, and the table (`all_commands`) lists it.
struct command {
    std::string_view name, group, summary, examples;
    /// Adds its options to `app` and lets `app.callback` fill in what is to be done.
    void (*declare)(command_line::app& app, parsed_command& made);
};

inline constexpr std::string_view see_group = "See what there is", talk_group = "Talk to a component",
                                  measure_group = "Measure and find faults", record_group = "Record and replay",
                                  run_group = "Start and stop components",
                                  deploy_group = "Whole systems, from a deployment file",
                                  shell_group = "Of the command itself";

/// Those of this system: linux/commands.cpp, windows/commands.cpp.
std::span<const command* const> all_commands();

/// Reads the command line, and standard input where it says `-`. Throws problem(usage).
parsed_command read_command_line(int count, const char* const* arguments);

/// Runs a command to its end, a failure or Ctrl-C; reports on standard error why it failed.
exit_code run(const parsed_command& what);

/// Where the name server is; problem(usage) if what was given is no endpoint.
std::vector<endpoint> name_servers_of(const settings& set, const environment& env);

/// Reports to a person, or with `--json` to a program, why there is no answer.
void report(const problem& why, bool json);
/// Something to know beside the answer.
void note(const settings& set, const std::string& text);

} // namespace ise::cli
