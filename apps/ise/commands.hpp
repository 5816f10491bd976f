#pragma once
#include "conversation.hpp"

#include <cstdint>
#include <optional>
#include <string>

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
    std::string json = "{}"; ///< the request
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
    bool losses = false;                ///< each packet in an envelope that tells what was lost before it
};
task<> echo(context& in, echo_options options);

struct hz_options {
    subscribe_choice what;
    duration window = std::chrono::seconds(1);
    std::optional<std::uint64_t> count; ///< windows until it ends
};
task<> hz(context& in, hz_options options);

} // namespace ise::cli
