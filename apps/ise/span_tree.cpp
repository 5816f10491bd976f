#include "span_tree.hpp"

#include "text.hpp"

#include <ise/core/time_text.hpp>
#include <ise/packet/detail/text_forms.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>
#include <utility>

namespace ise::cli {
namespace {

using json = nlohmann::json;

std::int64_t number_of(const json& from) {
    if (from.is_number_integer()) return from.get<std::int64_t>();
    const auto& text = from.get_ref<const std::string&>();
    std::int64_t made = 0;
    auto [end, wrong] = std::from_chars(text.data(), text.data() + text.size(), made);
    if (wrong != std::errc() || end != text.data() + text.size())
        throw json::other_error::create(500, "no time", &from);
    return made;
}

std::string attribute_of(const json& of, std::string_view name) {
    for (const auto& one : of.value("attributes", json::array()))
        if (one.value("key", "") == name) return one.at("value").value("stringValue", "");
    return {};
}

// Of OTLP's numbers.
std::string kind_of(int number) {
    switch (number) {
        case 3: return "client";
        case 4: return "producer";
        case 5: return "consumer";
        case 2: return "server";
        default: return "internal";
    }
}

std::string_view peer_attribute_of(std::string_view kind) {
    if (kind == "server") return "client.address";
    return kind == "internal" ? "work.target" : "server.address";
}

void read_line(std::string_view line, std::vector<traced_span>& into) {
    auto parsed = json::parse(line);
    for (const auto& resource : parsed.at("resourceSpans")) {
        auto component = attribute_of(resource.value("resource", json::object()), "service.name");
        for (const auto& scope : resource.at("scopeSpans"))
            for (const auto& one : scope.at("spans")) {
                traced_span made;
                made.trace = one.at("traceId");
                made.id = one.at("spanId");
                made.parent = one.value("parentSpanId", "");
                made.component = component;
                made.name = one.at("name");
                made.kind = kind_of(one.value("kind", 0));
                made.peer = attribute_of(one, peer_attribute_of(made.kind));
                if (auto links = one.value("links", json::array()); !links.empty())
                    made.linked = links.front().at("traceId");
                made.began_ns = number_of(one.at("startTimeUnixNano"));
                made.took_ns = number_of(one.at("endTimeUnixNano")) - made.began_ns;
                const bool failed = one.value("status", json::object()).value("code", 0) == 2;
                made.outcome = failed ? attribute_of(one, "error.type") : "ok";
                if (made.outcome.empty()) made.outcome = "failed";
                into.push_back(std::move(made));
            }
    }
}

std::string sentence_of(const traced_span& of) {
    if (of.kind == "client") return fmt::format("{} calls '{}' of {}", of.component, of.name, of.peer);
    if (of.kind == "producer") return fmt::format("{} publishes '{}'", of.component, of.name);
    if (of.kind == "consumer") return fmt::format("{} takes '{}' of {}", of.component, of.name, of.peer);
    if (of.kind == "server") return fmt::format("{} answers '{}'", of.component, of.name);
    return fmt::format("{}: {}{}{}", of.component, of.name, of.peer.empty() ? "" : " to ", of.peer);
}

std::string line_of(const traced_span& of, std::int64_t origin_ns) {
    const auto text = sentence_of(of);
    auto line = fmt::format("{}   at {}", printable(text), show_duration(duration(of.began_ns - origin_ns)));
    if (of.kind != "producer") line += ", " + show_duration(duration(of.took_ns));
    if (of.outcome != "ok") line += ": " + printable(of.outcome);
    return line;
}

} // namespace

result<void> read_spans(std::string_view text, std::vector<traced_span>& into) {
    std::size_t number = 0;
    for (std::size_t from = 0; from < text.size();) {
        ++number;
        auto to = text.find('\n', from);
        if (to == text.npos) return {}; // it is being written
        auto line = text.substr(from, to - from);
        from = to + 1;
        if (line.empty()) continue;
        try {
            read_line(line, into);
        } catch (const json::exception& wrong) {
            return failure(errc::malformed,
                           fmt::format("line {} is not OTLP/JSON: {}", number, detail::reason_of(wrong)));
        }
    }
    return {};
}

std::vector<traced_span> spans_of_trace(const std::vector<traced_span>& all, std::string_view trace) {
    std::set<std::string> continuations;
    for (const auto& one : all)
        if (trace.empty() && !one.linked.empty() && one.linked != one.trace) continuations.insert(one.linked);
    std::string id;
    std::int64_t newest = 0;
    for (const auto& one : all) {
        if (trace.empty() ? (!id.empty() && one.began_ns <= newest) || continuations.contains(one.trace)
                          : !one.trace.starts_with(trace))
            continue;
        id = one.trace;
        newest = one.began_ns;
    }
    std::vector<traced_span> made;
    std::set<std::string> taken;
    std::vector<std::string> open{id};
    while (!id.empty() && !open.empty()) {
        auto next = std::move(open.back());
        open.pop_back();
        if (!taken.insert(next).second) continue;
        for (const auto& one : all) {
            if (one.trace != next) continue;
            made.push_back(one);
            if (!one.linked.empty()) open.push_back(one.linked);
        }
    }
    std::ranges::stable_sort(made, {}, [&](const auto& one) { return std::pair(one.trace != id, one.began_ns); });
    return made;
}

std::string draw_trace(const std::vector<traced_span>& spans) {
    if (spans.empty()) return {};
    std::map<std::string, std::vector<const traced_span*>> below;
    std::set<std::string> known;
    std::map<std::string, std::string> links; // from a trace to the span that it goes on with
    for (const auto& one : spans) {
        known.insert(one.id);
        if (!one.linked.empty() && one.linked != spans.front().trace) links.emplace(one.linked, one.id);
    }
    std::vector<const traced_span*> roots;
    std::int64_t end_ns = 0;
    for (const auto& one : spans) {
        end_ns = std::max(end_ns, one.began_ns + one.took_ns);
        const bool root = !known.contains(one.parent) || one.parent == one.id;
        const auto link = links.find(one.trace);
        const auto above = root && link != links.end() && link->second != one.id ? link->second : one.parent;
        (root && above == one.parent ? roots : below[above]).push_back(&one);
    }
    const auto origin = spans.front().began_ns;
    auto text =
        fmt::format("trace {}, {}, {}, {} spans\n", printable(spans.front().trace),
                    iso_8601(wall_time(duration(origin))), show_duration(duration(end_ns - origin)), spans.size());
    // A stack of its own: a file may say anything. Spans that cause each other hang below no root, and are left out.
    struct entry {
        const traced_span* of;
        std::string before, mark, rest;
    };
    std::vector<entry> open;
    auto push = [&](const std::vector<const traced_span*>& some, const std::string& before) {
        for (std::size_t at = some.size(); at-- > 0;) {
            const bool last = at + 1 == some.size();
            open.push_back({some[at], before, last ? "└─ " : "├─ ", last ? "   " : "│  "});
        }
    };
    for (std::size_t at = roots.size(); at-- > 0;) open.push_back({roots[at], "", "", ""});
    std::set<std::string> drawn;
    while (!open.empty()) {
        auto next = std::move(open.back());
        open.pop_back();
        const auto& one = *next.of;
        const bool lost = next.mark.empty() && !one.parent.empty();
        text += fmt::format("{}{}{}{}\n", next.before, next.mark, line_of(one, origin),
                            lost ? " (what caused it is not in these files)" : "");
        if (!drawn.insert(one.id).second) continue;
        if (auto found = below.find(one.id); found != below.end()) push(found->second, next.before + next.rest);
    }
    return text;
}

} // namespace ise::cli
