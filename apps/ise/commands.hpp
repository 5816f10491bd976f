#pragma once
#include "conversation.hpp"

#include <ise/instantiation/services.hpp>

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace ise::cli {

struct list_options {
    std::string prefix;
    bool names = false; ///< nothing but the paths
};
/// What the name server knows.
task<> list(context& in, list_options options);

struct describe_options {
    std::string name;
    bool all = false;   ///< ISE's own services too
    bool names = false; ///< nothing but the names of its services
};
/// What a component tells about itself.
task<> describe(context& in, describe_options options);

struct call_options {
    std::string name, service;
    std::string json; ///< the request; empty: none was given
};
task<> call(context& in, call_options options);

struct subscribe_choice {
    std::string name, service;
    std::string json = "{}"; ///< the subscribe request
    bool latest = false;
    bool lossless = false;
    std::uint32_t depth = 1024;
};

struct echo_options {
    subscribe_choice what;
    std::optional<std::uint64_t> count; ///< packets until it ends
    std::optional<duration> length;     ///< time until it ends
    duration every{};                   ///< rate limit
    bool no_last_value = false;
    bool losses = false; ///< each packet in an envelope that tells what was lost before it
};
task<> echo(context& in, echo_options options);

struct hz_options {
    subscribe_choice what;
    duration window = std::chrono::seconds(1);
    std::optional<std::uint64_t> count; ///< windows until it ends
};
task<> hz(context& in, hz_options options);

struct start_options {
    std::string type, name, host, name_space, protocol;
    std::vector<std::string> set, listen, variables, roles, limits;
    std::string process; ///< that it shares with others; empty: it has one to itself
    instantiation::restart_terms terms;
    bool types = false; ///< tell what could be started instead
    bool names = false; ///< nothing but their names
};
/// A component, by the instantiation server of a host.
task<> start(context& in, start_options options);

struct ps_options {
    std::string prefix, host;
    bool names = false;
};
/// What instantiation servers have started.
task<> ps(context& in, ps_options options);

struct instance_options {
    std::string name, host;
    std::optional<duration> grace; ///< of a stop
};
task<> stop(context& in, instance_options options);
task<> restart(context& in, instance_options options);
task<> kill(context& in, instance_options options);

struct deployment_options {
    std::string file;
    std::vector<std::string> only; ///< components of the file; none: all
    std::vector<std::string> set;  ///< variables of the file: NAME=VALUE
    bool keep = false;             ///< of an `up` that fails: what it did is not undone
    bool offline = false;          ///< nobody is asked
};
/// Brings the system to what a deployment file describes.
task<> up(context& in, deployment_options options);
/// Ends all that belongs to a deployment.
task<> down(context& in, deployment_options options);
/// What `up` would do.
task<> diff(context& in, deployment_options options);
/// Whether a deployment file can be used.
task<> validate(context& in, deployment_options options);

struct param_options {
    std::string act, name, parameter;
    std::optional<std::string> value;
    bool names = false; ///< nothing but their names
};
/// The parameters of a running component.
task<> param(context& in, param_options options);

struct logs_options {
    std::string name, host;
    bool follow = false;
    std::optional<std::size_t> lines;
};
/// What an instance has printed.
task<> logs(context& in, logs_options options);

} // namespace ise::cli
