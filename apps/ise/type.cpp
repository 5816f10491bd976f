// ise type: the packets of a service, or how those of two differ.
#include "json.hpp"
#include "options.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/packet/compatibility.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace ise::cli {

namespace {

struct type_options {
    std::string act, name, service, other_name, other_service;
};

struct shown_packet {
    std::string role, name, fingerprint, schema;
};
struct shown_service {
    std::string component, service, kind;
    std::vector<shown_packet> packets;
};
struct packet_difference {
    std::string role;
    std::string verdict;     ///< "equal", "compatible" or "mismatch"
    std::string differences; ///< of a mismatch: a line a difference
};
struct type_comparison {
    bool compatible = false;
    std::vector<packet_difference> packets;
};

// A service of either kind, provided or else needed.
task<dynamic_contract> service_at(context& in, std::string name, std::string service) {
    auto who = co_await reach(in, name);
    auto about = co_await ask_about(in, who);
    const service_info* found = nullptr;
    std::vector<std::string> names;
    for (const auto& one : about.services) {
        names.push_back(one.name);
        if (one.name == service && (!found || one.provided)) found = &one;
    }
    if (!found) {
        auto near = nearest(service, names);
        std::erase_if(names, [](const auto& one) { return is_own_service(one); });
        throw problem(exit_code::not_reached, "no_such_service",
                      fmt::format("{} neither provides nor needs a service '{}'", name, service),
                      near.empty() ? fmt::format("it has {}", names.empty() ? "none" : enumerate(names))
                                   : fmt::format("did you mean '{}'?", near.front()));
    }
    auto contract = contract_of(*found);
    if (!contract) throw problem(contract.error());
    co_return std::move(*contract);
}

std::size_t packets_of(const dynamic_contract& service) { return service.types()->schemas.size(); }

std::string as_text(const dynamic_contract& service) {
    auto text = fmt::format("{}  ({})\n", printable(service.name()), kind_name(service));
    for (std::size_t place = 0; place < packets_of(service); ++place) {
        const auto& packet = service.packet(place);
        text += fmt::format("  {}  {}  {:016x}\n", role::name(service.kind(), place), printable(packet.name()),
                            packet.fingerprint());
        if (!packet.type().members.empty()) text += indented(printable(packet.pretty(), true), "    ");
    }
    return text;
}

shown_service shown_types(const std::string& component, const dynamic_contract& service) {
    shown_service result;
    result.component = component;
    result.service = service.name();
    result.kind = kind_name(service);
    for (std::size_t place = 0; place < packets_of(service); ++place) {
        const auto& packet = service.packet(place);
        result.packets.push_back({std::string(role::name(service.kind(), place)), packet.name(),
                                  fmt::format("{:016x}", packet.fingerprint()), packet.text()});
    }
    return result;
}

type_comparison compare(const dynamic_contract& a, const dynamic_contract& b) {
    type_comparison made;
    made.compatible = true;
    for (std::size_t place = 0; place < packets_of(a); ++place) {
        packet_difference one{std::string(role::name(a.kind(), place)), "equal", {}};
        if (a.packet(place).fingerprint() != b.packet(place).fingerprint()) {
            auto why = incompatibility(a.packet(place), b.packet(place));
            one.verdict = why ? "mismatch" : "compatible";
            one.differences = why.value_or("");
            made.compatible = made.compatible && !why;
        }
        made.packets.push_back(std::move(one));
    }
    return made;
}

std::string as_text(const type_comparison& of) {
    std::string text;
    for (const auto& one : of.packets) {
        text += fmt::format("{}: {}\n", one.role,
                            one.verdict == "mismatch" ? "does not fit"
                            : one.verdict == "equal"  ? "equal"
                                                      : "compatible: something was appended on one side");
        if (one.differences.empty()) continue;
        auto why = printable(one.differences, true);
        while (why.ends_with('\n')) why.pop_back();
        text += indented(why, "    ");
    }
    return text;
}

task<> type(context& in, type_options options) {
    auto first = co_await service_at(in, options.name, options.service);
    if (options.act == "show") {
        auto text = in.set.json ? json_line(shown_types(options.name, first)) : as_text(first);
        co_await in.out.write(in.self, std::move(text));
        co_return;
    }
    auto other_service = options.other_service.empty() ? options.service : options.other_service;
    auto other = co_await service_at(in, options.other_name, other_service);
    if (first.kind() != other.kind())
        throw problem(exit_code::mismatch, "type_mismatch",
                      fmt::format("'{}' at {} is a {} service, '{}' at {} a {} service", options.service, options.name,
                                  ise::name_of(first.kind()), other_service, options.other_name,
                                  ise::name_of(other.kind())));
    auto result = compare(first, other);
    auto text = in.set.json ? json_line(result) : as_text(result);
    co_await in.out.write(in.self, std::move(text));
    if (!result.compatible)
        throw problem(
            exit_code::mismatch, "type_mismatch",
            fmt::format("'{}' of {} (reader) does not fit '{}' of {} (writer)", options.service, options.name,
                        other_service, options.other_name),
            "fields, enumerators and alternatives may be appended; anything else requires a service of another name");
}

void declare_type(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<type_options>();
    app.add_option("ACTION", given->act, "show: the packets of a service; diff: compare those of two")
        ->required()
        ->check(one_of({"diff", "show"}));
    add_component(app, given->name);
    app.add_option("SERVICE", given->service, "name of a service that it provides or requires")->required();
    app.add_option("OTHER_NAME", given->other_name, "of diff: the component to compare with");
    app.add_option("OTHER_SERVICE", given->other_service, "of diff: its service (default: the same)");
    app.callback([&made, given] {
        bool two = given->act == "diff";
        if (two == given->other_name.empty())
            throw problem(
                exit_code::usage, "usage",
                two ? "with what is it to be compared?" : "'type show' requires one component and one service",
                two ? fmt::format("ise type diff {} {} OTHER_NAME [OTHER_SERVICE]", given->name, given->service)
                    : "to compare two: ise type diff");
        made.work = [given](context& in) { return type(in, *given); };
    });
}

} // namespace

extern const command type_command{
    "type", see_group, "shows the packets of a service, or compares those of two",
    "  ise type show atirma/boat helm\n  ise type diff atirma/boat helm atirma/new_boat\n", declare_type};

} // namespace ise::cli
