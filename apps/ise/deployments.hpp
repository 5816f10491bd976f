#pragma once
#include "hosts.hpp"

#include <ise/deployment/planning.hpp>
#include <ise/deployment/reading.hpp>

#include <map>
#include <string>
#include <vector>

namespace ise::cli {

/// What all commands about a deployment are told.
struct deployment_options {
    std::string file;
    std::vector<std::string> only; ///< components of the file; none: all
    std::vector<std::string> set;  ///< variables of the file: NAME=VALUE
    std::vector<std::string> move; ///< HOST=OTHER: what the file places on the one runs on the other
    bool keep = false;             ///< of an `up` that fails: what it did is not undone
    bool offline = false;          ///< nobody is asked
};
/// FILE, `--set` and `--move-from`.
void add_file(command_line::app& app, deployment_options& into);

/// The instantiation servers that are there, with what they tell.
struct fleet {
    std::map<std::string, remote> servers; ///< by name
    std::vector<deployment::host_state> hosts;
};

/// The file, and all that is wrong with it as far as it tells by itself; problem(usage) only where the command line is
/// wrong.
deployment::reading read_what_there_is(context& in, const deployment_options& options);
deployment::reading read_what_there_is(environment& env, const deployment_options& options);

/// The file; problem(usage) with all that is wrong with it, each on a line with its place.
deployment::deployment read_file(context& in, const deployment_options& options);

/// Asks all instantiation servers. One that a component of the file is to run on must answer: problem(not_reached);
/// others are told in a note. With `settled`, instances of the deployment that are just starting or stopping are waited
/// for.
task<fleet> ask_hosts(context& in, const deployment::deployment& of, bool settled);

/// Asks the hosts what they have against what the file, completed, wants of them: it stands in `of.hosts` then.
task<> check_starts(context& in, const deployment::deployment& wanted, fleet& of);

/// problem(usage) if there are any.
void refuse(const std::string& file, const std::vector<deployment::problem>& problems);

} // namespace ise::cli
