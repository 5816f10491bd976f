#include "look.hpp"

#include "target.hpp"
#include "text.hpp"

#include <ise/packet/compatibility.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

// A service of either kind, provided or else needed.
task<dynamic_contract> service_at(context& in, std::string name, std::string service) {
    auto who = co_await reach(in, name);
    auto about = co_await ask_about(in, who);
    const service_text* found = nullptr;
    std::vector<std::string> names;
    for (const auto& one : about.services) {
        names.push_back(one.name);
        if (one.name == service && (!found || one.provided)) found = &one;
    }
    if (!found) {
        auto near = nearest(service, names);
        std::erase_if(names, [](const auto& one) { return is_internal(one); });
        throw problem(exit_code::not_reached, "no_such_service", fmt::format("{} neither provides nor needs a service '{}'", name, service),
                      near.empty() ? fmt::format("it has {}", names.empty() ? "none" : enumerate(names)) : fmt::format("did you mean '{}'?", near.front()));
    }
    auto contract = contract_of(*found);
    if (!contract) throw problem(contract.error());
    co_return std::move(*contract);
}

std::size_t packets_of(const dynamic_contract& service) { return service.types()->schemas.size(); }

std::string shown(context& in, const type_options& options, const dynamic_contract& service) {
    if (in.set.json) {
        ordered_json told;
        told["component"] = options.name;
        told["service"] = service.name();
        told["kind"] = ise::name_of(service.kind());
        auto packets = ordered_json::array();
        for (std::size_t place = 0; place < packets_of(service); ++place) {
            const auto& packet = service.packet(place);
            ordered_json one;
            one["role"] = role::name(service.kind(), place);
            one["name"] = packet.name();
            one["fingerprint"] = fmt::format("{:016x}", packet.fingerprint());
            one["schema"] = packet.text();
            packets.push_back(std::move(one));
        }
        told["packets"] = std::move(packets);
        return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    }
    auto text = fmt::format("{}  ({})\n", printable(service.name()), ise::name_of(service.kind()));
    for (std::size_t place = 0; place < packets_of(service); ++place) {
        const auto& packet = service.packet(place);
        text += fmt::format("  {}  {}  {:016x}\n", role::name(service.kind(), place), printable(packet.name()), packet.fingerprint());
        if (!packet.type().members.empty()) text += indented(printable(packet.pretty(), true), "    ");
    }
    return text;
}

struct difference {
    std::string_view packet; ///< its role
    std::string verdict;     ///< "equal", "compatible" or "mismatch"
    std::string why;         ///< of a mismatch: a line a difference
};

std::vector<difference> differences(const dynamic_contract& a, const dynamic_contract& b) {
    std::vector<difference> all;
    for (std::size_t place = 0; place < packets_of(a); ++place) {
        difference one{role::name(a.kind(), place), "equal", {}};
        if (a.packet(place).fingerprint() != b.packet(place).fingerprint()) {
            auto why = incompatibility(a.packet(place), b.packet(place));
            one.verdict = why ? "mismatch" : "compatible";
            one.why = why.value_or("");
        }
        all.push_back(std::move(one));
    }
    return all;
}

std::string as_text(const std::vector<difference>& all) {
    std::string text;
    for (const auto& one : all) {
        text += fmt::format("{}: {}\n", one.packet, one.verdict == "mismatch" ? "does not fit" : one.verdict == "equal" ? "equal" : "compatible: something was appended on one side");
        if (one.why.empty()) continue;
        auto why = printable(one.why, true);
        while (why.ends_with('\n')) why.pop_back();
        text += indented(why, "    ");
    }
    return text;
}

std::string as_json(const std::vector<difference>& all, bool fits) {
    ordered_json told;
    told["compatible"] = fits;
    auto packets = ordered_json::array();
    for (const auto& one : all) {
        ordered_json packet;
        packet["role"] = one.packet;
        packet["verdict"] = one.verdict;
        packet["differences"] = one.why;
        packets.push_back(std::move(packet));
    }
    told["packets"] = std::move(packets);
    return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

} // namespace

task<> type(context& in, type_options options) {
    auto first = co_await service_at(in, options.name, options.service);
    if (options.act == "show") {
        auto text = shown(in, options, first);
        co_await in.out.write(in.self, std::move(text));
        co_return;
    }
    auto other_service = options.other_service.empty() ? options.service : options.other_service;
    auto other = co_await service_at(in, options.other_name, other_service);
    if (first.kind() != other.kind())
        throw problem(exit_code::mismatch, "type_mismatch", fmt::format("'{}' at {} is a {} service, '{}' at {} a {} service", options.service, options.name, ise::name_of(first.kind()),
                                                                        other_service, options.other_name, ise::name_of(other.kind())));
    auto all = differences(first, other);
    bool fits = std::ranges::none_of(all, [](const difference& one) { return one.verdict == "mismatch"; });
    auto text = in.set.json ? as_json(all, fits) : as_text(all);
    co_await in.out.write(in.self, std::move(text));
    if (!fits)
        throw problem(exit_code::mismatch, "type_mismatch", fmt::format("'{}' of {} (reader) does not fit '{}' of {} (writer)", options.service, options.name, other_service, options.other_name),
                      "fields, enumerators and alternatives may be appended; anything else takes a service of another name");
}

} // namespace ise::cli
