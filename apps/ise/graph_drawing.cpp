#include "graph_drawing.hpp"

#include "activity.hpp"
#include "text.hpp"

#include <ise/session/contract.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <set>

namespace ise::cli {
namespace {

using by_name = std::pair<std::string, std::string>;

bool is_subscription(const drawn_graph& in, const std::string& provider, const std::string& service) {
    auto kind = in.kinds.find({provider, service});
    return kind != in.kinds.end() && kind->second == static_cast<std::uint8_t>(service_kind::subscription);
}

std::string rate_of(const drawn_graph& in, const std::string& provider, const std::string& service) {
    auto rate = in.services.find({provider, service});
    return rate == in.services.end() ? std::string()
                                     : fmt::format("{:.{}f}/s", rate->second, rate->second < 100 ? 1 : 0);
}

style of_component(const surveyed& one) {
    if (!one.about || one.name.state == "stalled" || one.about->state == "failed") return style::bad;
    return one.about->state == "ready" ? style::good : style::warning;
}

std::string state_text(const surveyed& one) {
    if (one.name.state == "stalled") return one.name.state;
    return one.about ? one.about->state : "does not answer";
}

std::string bytes_text(double rate) { return show_bytes(static_cast<std::uint64_t>(rate)) + "/s"; }

// A connection as `me` has it: the peer, then what goes over it.
void add_connection(styled_page& to, const drawn_graph& in, std::size_t which, bool me_is_a, bool last) {
    const auto& line = in.lines[which];
    const auto& other = me_is_a ? line.b : line.a;
    styled_line row;
    row.add(last ? "  └─ " : "  ├─ ", style::dim);
    row.add(printable(other.empty() ? fmt::format("(anonymous, {})", line.address) : other));
    row.add("  " + printable(line.over), style::dim);
    if (line.stalled) row.add("  stalled", style::bad);
    if (line.sessions > 1) row.add(fmt::format("  {} sessions", line.sessions));
    if (line.round_trip > duration{}) row.add("  " + show_duration(line.round_trip));
    if (const auto& rate = in.rates[which])
        row.add(fmt::format("  {} in, {} out", bytes_text(me_is_a ? rate->to_a : rate->to_b),
                            bytes_text(me_is_a ? rate->to_b : rate->to_a)),
                style::dim);
    else
        row.add(fmt::format("  {} in, {} out so far", show_bytes(me_is_a ? line.bytes_to_a : line.bytes_to_b),
                            show_bytes(me_is_a ? line.bytes_to_b : line.bytes_to_a)),
                style::dim);
    to.push_back(std::move(row));
    for (bool given : {false, true})
        for (const auto& one : line.services) {
            if ((one.a_provides == me_is_a) != given) continue;
            const auto& provider = one.a_provides ? line.a : line.b;
            bool subscription = is_subscription(in, provider, one.service);
            styled_line service;
            service.add(last ? "       " : "  │    ", style::dim);
            service.add(given ? "provides " : "uses     ");
            service.add(printable(one.service), subscription ? style::good : style::accent);
            service.add(subscription ? "  subscription" : "  calls", style::dim);
            if (auto rate = rate_of(in, provider, one.service); !rate.empty()) service.add("  " + rate);
            to.push_back(std::move(service));
        }
}

std::string quoted_for_dot(const std::string& text) {
    std::string out = "\"";
    for (char letter : printable(text)) {
        if (letter == '"' || letter == '\\') out += '\\';
        out += letter;
    }
    return out + "\"";
}

// Lines of a label, each with what a label obeys taken away.
std::string label_of(const std::vector<std::string>& lines) {
    std::string text;
    for (const auto& one : lines) {
        auto quoted = quoted_for_dot(one);
        text += (text.empty() ? "" : "\\n") + quoted.substr(1, quoted.size() - 2);
    }
    return "\"" + text + "\"";
}

// Colours that can be told on white and on black.
constexpr const char *calls_colour = "#4493f8", *subscriptions_colour = "#2da44e", *bad_colour = "#e5534b",
                     *quiet_colour = "#848d97", *text_colour = "#6e7781";

std::string node_of(const surveyed& one) {
    auto how = of_component(one);
    std::vector<std::string> lines{one.name.path};
    if (how != style::good) lines.push_back(state_text(one));
    return fmt::format("    {} [label={} fillcolor=\"{}\"{}];\n", quoted_for_dot(one.name.path), label_of(lines),
                       how == style::good      ? "#ddf4e4"
                       : how == style::warning ? "#fff3cd"
                                               : "#ffd8d3",
                       one.about ? "" : " style=\"filled,rounded,dashed\"");
}

// The services of one end and kind are one arrow.
std::string arrows_of(const drawn_graph& in, const connection_line& line, const std::string& other) {
    std::string text;
    auto colour = [&](const char* usual) { return line.stalled ? bad_colour : usual; };
    for (bool a_provides : {false, true})
        for (bool subscriptions : {false, true}) {
            std::vector<std::string> lines;
            for (const auto& one : line.services) {
                const auto& provider = a_provides ? line.a : line.b;
                if (one.a_provides != a_provides || is_subscription(in, provider, one.service) != subscriptions)
                    continue;
                auto rate = rate_of(in, provider, one.service);
                lines.push_back(one.service + (rate.empty() ? "" : " " + rate));
            }
            if (lines.empty()) continue;
            lines.push_back("(" + line.over + ")");
            auto a = quoted_for_dot(line.a);
            text +=
                fmt::format("  {} -> {} [label={} color=\"{}\"{}];\n", a_provides ? other : a, a_provides ? a : other,
                            label_of(lines), colour(subscriptions ? subscriptions_colour : calls_colour),
                            subscriptions ? " arrowhead=empty" : "");
        }
    if (text.empty())
        text = fmt::format("  {} -> {} [label={} dir=none color=\"{}\"];\n", quoted_for_dot(line.a), other,
                           label_of({line.over}), colour(quiet_colour));
    return text;
}

} // namespace

drawn_graph graph_of(const std::vector<surveyed>& before, const std::vector<surveyed>& now, const std::string& prefix) {
    drawn_graph made;
    auto asked_for = [&](const std::string& path) { return !path.empty() && naming::lies_below(path, prefix); };
    std::set<std::string> shown;
    auto then = connections_of(before);
    for (auto& line : connections_of(now)) {
        if (!asked_for(line.a) && !asked_for(line.b)) continue;
        shown.insert(line.a);
        if (!line.b.empty()) shown.insert(line.b);
        made.lines.push_back(std::move(line));
    }
    std::map<std::string, double> seconds; // between the two looks at a component
    for (const auto& one : now)
        for (const auto& old : before)
            if (one.about && old.about && one.about->incarnation == old.about->incarnation)
                seconds[one.name.path] = std::chrono::duration<double>(one.answered_at - old.answered_at).count();
    for (const auto& line : made.lines) {
        auto old = std::ranges::find_if(then, [&](const connection_line& one) {
            return one.a == line.a && one.b == line.b && (!one.b.empty() || one.address == line.address);
        });
        auto apart = seconds.find(line.a);
        if (apart == seconds.end()) apart = seconds.find(line.b);
        std::optional<connection_rate> rate;
        if (old != then.end() && apart != seconds.end() && apart->second > 0 && line.bytes_to_a >= old->bytes_to_a &&
            line.bytes_to_b >= old->bytes_to_b)
            rate = connection_rate{static_cast<double>(line.bytes_to_a - old->bytes_to_a) / apart->second,
                                   static_cast<double>(line.bytes_to_b - old->bytes_to_b) / apart->second};
        made.rates.push_back(rate);
    }
    if (!before.empty())
        for (const auto& one : activities(before, now))
            for (const auto& service : one.services) made.services[by_name(one.path, service.name)] = service.hz;
    std::set<by_name> provided_here;
    for (const auto& one : now) {
        if (asked_for(one.name.path)) shown.insert(one.name.path);
        if (!one.about) continue;
        for (const auto& service : one.about->services)
            if (service.provided) made.kinds[by_name(one.name.path, service.name)] = service.kind;
    }
    for (const auto& one : now)
        if (shown.contains(one.name.path)) made.components.push_back(one);
    for (const auto& line : services_of(now, false)) {
        if (!line.missing) continue;
        for (const auto& user : line.users)
            if (shown.contains(user)) made.missing.push_back({user, line.name});
    }
    return made;
}

styled_page graph_as_page(const drawn_graph& of) {
    std::map<std::string, std::vector<const surveyed*>> hosts;
    for (const auto& one : of.components) hosts[one.name.host_name].push_back(&one);
    styled_page page;
    for (const auto& [host, components] : hosts) {
        if (!page.empty()) page.emplace_back();
        styled_line title;
        title.add(printable(host), style::heading);
        title.add(fmt::format("  {} component{}", components.size(), components.size() == 1 ? "" : "s"), style::dim);
        page.push_back(std::move(title));
        for (const auto* one : components) {
            const auto& path = one->name.path;
            styled_line line;
            line.add("  " + printable(path) + "  ");
            line.add(printable(state_text(*one)), of_component(*one));
            page.push_back(std::move(line));
            std::vector<std::pair<std::size_t, bool>> mine;
            for (std::size_t at = 0; at < of.lines.size(); ++at) {
                if (of.lines[at].a == path) mine.emplace_back(at, true);
                if (of.lines[at].b == path && of.lines[at].a != path) mine.emplace_back(at, false);
            }
            std::vector<const missing_need*> missing;
            for (const auto& need : of.missing)
                if (need.component == path) missing.push_back(&need);
            for (std::size_t at = 0; at < mine.size(); ++at)
                add_connection(page, of, mine[at].first, mine[at].second, at + 1 == mine.size() && missing.empty());
            for (const auto* need : missing) {
                styled_line row;
                row.add(need == missing.back() ? "  └─ " : "  ├─ ", style::dim);
                row.add("needs " + printable(need->service) + ": ");
                row.add("missing, no component provides it", style::bad);
                page.push_back(std::move(row));
            }
        }
    }
    return page;
}

std::string graph_as_dot(const drawn_graph& of) {
    auto text = fmt::format(
        "digraph ise {{\n  rankdir=LR;\n  bgcolor=\"transparent\";\n  graph [fontname=\"sans-serif\" fontsize=11 "
        "fontcolor=\"{0}\" color=\"{1}\"];\n"
        "  node [shape=box style=\"filled,rounded\" fontname=\"sans-serif\" color=\"{1}\" fillcolor=\"#ffffff\" "
        "fontcolor=\"#1f2328\"];\n  edge [fontname=\"sans-serif\" fontsize=11 fontcolor=\"{0}\"];\n"
        "  label=\"arrows: from user to provider; blue: calls, green: subscriptions{2}\";\n",
        text_colour, quiet_colour, of.missing.empty() ? "" : ", red: missing");
    std::map<std::string, std::vector<const surveyed*>> hosts;
    std::set<std::string> known;
    for (const auto& one : of.components) {
        hosts[one.name.host_name].push_back(&one);
        known.insert(one.name.path);
    }
    std::size_t number = 0;
    for (const auto& [host, components] : hosts) {
        text += fmt::format("  subgraph cluster_{} {{\n    label={};\n    style=\"rounded,dashed\";\n", number++,
                            label_of({host}));
        for (const auto* one : components) text += node_of(*one);
        text += "  }\n";
    }
    std::size_t strangers = 0;
    for (const auto& line : of.lines) {
        auto other = quoted_for_dot(line.b);
        if (line.b.empty()) {
            other = fmt::format("\"anonymous {}\"", ++strangers);
            text += fmt::format("  {} [label={} style=\"filled,dotted\"];\n", other, label_of({line.address}));
        }
        for (const auto* name : {&line.a, &line.b}) // of a peer that is not registered
            if (!name->empty() && known.insert(*name).second)
                text += fmt::format("  {} [style=\"filled,dashed\"];\n", quoted_for_dot(*name));
        text += arrows_of(of, line, other);
    }
    for (const auto& need : of.missing) {
        auto node = quoted_for_dot("missing " + need.service);
        text += fmt::format("  {} [label={} shape=octagon style=dashed color=\"{}\" fontcolor=\"{}\"];\n", node,
                            label_of({need.service, "missing"}), bad_colour, bad_colour);
        text +=
            fmt::format("  {} -> {} [color=\"{}\" style=dashed];\n", quoted_for_dot(need.component), node, bad_colour);
    }
    return text + "}\n";
}

} // namespace ise::cli
