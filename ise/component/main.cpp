// environment-boundary: what a program's own main would do: its streams, its real environment
#include <ise/component/component_type.hpp>

#include <ise/component/observing.hpp>
#include <ise/component/poll_window.hpp>
#include <ise/component/program_words.hpp>
#include <ise/core/complain.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cstdio>

namespace ise {
namespace {

constexpr int failed = 1;
constexpr int wrong_arguments = 2;

using detail::parse_poll_window;
using detail::program_words;
using wrong = detail::wrong_words;

endpoint endpoint_of(const std::string& text) {
    auto at = endpoint::parse(text);
    if (!at) throw wrong(at.error().message());
    return *at;
}

log_level level_of(const std::string& text) {
    for (auto level : {log_level::debug, log_level::info, log_level::warning, log_level::error})
        if (text == name_of(level)) return level;
    throw wrong(fmt::format("--log-level is debug, info, warning or error, not '{}'", text));
}

bool yes_or_no(const std::string& name, const std::string& value) {
    if (value != "yes" && value != "no") throw wrong(fmt::format("--{} is yes or no, not '{}'", name, value));
    return value == "yes";
}

// Of the options that every type has; false: it is a parameter of the type.
bool take_common(program_words& to, const std::string& name, const std::string& value) {
    if (name == "path") to.path = value;
    else if (name == "listen") to.component.listen.push_back(endpoint_of(value));
    else if (name == "advertise") to.component.advertise.push_back(endpoint_of(value));
    else if (name == "role") {
        auto role = parse_role(value);
        if (!role) throw wrong(role.error().message());
        to.component.roles.insert(std::move(*role));
    } else if (name == "name-server") {
        auto all = parse_name_servers(value);
        if (!all) throw wrong("--name-server: " + all.error().message());
        to.node.name_servers = std::move(*all);
    } else if (name == "key") to.node.security.key_file = value;
    else if (name == "tls") to.node.security.tls_folder = value;
    else if (name == "access") to.node.security.access_file = value;
    else if (name == "audit") to.node.security.audit_file = value;
    else if (name == "metrics") to.node.metrics = value;
    else if (name == "traces") to.node.traces = value;
    else if (name == "trace-rate") {
        auto rate = detail::parse_trace_rate(value);
        if (!rate) throw wrong("--trace-rate: " + rate.error().message());
        to.node.trace_rate = *rate;
    } else if (name == "demand-credentials") to.node.security.demanded = yes_or_no(name, value);
    else if (name == "poll") {
        auto window = parse_poll_window(value);
        if (!window) throw wrong("--poll: " + window.error().message());
        to.node.poll = *window;
    } else if (name == "log-level") to.node.log = log_to_stderr(level_of(value));
    else return false;
    return true;
}

int run(component_type& type, program_words where, const std::string& program) {
    real_environment world;
    where.node.name = program;
    detail::take_parameters(type, where.component, world);
    where.component.policy = on_failure::stop_node;
    node running(world, std::move(where.node));
    running.launch(where.path, type.make(), std::move(where.component));
    int code = run_until_signal(running, [&] {
        fmt::print("started: {}\n", where.path);
        std::fflush(stdout);
    });
    for (const auto& report : running.reports()) {
        if (!report.failure.empty()) complain(program, fmt::format("{}: {}", report.path, report.failure));
        for (const auto& name : report.still_running)
            complain(program, fmt::format("{} did not end in time: {}", report.path, name));
    }
    return code;
}

// `again` is empty where the types were made once and for all.
int obey(std::vector<std::string> words, std::vector<component_type>& types, const type_maker& again,
         const std::string& program, const std::string& version) {
    std::string first = words.empty() ? "" : words.front();
    if (first == "--describe") return fmt::print("{}\n", describe_types(program, version, types, again != nullptr)), 0;
    if (first == "--version")
        return fmt::print("{} {}\n", program, version.empty() ? "(without a version)" : version), 0;
    if (first == "--help" || first == "-h")
        return fmt::print("{}", detail::help_of(program, types, again != nullptr)), 0;
    if (first == "host") {
        if (!again) throw wrong("components of this program cannot share a process: each runs in one of its own");
        words.erase(words.begin());
        auto where = detail::read_words(words, nullptr);
        if (where.help) return fmt::print("{}", detail::help_of(program, types, true)), 0;
        return detail::run_process_host(again, std::move(where), program);
    }
    if (first != "run" || words.size() < 2)
        throw wrong(fmt::format("say `{} run TYPE`; `{} --help` lists the types", program, program));
    if (words[1] == "--help" || words[1] == "-h")
        return fmt::print("{}", detail::help_of(program, types, again != nullptr)), 0;
    auto& type = detail::type_among(types, words[1]);
    words.erase(words.begin(), words.begin() + 2);
    auto where = detail::read_words(words, &type);
    if (where.help) return fmt::print("{}", detail::help_of(program, type)), 0;
    if (where.path.empty()) where.path = type.about.path;
    return run(type, std::move(where), program);
}

int guarded(int count, const char* const* words, std::vector<component_type> types, const type_maker& again,
            const std::string& version) {
    std::setvbuf(stdout, nullptr, _IOLBF, BUFSIZ); // what was printed before a crash reaches the log
    std::string program = count > 0 ? words[0] : "";
    program = program.substr(program.rfind('/') + 1);
    try {
        return obey({words + std::min(count, 1), words + count}, types, again, program, version);
    } catch (const wrong& why) {
        complain(program, why.what());
        return wrong_arguments;
    } catch (const std::exception& why) {
        complain(program, why.what());
        return failed;
    }
}

} // namespace

namespace detail {

component_type& type_among(std::vector<component_type>& types, const std::string& name) {
    std::string known;
    for (auto& type : types) {
        if (type.about.name == name) return type;
        known += (known.empty() ? "" : ", ") + type.about.name;
    }
    throw wrong(fmt::format("there is no type '{}'; the types are: {}", name, known));
}

program_words read_words(const std::vector<std::string>& words, component_type* type) {
    program_words where;
    for (std::size_t at = 0; at < words.size(); ++at) {
        std::string word = words[at], value;
        if (word == "--help" || word == "-h") {
            where.help = true;
            continue;
        }
        auto equals = word.find('=');
        if (!word.starts_with("--"))
            throw wrong(fmt::format("'{}' is not an option: options are written --name=value", word));
        if (equals != std::string::npos) value = word.substr(equals + 1);
        else if (++at < words.size()) value = words[at];
        else throw wrong(fmt::format("'{}' needs a value", word));
        auto name = word.substr(2, equals == std::string::npos ? equals : equals - 2);
        if (take_common(where, name, value)) continue;
        if (!type && name == "control") {
            where.control.push_back(endpoint_of(value));
            continue;
        }
        if (!type) throw wrong(fmt::format("'--{}' is not an option of `host`: --help", name));
        auto set = type->parameters.set(name, value);
        if (!set) throw wrong(set.error().message());
    }
    return where;
}

void take_parameters(component_type& type, component_options& into, environment& world) {
    auto taken = type.parameters.set_from([&](const std::string& name) { return world.variable(name); });
    if (!taken) throw wrong(taken.error().message());
    into.parameters = type.live();
}

} // namespace detail

std::string describe_types(const std::string& program, const std::string& version,
                           const std::vector<component_type>& types, bool shares) {
    program_info made;
    made.shares_process = shares;
    made.program = program;
    made.version = version;
    for (const auto& type : types) {
        made.types.push_back(type.about);
        made.types.back().parameters = type.parameters.all();
    }
    return to_json(made);
}

std::shared_ptr<live_parameters> component_type::live() const {
    for (const auto& one : parameters.all())
        if (one.changeable && !changed)
            throw error(
                errc::invalid_argument,
                fmt::format("type '{}': parameter '{}' is changeable, but nothing of it takes a change over: C::change",
                            about.name, one.name));
    return std::make_shared<live_parameters>(parameters, changed,
                                             std::make_shared<std::function<std::unique_ptr<component>()>>(make));
}

result<std::pair<std::string, std::int32_t>> parse_role(std::string_view text) {
    auto equals = text.rfind('=');
    std::int32_t priority = 0;
    auto number = text.substr(equals == text.npos ? text.size() : equals + 1);
    auto [end, problem] = std::from_chars(number.data(), number.data() + number.size(), priority);
    if (equals == 0 || problem != std::errc() || end != number.data() + number.size())
        return failure(
            errc::invalid_argument,
            fmt::format("'{}' is not a role with its priority: write it like atirma/gateway=5", text.substr(0, 200)));
    return std::pair(std::string(text.substr(0, equals)), priority);
}

int main(int count, const char* const* words, std::vector<component_type> types, const std::string& version) {
    return guarded(count, words, std::move(types), nullptr, version);
}

int main(int count, const char* const* words, const type_maker& types, const std::string& version) {
    return guarded(count, words, types(), types, version);
}

} // namespace ise
