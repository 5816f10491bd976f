// environment-boundary: what a program's own main would do: its streams, its real environment
#include <ise/component/component_type.hpp>

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <charconv>
#include <cstdio>

namespace ise {
namespace {

constexpr int failed = 1;
constexpr int wrong_arguments = 2;

struct wrong : std::runtime_error {
    using std::runtime_error::runtime_error;
};

struct hosting {
    std::string path;
    component_options component;
    node_options node;
};

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
bool take_common(hosting& to, const std::string& name, const std::string& value) {
    if (name == "path") to.path = value;
    else if (name == "listen") to.component.listen.push_back(endpoint_of(value));
    else if (name == "advertise") to.component.advertise.push_back(endpoint_of(value));
    else if (name == "role") {
        auto role = parse_role(value);
        if (!role) throw wrong(role.error().message());
        to.component.roles.insert(std::move(*role));
    } else if (name == "name-server") to.node.name_server = endpoint_of(value);
    else if (name == "key") to.node.security.key_file = value;
    else if (name == "tls") to.node.security.tls_folder = value;
    else if (name == "demand-credentials") to.node.security.demanded = yes_or_no(name, value);
    else if (name == "log-level") to.node.log = log_to_stderr(level_of(value));
    else return false;
    return true;
}

std::string usage(const std::string& program, const std::vector<component_type>& types) {
    auto text = fmt::format("usage: {0} run TYPE [--path=PATH] [--listen=ENDPOINT]... [--advertise=ENDPOINT]...\n"
                            "           [--role=ROLE=PRIORITY]... [--name-server=ENDPOINT] [--log-level=LEVEL]\n"
                            "           [--key=FILE] [--tls=FOLDER] [--demand-credentials=yes|no] [--PARAMETER=VALUE]...\n"
                            "       {0} --describe | --version | --help\n", program);
    for (const auto& type : types) {
        text += fmt::format("\n{}: {}{}\n", type.about.name, type.about.description, type.about.path.empty() ? "" : fmt::format(" (path: {})", type.about.path));
        for (const auto& one : type.parameters.all())
            text += fmt::format("  --{:<20} {}; {}{}\n", one.name, one.description, allowed_values(one), one.preset.empty() ? "" : fmt::format(", unless given {}", one.preset));
    }
    text += "\nA parameter that is not given is taken from the environment: ISE_PARAMETER_WIND_SPEED for --wind-speed.\n";
    text += "Credentials: --key or ISE_KEY names the file of a key that both sides prove, --tls or ISE_TLS a folder with ca.pem, certificate.pem\n"
            "and key.pem for tls://; with --demand-credentials=yes nothing is listened on beyond this host without one of both.\n";
    return text + "Exit codes: 0 ended as asked, 1 failed, 2 wrong arguments.\n";
}

component_type& find_type(std::vector<component_type>& types, const std::string& name) {
    std::string known;
    for (auto& type : types) {
        if (type.about.name == name) return type;
        known += (known.empty() ? "" : ", ") + type.about.name;
    }
    throw wrong(fmt::format("there is no type '{}'; there are {}", name, known));
}

int run(component_type& type, hosting where, const std::string& program) {
    real_environment world;
    where.node.name = program;
    auto taken = type.parameters.set_from([&](const std::string& name) { return world.variable(name); });
    if (!taken) throw wrong(taken.error().message());
    where.component.parameters = type.live();
    where.component.policy = on_failure::stop_node;
    node running(world, std::move(where.node));
    running.launch(where.path, type.make(), std::move(where.component));
    int code = run_until_signal(running, [&] {
        fmt::print("started: {}\n", where.path);
        std::fflush(stdout);
    });
    for (const auto& report : running.reports()) {
        if (!report.failure.empty()) fmt::print(stderr, "{}: {}: {}\n", program, report.path, report.failure);
        for (const auto& name : report.still_running) fmt::print(stderr, "{}: {} did not end in time: {}\n", program, report.path, name);
    }
    return code;
}

int obey(int count, const char* const* words, std::vector<component_type>& types, const std::string& program, const std::string& version) {
    std::string first = count > 1 ? words[1] : "";
    if (first == "--describe") return fmt::print("{}\n", describe_types(program, version, types)), 0;
    if (first == "--version") return fmt::print("{} {}\n", program, version), 0;
    if (first == "--help" || first == "-h") return fmt::print("{}", usage(program, types)), 0;
    if (first != "run" || count < 3) throw wrong("say `run TYPE`, or --help");
    auto& type = find_type(types, words[2]);
    hosting where;
    where.path = type.about.path;
    for (int at = 3; at < count; ++at) {
        std::string word = words[at], value;
        auto equals = word.find('=');
        if (!word.starts_with("--")) throw wrong(fmt::format("'{}' is no option: options are written --name=value", word));
        if (equals != std::string::npos) value = word.substr(equals + 1);
        else if (++at < count) value = words[at];
        else throw wrong(fmt::format("'{}' needs a value", word));
        auto name = word.substr(2, equals == std::string::npos ? equals : equals - 2);
        if (take_common(where, name, value)) continue;
        auto set = type.parameters.set(name, value);
        if (!set) throw wrong(set.error().message());
    }
    return run(type, std::move(where), program);
}

} // namespace

std::string describe_types(const std::string& program, const std::string& version, const std::vector<component_type>& types) {
    program_text made;
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
            throw error(errc::invalid_argument, fmt::format("type '{}': parameter '{}' is changeable, but nothing of it takes a change over: C::change", about.name, one.name));
    return std::make_shared<live_parameters>(parameters, changed, std::make_shared<std::function<std::unique_ptr<component>()>>(make));
}

result<std::pair<std::string, std::int32_t>> parse_role(std::string_view text) {
    auto equals = text.rfind('=');
    std::int32_t priority = 0;
    auto number = text.substr(equals == text.npos ? text.size() : equals + 1);
    auto [end, problem] = std::from_chars(number.data(), number.data() + number.size(), priority);
    if (equals == 0 || problem != std::errc() || end != number.data() + number.size())
        return failure(errc::invalid_argument, fmt::format("'{}' is no role with its priority: write it like atirma/gateway=5", text.substr(0, 200)));
    return std::pair(std::string(text.substr(0, equals)), priority);
}

int main(int count, const char* const* words, std::vector<component_type> types, const std::string& version) {
    std::string program = count > 0 ? words[0] : "";
    program = program.substr(program.rfind('/') + 1);
    try {
        return obey(count, words, types, program, version);
    } catch (const wrong& why) {
        fmt::print(stderr, "{}: {}\n", program, why.what());
        return wrong_arguments;
    } catch (const std::exception& why) {
        fmt::print(stderr, "{}: {}\n", program, why.what());
        return failed;
    }
}

} // namespace ise
