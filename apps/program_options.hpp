#pragma once
#include <apps/command_line.hpp>
#include <ise/component/node_options.hpp>
#include <ise/core/log.hpp>
#include <ise/core/time_text.hpp>
#include <ise/transport/security.hpp>

#include <fmt/format.h>

#include <cstdlib>
#include <string>
#include <string_view>

/// An option with a duration, such as 2s or 500ms, from `least` to `most`, which are written in the same way. `into`
/// outlives the parse.
inline command_line::option* add_duration(command_line::app& app, const std::string& name, ise::duration& into,
                                          std::string_view least, std::string_view most,
                                          const std::string& description) {
    auto take = [&into, name, least, most](const std::string& text) {
        auto given = ise::parse_duration(text);
        if (!given) throw command_line::parse_error(name, given.error().message());
        if (*given < *ise::parse_duration(least) || *given > *ise::parse_duration(most))
            throw command_line::parse_error(name, fmt::format("'{}' is not from {} to {}", text, least, most));
        into = *given;
    };
    return app.add_option(name, take, description)->type_name("TIME");
}

/// --key, --key-legacy, --tls and --access, as every program has them. `given` outlives the parse.
inline void add_credentials(command_line::app& app, ise::security_options& given) {
    app.add_option("--key", given.key_file,
                   "a file with the shared key of the system; peers without it are refused (default: $ISE_KEY)")
        ->type_name("FILE");
    app.add_flag(
        "--key-legacy",
        [] {
            static char set[] = "ISE_KEY_LEGACY=1"; // for processes that it starts, too
            ::putenv(set);
        },
        "prove the key by the scheme of earlier versions, without encryption (also ISE_KEY_LEGACY=1)");
    app.add_option("--tls", given.tls_folder,
                   "a folder with ca.pem, certificate.pem and key.pem, for tls:// endpoints (default: $ISE_TLS)")
        ->type_name("FOLDER");
    app.add_option("--access", given.access_file,
                   "a file with the access policy (default: $ISE_ACCESS, else nothing is refused)")
        ->type_name("FILE");
}

/// --audit, for programs that provide services.
inline void add_audit(command_line::app& app, ise::security_options& given) {
    app.add_option("--audit", given.audit_file,
                   "a file that gets a line of JSON for each refusal and each change allowed (default: $ISE_AUDIT)")
        ->type_name("FILE");
}

/// --metrics, --traces and --trace-rate, for programs that run as long as the system. `given` outlives the parse.
inline void add_observing(command_line::app& app, ise::node_options& given) {
    app.add_option("--metrics", given.metrics,
                   "serve metrics to Prometheus there: a port of the loopback interface, or an address with a port "
                   "(default: $ISE_METRICS, else none)")
        ->type_name("ADDRESS");
    app.add_option("--traces", given.traces,
                   "a file, or the http URL of a collector, that gets spans of calls as OTLP/JSON (default: "
                   "$ISE_TRACES, else none)")
        ->type_name("TARGET");
    app.add_option(
           "--trace-rate", given.trace_rate,
           "share of the traces begun here that are kept (default: $ISE_TRACE_RATE, else the first 100 a second)")
        ->check(command_line::range(0.0, 1.0))
        ->type_name("SHARE");
}

/// --log-level. `level` outlives the parse.
inline void add_log_level(command_line::app& app, ise::log_level& level) {
    auto known = command_line::is_member({"debug", "info", "warning", "error"});
    known.description.clear(); // the option's says it
    app.add_option(
           "--log-level",
           [&level](const std::string& name) {
               using enum ise::log_level;
               for (auto each : {debug, info, warning, error})
                   if (name == ise::name_of(each)) level = each;
           },
           "minimum level of log lines on stderr: debug, info, warning or error")
        ->check(known)
        ->type_name("LEVEL")
        ->default_str(std::string(ise::name_of(level)));
}
