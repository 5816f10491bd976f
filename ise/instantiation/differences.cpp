#include <ise/instantiation/differences.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <map>

namespace ise::instantiation {
namespace {

using values = std::vector<std::string>;

std::map<std::string, values> by_name(const std::vector<argument>& given) {
    std::map<std::string, values> all;
    for (const auto& one : given) all[one.name].push_back(one.value);
    return all;
}

std::optional<double> number_in(const std::string& text) {
    double number = 0;
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), number);
    if (problem != std::errc() || end != text.data() + text.size()) return std::nullopt;
    return number;
}

// "6" and "6.0" are one number, "13a2" and "0013A2" one address.
bool same_value(parameter_kind kind, const std::string& a, const std::string& b) {
    if (a == b) return true;
    if (kind == parameter_kind::number) {
        auto one = number_in(a), other = number_in(b);
        return one && other && *one == *other;
    }
    if (kind != parameter_kind::hexadecimal) return false;
    std::uint64_t one = 0, other = 0;
    auto read = [](const std::string& text, std::uint64_t& into) {
        auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), into, 16);
        return problem == std::errc() && end == text.data() + text.size();
    };
    return read(a, one) && read(b, other) && one == other;
}

std::string joined(const values& all) { return fmt::format("{}", fmt::join(all, ",")); }

std::optional<difference> of_parameter(const parameter& which, const values* is, const values* wanted) {
    auto text = [&](const values* given) { return given ? joined(*given) : which.preset; };
    if (same_value(which.kind, text(is), text(wanted))) return std::nullopt;
    difference made;
    made.what = which.name;
    made.is = text(is);
    made.wanted = text(wanted);
    made.in_place = which.changeable && (!wanted || wanted->size() == 1) && check(which, made.wanted);
    if (made.in_place) made.setting = argument{which.name, made.wanted};
    return made;
}

template <class Map>
std::string roles_text(const Map& roles) {
    values all;
    for (const auto& [role, priority] : roles) all.push_back(fmt::format("{}={}", role, priority));
    return joined(all);
}

// Of what a node is told beside its parameters: takes another start.
void compare(std::vector<difference>& into, const char* what, std::string is, std::string wanted) {
    if (is == wanted) return;
    difference made;
    made.what = what;
    made.is = std::move(is);
    made.wanted = std::move(wanted);
    into.push_back(std::move(made));
}

} // namespace

std::vector<argument> with_settings(std::vector<argument> given, const std::vector<argument>& settings) {
    for (const auto& one : settings) {
        auto found = std::ranges::find(given, one.name, &argument::name);
        if (found == given.end()) given.push_back(one);
        else found->value = one.value;
    }
    return given;
}

std::vector<difference> differences(const instance_info& is, const start_request& wanted, const type_info& type,
                                    bool other_environment) {
    std::vector<difference> all;
    compare(all, "type", is.type, wanted.type);
    auto given = by_name(is.arguments), asked = by_name(wanted.arguments);
    auto find = [](const auto& in, const std::string& name) {
        auto found = in.find(name);
        return found == in.end() ? nullptr : &found->second;
    };
    for (const auto& one : type.parameters)
        if (auto made = of_parameter(one, find(given, one.name), find(asked, one.name)))
            all.push_back(std::move(*made));
    compare(all, "roles", roles_text(is.roles), roles_text(wanted.roles));
    compare(all, "endpoints", joined(is.listen), joined(wanted.listen));
    compare(all, "protocol", is.protocol, wanted.protocol);
    compare(all, "process", is.process, wanted.process);
    compare(all, "identity", is.identity, wanted.identity);
    compare(all, "user", is.user, wanted.user);
    compare(all, "limits", as_text(is.limits), as_text(wanted.limits));
    if (is.rebuilt) {
        difference made;
        made.what = "program was rebuilt";
        all.push_back(std::move(made));
    }
    if (other_environment) {
        difference made;
        made.what = "environment";
        all.push_back(std::move(made));
    }
    if (!(is.terms == wanted.terms)) {
        difference made;
        made.what = "terms of restart";
        made.in_place = true;
        all.push_back(std::move(made));
    }
    return all;
}

} // namespace ise::instantiation
