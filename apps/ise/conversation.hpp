#pragma once
#include "exit_code.hpp"
#include "interrupt.hpp"
#include "output.hpp"

#include <ise/component/component.hpp>
#include <ise/transport/security.hpp>

#include <functional>
#include <string>

namespace ise::cli {

/// What every command is told.
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

/// A command while it talks to components: the anonymous component that it is, and where its answer goes.
struct context {
    component& self;
    const settings& set;
    output& out;
    time_point until;  ///< the answer, or the first of them, is waited for so long
    interrupt& ctrl_c; ///< for who has something to put right

    duration left() const { return std::max(duration(std::chrono::milliseconds(1)), until - self.now()); }
};

/// `endless` commands are ended by Ctrl-C in the usual way.
struct conversation {
    std::function<task<>(context&)> body;
    bool endless = false;
    bool looks = false; ///< under a name of its own, so that it is known where sessions are shown
};

/// What the user wants: a conversation, or a text that is there already.
struct wish {
    settings set;
    conversation talk; ///< empty: print `text`
    std::string text;
};

/// Runs a command to its end, a failure or Ctrl-C; says on standard error why it failed.
exit_code run(const settings& set, const conversation& what);

/// Where the name server is; problem(usage) if what was given is no endpoint.
endpoint name_server_of(const settings& set, const environment& env);

/// Tells a person, or with `--json` a program, why there is no answer.
void report(const problem& why, bool json);
/// Something to know beside the answer.
void note(const settings& set, const std::string& text);

} // namespace ise::cli
