#include <ise/component/program_words.hpp>

#include <ise/core/readable.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace ise::detail {
namespace {

std::string help_row(const std::string& left, const std::string& text, std::size_t column) {
    return fmt::format("  {:<{}}  {}{}\n", left, column,
                       left.size() > column ? "\n" + std::string(column + 4, ' ') : "", text);
}

std::string parameter_row(const parameter& of, std::size_t column) {
    auto text = fmt::format("{}: {}", of.description, allowed_values(of));
    if (of.many) text += "; several are allowed";
    if (of.changeable) text += "; also while it runs (ise param set)";
    text += fmt::format(" (default: {})", of.preset.empty() ? "none" : of.preset);
    return help_row("--" + of.name, text, column);
}

// Of the options that every type has.
std::string common_rows() {
    constexpr std::size_t column = 25;
    const std::array<std::pair<const char*, const char*>, 15> all{{
        {"--path=PATH", "the name that it registers (default: that of the type)"},
        {"--listen=ENDPOINT", "where it listens; several are allowed (default: in-process, shared memory, a local "
                              "socket and a port of the loopback interface)"},
        {"--advertise=ENDPOINT",
         "a further address to register, of a tunnel or an address translation; several are allowed"},
        {"--role=ROLE=PRIORITY", "a role that it serves; the highest priority is preferred; several are allowed"},
        {"--name-server=ENDPOINT", "(default: ISE_NAME_SERVER, else tcp://127.0.0.1:7400)"},
        {"--log-level=LEVEL", "debug, info, warning or error (default: info)"},
        {"--key=FILE", "a key that both sides of a session prove (default: ISE_KEY)"},
        {"--tls=FOLDER", "with ca.pem, certificate.pem and key.pem, for tls:// (default: ISE_TLS)"},
        {"--access=FILE", "with the access policy (default: ISE_ACCESS, else nothing is refused)"},
        {"--audit=FILE", "gets a line of JSON for each refusal and each change allowed (default: ISE_AUDIT)"},
        {"--demand-credentials=yes", "refuses to listen beyond this host without a key or TLS (default: no)"},
        {"--metrics=ADDRESS",
         "serves metrics to Prometheus there: a port of the loopback interface, or an address with a "
         "port (default: ISE_METRICS, else none)"},
        {"--traces=TARGET", "a file, or the http URL of a collector, that gets spans of calls as OTLP/JSON (default: "
                            "ISE_TRACES, else none)"},
        {"--trace-rate=SHARE",
         "of the traces that begin here, from 0 to 1 (default: ISE_TRACE_RATE, else the first 100 a second)"},
        {"--poll=MICROSECONDS", "how long its thread looks for work before it sleeps (default: ISE_POLL_US, else 0)"},
    }};
    std::string text;
    for (const auto& [name, what] : all) text += help_row(name, what, column);
    return text;
}

constexpr const char* exit_codes = "Exit codes: 0 ended as asked, 1 failed, 2 wrong arguments.\n";

} // namespace

std::string help_of(const std::string& program, const component_type& type) {
    const auto& about = type.about;
    auto text = fmt::format("{}: {}\nusage: {} run {} [--PARAMETER=VALUE]... [--OPTION=VALUE]...\n", about.name,
                            about.description, program, about.name);
    if (!about.path.empty()) text += fmt::format("path: {}\n", about.path);
    for (bool provided : {true, false}) {
        std::string names;
        for (const auto& one : about.services)
            if (one.provided == provided) names += (names.empty() ? "" : ", ") + one.name;
        if (!names.empty()) text += fmt::format("{}: {}\n", provided ? "provides" : "requires", names);
    }
    std::size_t column = 10;
    for (const auto& one : type.parameters.all())
        column = std::max(column, std::min<std::size_t>(one.name.size() + 2, 25));
    const auto& all = type.parameters.all();
    text += all.empty() ? "\nIt has no parameters.\n"
                        : fmt::format("\nParameters; one that is not given is read from the environment:\n"
                                      "{} for --{}.\n",
                                      variable_of(all.front()), all.front().name);
    for (const auto& one : type.parameters.all()) text += parameter_row(one, column);
    return wrapped(text + "\nOptions of every type:\n" + common_rows() + "\n" + exit_codes);
}

std::string help_of(const std::string& program, const std::vector<component_type>& types, bool shares) {
    auto text = fmt::format("usage: {0} run TYPE [--PARAMETER=VALUE]... [--OPTION=VALUE]...\n"
                            "       {0} run TYPE --help    its parameters and services\n"
                            "       {0} --describe    all types as JSON, for instantiation servers\n"
                            "       {0} --version | --help\n",
                            program);
    if (shares) text += fmt::format("       {} host --control=ENDPOINT... [--OPTION=VALUE]...\n", program);
    text += "\nTypes:\n";
    std::size_t column = 10;
    for (const auto& type : types) column = std::max(column, std::min<std::size_t>(type.about.name.size(), 25));
    for (const auto& type : types)
        text += help_row(type.about.name,
                         type.about.description +
                             (type.about.path.empty() ? "" : fmt::format(" (path: {})", type.about.path)),
                         column);
    return wrapped(text + "\nOptions of every type:\n" + common_rows() + "\n" + exit_codes);
}

} // namespace ise::detail
