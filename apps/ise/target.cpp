#include "target.hpp"

#include "text.hpp"

#include <ise/naming/name_servers.hpp>
#include <ise/service/action.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <set>

namespace ise::cli {
namespace {

// A link goes on trying until the deadline; a person wants to know at once.
constexpr duration look_up = std::chrono::milliseconds(20);

task<result<void>> connect(context& in, remote who) {
    if (in.set.wait) {
        auto got = co_await who.connect(in.left());
        co_return got;
    }
    for (;;) {
        auto slice = std::min(look_up, in.left());
        auto got = co_await who.connect(slice);
        if (got || got.error().code() == errc::cancelled) co_return got;
        if (!who.way().obstacle().empty()) co_return failure(errc::unreachable, who.way().obstacle());
        if (in.self.now() >= in.until) co_return got;
    }
}

// Fit for a shell, between single quotes.
std::string shell_quoted(const std::string& text) {
    std::string out = "'";
    for (char letter : text) out += letter == '\'' ? std::string("'\\''") : std::string(1, letter);
    return out + "'";
}

std::string in_quotes(const std::string& name) { return fmt::format("'{}'", name); }

// "1 name is", "3 names are"
std::string names_are(std::size_t count) { return fmt::format("{} name{}", count, count == 1 ? " is" : "s are"); }

// For an error only: whatever goes wrong here, that one is told.
task<std::string> advice_for_name(context& in, std::string name) {
    std::vector<std::string> known;
    try {
        auto names = co_await listed_names(in, "");
        for (auto& one : names) known.push_back(std::move(one.path));
    } catch (const problem&) {
        co_return std::string();
    }
    if (known.empty()) co_return std::string("no component is registered");
    auto near = nearest(name, known);
    for (auto& one : near) one = in_quotes(one);
    if (!near.empty()) co_return fmt::format("did you mean {}?", fmt::join(near, " or "));
    co_return fmt::format("{} registered: ise list", names_are(known.size()));
}

// Somebody who accepts and says nothing that is ISE's.
std::string advice_for_endpoint(errc why) {
    if (why == errc::timed_out || why == errc::protocol_error)
        return "the listener there is not ISE: another protocol (a web page, a database), or a stopped component; ise "
               "list shows the endpoints of components";
    return "is the component running there? --wait waits for it until the timeout";
}

std::string services_there(const component_info& about) {
    std::vector<std::string> names;
    for (const auto& one : about.services)
        if (one.provided && !is_own_service(one.name)) names.push_back(in_quotes(one.name));
    return names.empty() ? "it provides no service" : "it provides " + enumerate(names);
}

} // namespace

void check_name(const std::string& name) {
    if (name.size() <= naming::max_path && naming::is_path(name)) return;
    std::string advice = "a path has letters, digits, '_', '-' and '.', with a '/' between its parts: atirma/boat";
    if (name.find(':') != name.npos) advice += "; an endpoint is written tcp://127.0.0.1:7411";
    if (name.size() > naming::max_path)
        advice = fmt::format("it has {} bytes, at most {} are allowed", name.size(), naming::max_path);
    throw problem(exit_code::usage, "usage", fmt::format("'{}' is not a name of a component", printable(cut(name, 80))),
                  std::move(advice));
}

void check_prefix(const std::string& prefix) {
    auto path = prefix;
    while (path.ends_with('/')) path.pop_back();
    if (!path.empty()) check_name(path);
    else if (!prefix.empty())
        throw problem(exit_code::usage, "usage", fmt::format("'{}' is not a prefix", prefix),
                      "paths do not begin with '/': ise list atirma");
}

void note_nothing(const context& in, const std::string& prefix, const std::vector<std::string>& known) {
    if (prefix.empty()) return note(in.set, "no component is registered");
    std::set<std::string> prefixes; // whatever would have found something
    for (const auto& path : known)
        for (auto at = path.find('/');; at = path.find('/', at + 1)) {
            prefixes.insert(path.substr(0, at));
            if (at == path.npos) break;
        }
    auto near = nearest(prefix, std::vector<std::string>(prefixes.begin(), prefixes.end()));
    for (auto& one : near) one = fmt::format("'{}'", one);
    note(in.set, fmt::format("no component is registered under '{}'{}", prefix,
                             near.empty() ? "" : fmt::format("; did you mean {}?", fmt::join(near, " or "))));
}

task<remote> reach_name_server(context& in) {
    auto at = name_servers_of(in.set, in.self.env());
    auto server = in.self.at(at, std::string(naming::server_path));
    auto got = co_await connect(in, server);
    if (!got && has_unusable_policy(got.error().message()))
        throw problem(exit_code::not_reached, "policy_unusable",
                      fmt::format("the name server makes no session: {}", got.error().message()), policy_advice);
    if (!got && got.error().message().find("refused the session") != std::string::npos)
        throw problem(exit_code::not_reached, "name_server_lost",
                      fmt::format("the name server at {} is not reached: {}", text_of(at), got.error().message()),
                      "use the credentials of its system (--key, --tls), or none where it has none");
    if (!got)
        throw problem(exit_code::not_reached, "name_server_lost",
                      fmt::format("there is no name server at {}: {}", text_of(at), got.error().message()),
                      "start one with ise_name_server, tell where it is with --name-server or ISE_NAME_SERVER, or name "
                      "the component by its endpoint");
    co_return server;
}

task<std::vector<naming::listed_name>> listed_names(context& in, std::string prefix) {
    auto server = co_await reach_name_server(in);
    std::vector<naming::listed_name> names;
    naming::list_request question;
    question.prefix = std::move(prefix);
    for (;;) {
        auto page = question;
        auto response = co_await server.try_call(naming::list, std::move(page), in.left());
        if (!response) throw problem(response.error());
        if (!response->trouble.empty() && question.after.empty()) note(in.set, response->trouble);
        for (auto& one : response->names) names.push_back(std::move(one));
        // A server that says "more" and tells nothing new would be asked for ever.
        if (!response->more || response->names.empty() || names.back().path <= question.after) break;
        question.after = names.back().path;
    }
    co_return names;
}

task<remote> reach(context& in, std::string name) {
    if (name.find("://") != std::string::npos) {
        auto at = endpoint::parse(name);
        if (!at) throw problem(exit_code::usage, "usage", at.error().message());
        auto who = in.self.at(*at);
        auto got = co_await connect(in, who);
        if (!got)
            throw problem(
                failure(got.error().code(), fmt::format("{} is not reached: {}", name, got.error().message())),
                has_unusable_policy(got.error().message()) ? policy_advice : advice_for_endpoint(got.error().code()));
        co_return who;
    }
    check_name(name);
    [[maybe_unused]] auto server = co_await reach_name_server(in);
    auto* names = in.self.services().resolver();
    if (!names)
        throw problem(exit_code::failed, "unexpected",
                      "this program was built without names: name the component by its endpoint");
    result<resolution> found;
    if (in.set.wait) {
        found = co_await names->resolve_when_present(name, in.until);
    } else {
        found = co_await names->resolve(name);
    }
    if (!found) {
        std::string advice;
        if (found.error().code() == errc::no_such_name) {
            in.until = std::max(in.until, in.self.now() + std::chrono::seconds(1));
            advice = co_await advice_for_name(in, name);
        } else if (found.error().code() == errc::name_server_lost) {
            advice = "it knows all components again within a lease, a few seconds: try again, or use --wait to wait "
                     "until the timeout";
        }
        throw problem(found.error(), advice);
    }
    auto who = in.self.at(name);
    auto got = co_await connect(in, who);
    if (!got)
        throw problem(failure(got.error().code(),
                              fmt::format("'{}' is registered, but not reached: {}", name, got.error().message())),
                      has_unusable_policy(got.error().message())
                          ? policy_advice
                          : "it may just have ended: its name goes when its lease ends, a few seconds later");
    co_return who;
}

task<resolution> members_of(context& in, std::string name) {
    resolution who;
    auto* names = in.self.services().resolver();
    if (!names || name.find("://") != std::string::npos) co_return who;
    auto found = co_await names->resolve(name);
    if (found) who = std::move(*found);
    co_return who;
}

task<component_info> ask_about(context& in, remote who) {
    describe_request question;
    auto response = co_await who.try_call(describe_service, question, in.left());
    if (!response) throw problem(response.error());
    co_return std::move(*response);
}

task<dynamic_contract> find_service(context& in, remote who, std::string service, service_kind wanted) {
    auto about = co_await ask_about(in, who);
    std::vector<std::string> names;
    for (const auto& one : about.services) {
        if (!one.provided) continue;
        names.push_back(one.name);
        if (one.name != service) continue;
        auto contract = contract_of(one);
        if (!contract) throw problem(contract.error());
        if (contract->kind() != wanted) {
            const bool runs = is_action(*contract->types()), calls = wanted == service_kind::request_response;
            throw problem(
                exit_code::usage, "usage",
                runs ? fmt::format("'{}' at {} is an action", service, who.name())
                     : fmt::format("'{}' at {} is a {} service", service, who.name(), ise::name_of(contract->kind())),
                (runs    ? "run it:\n"
                 : calls ? "subscribe to it:\n"
                         : "call it:\n") +
                    example(who.name(), *contract));
        }
        co_return std::move(*contract);
    }
    auto near = nearest(service, names);
    throw problem(exit_code::not_reached, "no_such_service",
                  fmt::format("there is no service '{}' at {}", service, who.name()),
                  services_there(about) + (near.empty() ? "" : fmt::format("; did you mean '{}'?", near.front())));
}

task<dynamic_packet> packet_from(context& in, schema of, std::string json, std::string what) {
    auto parse = [of, json = std::move(json), what = std::move(what)] {
        try {
            return dynamic_packet::from_json(of, json);
        } catch (const error& unfit) {
            throw problem(failure(unfit.code(), fmt::format("the {} is invalid: {}", what, unfit.what())),
                          "it is " + of.pretty());
        }
    };
    auto packet = co_await in.self.offload(std::move(parse));
    co_return packet;
}

task<dynamic_packet> request_from(context& in, const dynamic_contract& service, std::string name, std::string json) {
    const auto& asked = service.packet(role::request);
    if (json.empty() && !asked.type().members.empty()) {
        auto advice = fmt::format("it is {}\ngive what matters, or {{}} for the defaults:\n{}", asked.pretty(),
                                  example(name, service));
        throw problem(exit_code::usage, "usage",
                      fmt::format("the request of '{}' has fields, and none was given", service.name()),
                      std::move(advice));
    }
    if (json.empty()) json = "{}";
    auto request = co_await packet_from(in, asked, std::move(json), "request");
    co_return request;
}

service_kind kind_of(const service_info& one) {
    return one.kind == 0 ? service_kind::request_response : service_kind::subscription;
}

std::string_view kind_name(const dynamic_contract& service) {
    return is_action(*service.types()) ? "action" : ise::name_of(service.kind());
}

std::string_view kind_name(const service_info& one) {
    auto contract = contract_of(one);
    return contract ? kind_name(*contract) : ise::name_of(kind_of(one));
}

std::string example(const std::string& name, const dynamic_contract& service) {
    const bool calls = service.kind() == service_kind::request_response;
    const bool runs = is_action(*service.types());
    const auto asked = runs ? schemas_of_action(*service.types()).goal : service.packet(role::request);
    std::string json;
    constexpr std::size_t longest = 160;
    bool small = asked.type().min_size <= longest;
    if (small && asked.type().kind == type_kind::structure && !asked.type().members.empty())
        json = " " + shell_quoted(printable(default_packet(asked).to_json()));
    if (!small || json.size() > longest) json = calls || runs ? " -" : "";
    return fmt::format("    ise {} {} {}{}\n",
                       calls  ? "call"
                       : runs ? "run"
                              : "echo",
                       name, printable(service.name()), json);
}

} // namespace ise::cli
