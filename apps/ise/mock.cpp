// ise mock: stands in for a component: answers its calls, and publishes its packets, as JSON or a file says.
#include "json.hpp"
#include "options.hpp"
#include "stand_in.hpp"
#include "text.hpp"

#include <ise/component/provide_dynamic.hpp>
#include <ise/service/action.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::cli {
namespace {

struct mock_options {
    stand_in_options place;
    std::vector<std::string> services; ///< SERVICE JSON, in turn
};

// A request that is answered so.
struct rule {
    nlohmann::json request; ///< what it must have; null: anything
    std::optional<dynamic_packet> response;
    std::optional<failure> refusal;
    duration delay{};
};

struct mocked {
    dynamic_contract service;
    std::vector<rule> rules;
};

struct call_line {
    std::string service, caller;
    json_text request;
    std::string outcome; ///< "answered", "refused", "no rule"
};

problem wrong_rule(const std::string& service, std::size_t number, const std::string& what) {
    return problem(
        exit_code::usage, "usage", fmt::format("rule {} of '{}': {}", number, service, what),
        R"(a rule is {"request":{...},"response":{...}}, or {"request":{...},"refuse":"why"}; "delay":"200ms" is optional)");
}

// Whether `whole` has everything that `part` has.
bool has_all(const nlohmann::json& whole, const nlohmann::json& part) {
    if (!part.is_object()) return whole == part;
    if (!whole.is_object()) return false;
    return std::ranges::all_of(part.items(), [&](const auto& item) {
        auto found = whole.find(item.key());
        return found != whole.end() && has_all(*found, item.value());
    });
}

// JSON itself, or a file with it.
std::string text_of(context& in, const std::string& given) {
    constexpr std::size_t longest = std::size_t{16} << 20;
    if (given.starts_with('{') || given.starts_with('[')) return given;
    auto text = in.self.env().read_file(given, longest);
    if (!text) throw problem(exit_code::usage, "usage", text.error().message(), "give JSON, or a file that has it");
    return std::move(*text);
}

task<dynamic_packet> packet_of(context& in, schema of, const nlohmann::json& json) {
    return packet_from(in, std::move(of), json.dump(), "packet");
}

task<std::vector<rule>> rules_of(context& in, dynamic_contract service, std::string text) {
    nlohmann::json document;
    try {
        document = nlohmann::json::parse(text);
    } catch (const nlohmann::json::parse_error& wrong) {
        throw problem(exit_code::mismatch, "malformed",
                      fmt::format("what '{}' is to say is no JSON: {}", service.name(), detail::reason_of(wrong)));
    }
    const bool calls = service.kind() == service_kind::request_response;
    const auto& answer = service.packet(calls ? role::response : role::published);
    std::vector<rule> rules;
    if (!document.is_array()) {
        rule one;
        one.response = co_await packet_of(in, answer, document);
        rules.push_back(std::move(one));
        co_return rules;
    }
    std::size_t number = 0;
    for (const auto& item : document) {
        ++number;
        rule one;
        if (!item.is_object()) throw wrong_rule(service.name(), number, "is no object");
        for (const auto& [name, value] : item.items()) {
            if (name == "request") {
                if (!value.is_object()) throw wrong_rule(service.name(), number, "'request' is no object");
                // Names and types of its fields are checked as those of a whole request.
                [[maybe_unused]] auto whole = co_await packet_of(in, service.packet(role::request), value);
                one.request = value;
            } else if (name == "response") {
                one.response = co_await packet_of(in, answer, value);
            } else if (name == "refuse") {
                if (!value.is_string()) throw wrong_rule(service.name(), number, "'refuse' is no text");
                one.refusal = failure(errc::refused, value.get<std::string>());
            } else if (name == "delay") {
                auto length = value.is_string() ? parse_duration(value.get<std::string>())
                                                : result<duration>(failure(errc::malformed, "it is no text"));
                if (!length || *length < duration{})
                    throw wrong_rule(service.name(), number, "'delay' is no time, such as \"200ms\"");
                one.delay = *length;
            } else {
                throw wrong_rule(service.name(), number, fmt::format("'{}' is not known", name));
            }
        }
        if (one.response.has_value() == one.refusal.has_value())
            throw wrong_rule(service.name(), number, "has neither a response nor a refusal, or both");
        rules.push_back(std::move(one));
    }
    if (rules.empty()) throw wrong_rule(service.name(), 1, "there is none");
    co_return rules;
}

const rule* rule_for(const mocked& of, const dynamic_packet& request) {
    const auto asked = nlohmann::json::parse(request.to_json());
    auto found = std::ranges::find_if(
        of.rules, [&](const rule& one) { return one.request.is_null() || has_all(asked, one.request); });
    return found == of.rules.end() ? nullptr : &*found;
}

task<> tell(context& in, std::string service, std::string caller, const dynamic_packet& request, std::string outcome) {
    call_line line{std::move(service), std::move(caller), {request.to_json()}, std::move(outcome)};
    auto text = in.set.json ? json_line(line)
                            : fmt::format("{} by {}: {} {}\n", printable(line.service),
                                          line.caller.empty() ? "somebody" : printable(line.caller), line.outcome,
                                          printable(line.request.text));
    return in.out.write(in.self, std::move(text));
}

task<dynamic_packet> answer(context& in, std::shared_ptr<const mocked> of, dynamic_packet request, std::string caller) {
    const auto* found = rule_for(*of, request);
    const char* outcome = !found ? "no rule for" : found->refusal ? "refused" : "answered";
    auto telling = tell(in, of->service.name(), std::move(caller), request, outcome);
    co_await std::move(telling);
    if (!found)
        throw error(errc::refused, fmt::format("ise mock has no rule for this request of '{}'", of->service.name()));
    if (found->delay > duration{}) co_await in.self.sleep(found->delay);
    if (found->refusal) throw error(*found->refusal);
    co_return *found->response;
}

task<> publish_all(context& in, std::shared_ptr<const mocked> of, dynamic_publication out) {
    for (const auto& one : of->rules) {
        if (one.delay > duration{}) co_await in.self.sleep(one.delay);
        if (one.response) out(*one.response);
    }
}

task<> mock(context& in, mock_options options) {
    auto checking = check_place(in, options.place);
    co_await std::move(checking);
    std::vector<std::shared_ptr<const mocked>> all;
    for (std::size_t at = 0; at + 1 < options.services.size(); at += 2) {
        auto service = co_await contract_for(in, options.place, options.services[at]);
        if (is_action(*service.types()))
            throw problem(
                exit_code::usage, "usage",
                fmt::format("'{}' is an action: ise mock answers calls and publishes packets", options.services[at]));
        auto rules = co_await rules_of(in, service, text_of(in, options.services[at + 1]));
        all.push_back(std::make_shared<const mocked>(mocked{service, std::move(rules)}));
    }
    for (const auto& one : all) {
        if (one->service.kind() == service_kind::request_response) {
            provide_dynamic(in.self, one->service,
                            [&in, one](dynamic_packet request, const call_context& of) -> task<dynamic_packet> {
                                return answer(in, one, std::move(request), std::string(of.caller));
                            });
        } else {
            auto out = publish_dynamic(in.self, one->service);
            in.self.spawn("packets", publish_all(in, one, out));
        }
    }
    co_await take_place(in);
    for (;;) co_await in.self.sleep(std::chrono::hours(1)); // until Ctrl-C
}

void declare_mock(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<mock_options>();
    add_stand_in(app, given->place);
    auto first = std::make_shared<std::pair<std::string, std::string>>();
    app.add_option("SERVICE", first->first, "a service")->required();
    app.add_option("JSON", first->second, "its response or packet, or a list of rules; or a FILE that has it")
        ->required();
    app.add_option("MORE", given->services,
                   "further pairs of these; a list of rules is in a FILE here"); // CLI11 takes it apart
    app.callback([&made, given, first] {
        given->services.insert(given->services.begin(), {first->first, first->second});
        if (given->services.size() % 2 != 0)
            throw problem(exit_code::usage, "usage",
                          fmt::format("there is nothing that '{}' is to say", given->services.back()),
                          "each service is followed by JSON or a file");
        takes_place(given->place, made);
        made.endless = true;
        made.work = [given](context& in) { return mock(in, *given); };
    });
}

} // namespace

extern const command mock_command{
    "mock", talk_group, "stands in for a component: answers its calls, publishes its packets",
    "  ise mock atirma/boat helm '{\"accepted\":true}'\n"
    "  ise mock atirma/boat helm '[{\"request\":{\"mode\":\"fly\"},\"refuse\":\"boats "
    "sail\"},{\"response\":{\"accepted\":true}}]'\n"
    "  ise mock atirma/boat helm helm.json position '{\"latitude_deg\":28.1}' --types boat.types\n",
    declare_mock};

} // namespace ise::cli
