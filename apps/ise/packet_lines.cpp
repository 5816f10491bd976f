#include "packet_lines.hpp"

#include "exit_code.hpp"
#include "text.hpp"

#include <ise/core/error.hpp>
#include <ise/core/time_text.hpp>
#include <ise/packet/detail/text_forms.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>
#include <optional>
#include <string_view>
#include <utility>

namespace ise::cli {
namespace {

void add_leaves(const type_description& of, const std::string& before, std::vector<std::string>& into) {
    if (of.kind != type_kind::structure || of.members.empty()) {
        if (!before.empty()) into.push_back(before);
        return;
    }
    for (const auto& member : of.members)
        add_leaves(member.type, before.empty() ? member.name : before + "." + member.name, into);
}

std::vector<std::string> columns_of(const packet_format& how, const schema& of) {
    if (!how.fields.empty()) return how.fields;
    std::vector<std::string> all;
    add_leaves(of.type(), {}, all);
    return all;
}

std::optional<field_view> find(const dynamic_packet& packet, const std::string& path) {
    try {
        return packet.field(path);
    } catch (const error&) {
        return std::nullopt; // this packet does not have it
    }
}

std::string csv_cell(const packet_format& how, std::string text) {
    if (how.terminal) text = printable(text);
    if (text.find_first_of(",\"\r\n") == text.npos) return text;
    std::string quoted = "\"";
    for (char letter : text) quoted += letter == '"' ? std::string("\"\"") : std::string(1, letter);
    return quoted + "\"";
}

std::string csv_value(const packet_format& how, const dynamic_packet& packet, const std::string& path) {
    auto value = find(packet, path);
    if (!value || (value->kind() == type_kind::optional && value->is_null())) return {};
    auto text = value->as_string();
    // A time is a string in JSON.
    if (value->kind() == type_kind::instant && text.size() > 1 && text.front() == '"')
        text = text.substr(1, text.size() - 2);
    return csv_cell(how, std::move(text));
}

std::string json_value(const packet_format& how, const dynamic_packet& packet) {
    auto one = [&](const std::string& path) {
        auto value = find(packet, path);
        return value ? value->to_json() : std::string("null");
    };
    if (how.fields.empty()) return packet.to_json(how.style);
    if (how.fields.size() == 1) return one(how.fields.front());
    std::string object;
    for (const auto& path : how.fields) {
        object += object.empty() ? '{' : ',';
        detail::append_json_string(object, path);
        object += ':' + one(path);
    }
    return object + "}";
}

std::string stamp_of(const received<dynamic_packet>& packet) {
    const auto at = packet.published_at();
    return at ? iso_8601(*at, 9) : std::string();
}

[[noreturn]] void no_field(const schema& of, const std::string& path, const std::string& why) {
    std::vector<std::string> all;
    add_leaves(of.type(), {}, all);
    throw problem(exit_code::usage, "usage", fmt::format("the packets have no field '{}': {}", path, why),
                  all.empty() ? "they have no fields" : "they have " + enumerate(all));
}

} // namespace

void check_field(const schema& of, const std::string& path) {
    const auto* type = &of.type();
    std::string_view rest = path;
    if (rest.empty()) no_field(of, path, "it has no name");
    while (!rest.empty()) {
        while (type->kind == type_kind::optional) type = &type->members[0].type;
        if (type->kind == type_kind::variant || type->kind == type_kind::map) return; // each packet has its own
        if (rest.front() == '[') {
            const auto end = rest.find(']');
            const auto digits = rest.substr(1, end == rest.npos ? 0 : end - 1);
            const bool number = !digits.empty() && std::ranges::all_of(digits, [](unsigned char letter) {
                return std::isdigit(letter) != 0;
            });
            const bool list =
                type->kind == type_kind::vector || type->kind == type_kind::set || type->kind == type_kind::array;
            if (!number) no_field(of, path, "expected [number]");
            if (!list) no_field(of, path, fmt::format("{} has no elements", short_text(*type)));
            type = &type->members[0].type;
            rest.remove_prefix(end + 1);
            continue;
        }
        if (rest.front() == '.') rest.remove_prefix(1);
        const auto name = rest.substr(0, rest.find_first_of(".["));
        const type_description* found = nullptr;
        for (std::size_t i = 0; i < type->members.size(); ++i)
            if ((type->kind == type_kind::structure && type->members[i].name == name) ||
                (type->kind == type_kind::tuple && std::to_string(i) == name))
                found = &type->members[i].type;
        if (!found) no_field(of, path, fmt::format("there is no '{}' in {}", name, short_text(*type)));
        type = found;
        rest.remove_prefix(name.size());
    }
}

std::string csv_heading(const packet_format& how, const schema& of, bool with_source) {
    std::vector<std::string> names;
    if (with_source) names = {"component", "service"};
    if (how.stamp) names.emplace_back("published_at");
    if (how.losses) names.emplace_back("lost_before");
    for (auto& one : columns_of(how, of)) names.push_back(std::move(one));
    std::string line;
    for (auto& one : names) line += (line.empty() ? "" : ",") + csv_cell(how, std::move(one));
    return line + "\n";
}

std::string packet_line(const packet_format& how, const received<dynamic_packet>& packet, const packet_source& from) {
    const auto lost = packet.lost_before();
    if (how.csv) {
        std::vector<std::string> cells;
        if (!from.component.empty()) cells = {csv_cell(how, from.component), csv_cell(how, from.service)};
        if (how.stamp) cells.push_back(stamp_of(packet));
        if (how.losses) cells.push_back(lost ? std::to_string(*lost) : std::string());
        for (const auto& path : columns_of(how, packet->type())) cells.push_back(csv_value(how, *packet, path));
        std::string line;
        for (std::size_t i = 0; i < cells.size(); ++i) line += (i == 0 ? "" : ",") + cells[i];
        return line + "\n";
    }
    std::string line;
    auto member = [&line](std::string_view name, std::string_view json) {
        line += line.empty() ? '{' : ',';
        line += fmt::format("\"{}\":{}", name, json);
    };
    auto quoted = [](const std::string& text) {
        std::string json;
        detail::append_json_string(json, text);
        return json;
    };
    if (!from.component.empty()) {
        member("component", quoted(from.component));
        member("service", quoted(from.service));
    }
    if (how.stamp) member("published_at", packet.published_at() ? quoted(stamp_of(packet)) : "null");
    if (how.losses) member("lost_before", lost ? std::to_string(*lost) : "null");
    if (line.empty()) return json_value(how, *packet) + "\n";
    member("packet", json_value(how, *packet));
    return line + "}\n";
}

} // namespace ise::cli
