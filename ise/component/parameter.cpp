#include <ise/component/parameter.hpp>

#include <ise/component/nearest.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/readable.hpp>
#include <ise/core/url.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <cmath>

namespace ise {
namespace {

// As much of a text as belongs into a message.
std::string shown(std::string_view value) { return readable(value, 60); }

std::string shown(double limit) {
    if (limit == std::floor(limit) && std::abs(limit) < 1e15) return fmt::format("{:.0f}", limit);
    return fmt::format("{:g}", limit);
}

template <class T>
bool parses(std::string_view text, T& into, int base_or_zero = 0) {
    std::from_chars_result got{};
    if constexpr (std::is_floating_point_v<T>) {
        got = std::from_chars(text.data(), text.data() + text.size(), into);
    } else {
        got = std::from_chars(text.data(), text.data() + text.size(), into, base_or_zero == 0 ? 10 : base_or_zero);
    }
    return got.ec == std::errc() && got.ptr == text.data() + text.size() && !text.empty();
}

bool in_range(const parameter& of, double value) {
    return std::isfinite(value) && (!of.minimum || value >= *of.minimum) && (!of.maximum || value <= *of.maximum);
}

// A numeric address or a host's name; which ones are allowed is the affair of whoever starts programs for others.
bool is_address(std::string_view value) {
    return std::ranges::all_of(value, [](unsigned char letter) {
        return (letter >= 'a' && letter <= 'z') || (letter >= 'A' && letter <= 'Z') ||
               (letter >= '0' && letter <= '9') || letter == '.' || letter == ':' || letter == '-' || letter == '_';
    });
}

bool fits_kind(const parameter& of, std::string_view value) {
    switch (of.kind) {
        case parameter_kind::text:
        case parameter_kind::path: return true;
        case parameter_kind::endpoint: return value.empty() || endpoint::parse(value);
        case parameter_kind::address: return is_address(value);
        case parameter_kind::url: return value.empty() || parse_url(value);
        case parameter_kind::boolean: return value == "true" || value == "false";
        case parameter_kind::hexadecimal: {
            std::uint64_t number = 0;
            return value.size() <= 16 && parses(value, number, 16);
        }
        case parameter_kind::number: {
            double number = 0;
            return parses(value, number) && in_range(of, number);
        }
        case parameter_kind::integer: {
            std::int64_t number = 0;
            if (parses(value, number)) return in_range(of, static_cast<double>(number));
            std::uint64_t big = 0;
            return parses(value, big) && in_range(of, static_cast<double>(big));
        }
    }
    return false;
}

failure not_a_value(const parameter& of, std::string_view value) {
    return {errc::invalid_argument,
            fmt::format("parameter '{}' cannot be '{}': it must be {}", of.name, shown(value), allowed_values(of))};
}

template <class T>
result<void> read_integer(const parameter& of, const std::string& text, T& into) {
    if (!parses(text, into, of.kind == parameter_kind::hexadecimal ? 16 : 10)) return not_a_value(of, text);
    return {};
}

} // namespace

std::string_view name_of(parameter_kind kind) noexcept {
    switch (kind) {
        case parameter_kind::text: return "text";
        case parameter_kind::integer: return "integer";
        case parameter_kind::number: return "number";
        case parameter_kind::boolean: return "boolean";
        case parameter_kind::path: return "path";
        case parameter_kind::hexadecimal: return "hexadecimal";
        case parameter_kind::endpoint: return "endpoint";
        case parameter_kind::address: return "address";
        case parameter_kind::url: return "url";
    }
    return "?";
}

std::string allowed_values(const parameter& of) {
    std::string text;
    switch (of.kind) {
        case parameter_kind::text: text = "a text"; break;
        case parameter_kind::path: text = "a path"; break;
        case parameter_kind::boolean: text = "true or false"; break;
        case parameter_kind::hexadecimal: text = "1 to 16 hexadecimal digits"; break;
        case parameter_kind::number: text = "a number"; break;
        case parameter_kind::integer: text = "an integer"; break;
        case parameter_kind::endpoint: text = "an endpoint to listen on, such as tcp://127.0.0.1:7411"; break;
        case parameter_kind::address: text = "an address to listen on, such as 127.0.0.1"; break;
        case parameter_kind::url: text = "a URL to connect to, such as https://host/path or tcp://host:7411"; break;
    }
    if (!of.choices.empty()) text = fmt::format("one of {}", fmt::join(of.choices, ", "));
    if (of.minimum && of.maximum) text += fmt::format(" from {} to {}", shown(*of.minimum), shown(*of.maximum));
    else if (of.minimum) text += fmt::format(" of at least {}", shown(*of.minimum));
    else if (of.maximum) text += fmt::format(" of at most {}", shown(*of.maximum));
    if (!of.unit.empty()) text += fmt::format(" ({})", of.unit);
    return text;
}

result<void> check(const parameter& of, std::string_view value) {
    if (value.size() > max_parameter_value)
        return failure(errc::invalid_argument, fmt::format("parameter '{}' has {} bytes, {} are allowed", of.name,
                                                           value.size(), max_parameter_value));
    bool plain = std::ranges::none_of(value, [](unsigned char letter) { return letter < 0x20 || letter == 0x7F; });
    if (!plain)
        return failure(errc::invalid_argument, fmt::format("parameter '{}' holds a control character", of.name));
    bool chosen = of.choices.empty() || std::ranges::find(of.choices, value) != of.choices.end();
    if (!chosen || !fits_kind(of, value)) return not_a_value(of, value);
    return {};
}

namespace detail {

result<void> read_value(const parameter& of, const std::string& text, double& into) {
    if (!parses(text, into)) return not_a_value(of, text);
    return {};
}
result<void> read_value(const parameter& of, const std::string& text, std::int64_t& into) {
    return read_integer(of, text, into);
}
result<void> read_value(const parameter& of, const std::string& text, std::uint64_t& into) {
    return read_integer(of, text, into);
}

std::string show_value(double value) { return fmt::format("{}", value); }
result<void> refuse_value(const parameter& of, const std::string& text) { return not_a_value(of, text); }

std::string parameter_name(std::string_view field) {
    std::string name;
    for (char letter : field)
        name += letter == '_' ? '-' : letter >= 'A' && letter <= 'Z' ? static_cast<char>(letter - 'A' + 'a') : letter;
    return name;
}

} // namespace detail

parameter_set::declared parameter_set::add(parameter made, store assign) {
    declared_.push_back(std::move(made));
    stores_.push_back(std::move(assign));
    given_.emplace_back();
    return declared(declared_.back());
}

parameter_set::declared parameter_set::add(std::string name, std::string& into, std::string description) {
    parameter made;
    made.name = std::move(name);
    made.description = std::move(description);
    made.preset = into;
    return add(std::move(made), [&into](const parameter&, const std::string& text) {
        into = text;
        return result<void>();
    });
}

parameter_set::declared parameter_set::add(std::string name, std::vector<std::string>& into, std::string description) {
    parameter made;
    made.name = std::move(name);
    made.description = std::move(description);
    made.preset = fmt::format("{}", fmt::join(into, ","));
    made.many = true;
    return add(std::move(made), [&into, mine = false](const parameter&, const std::string& text) mutable {
        if (!std::exchange(mine, true)) into.clear(); // the first that is given replaces the preset
        into.push_back(text);
        return result<void>();
    });
}

parameter_set::declared parameter_set::add(std::string name, bool& into, std::string description) {
    parameter made;
    made.name = std::move(name);
    made.kind = parameter_kind::boolean;
    made.description = std::move(description);
    made.preset = into ? "true" : "false";
    return add(std::move(made), [&into](const parameter&, const std::string& text) {
        into = text == "true";
        return result<void>();
    });
}

parameter_set::declared parameter_set::operator[](std::string_view name) {
    auto found = known(name);
    if (!found) throw error(found.error());
    return declared(declared_[place_of(**found)]);
}

const parameter* parameter_set::find(std::string_view name) const noexcept {
    auto found = std::ranges::find(declared_, name, &parameter::name);
    return found == declared_.end() ? nullptr : &*found;
}

result<const parameter*> parameter_set::known(std::string_view name) const {
    if (const auto* found = find(name)) return found;
    std::vector<std::string> names;
    for (const auto& one : declared_) names.push_back(one.name);
    auto near = nearest(name, names);
    auto advice = names.empty()  ? "there are none"
                  : near.empty() ? fmt::format("the parameters are: {}", fmt::join(names, ", "))
                                 : fmt::format("did you mean '{}'?", near.front());
    return failure(errc::invalid_argument, fmt::format("there is no parameter '{}'; {}", shown(name), advice));
}

result<void> parameter_set::set(std::string_view name, const std::string& value) {
    auto found = known(name);
    if (!found) return found.error();
    const auto& which = **found;
    auto allowed = check(which, value);
    if (!allowed) return allowed;
    auto& given = given_[place_of(which)];
    if (!given.empty() && !which.many)
        return failure(errc::invalid_argument, fmt::format("parameter '{}' is given twice", which.name));
    given.push_back(value);
    return stores_[place_of(which)](which, value);
}

std::string variable_of(const parameter& one) {
    std::string name = "ISE_PARAMETER_";
    for (char letter : one.name)
        name += letter == '-' ? '_' : letter >= 'a' && letter <= 'z' ? static_cast<char>(letter - 'a' + 'A') : letter;
    return name;
}

result<void> parameter_set::set_from(const std::function<std::optional<std::string>(const std::string&)>& variable) {
    for (const auto& one : declared_) {
        if (!given_[place_of(one)].empty()) continue;
        auto name = variable_of(one);
        auto outcome = variable(name);
        if (!outcome) continue;
        auto taken = set(one.name, *outcome);
        if (!taken)
            return failure(taken.error().code(),
                           fmt::format("the environment variable {}: {}", name, taken.error().message()));
    }
    return {};
}

result<void> parameter_set::may_change(std::string_view name, const std::string& value) const {
    auto found = known(name);
    if (!found) return found.error();
    auto allowed = check(**found, value);
    if (!allowed) return allowed;
    if ((*found)->changeable) return {};
    std::vector<std::string> others;
    for (const auto& one : declared_)
        if (one.changeable) others.push_back(one.name);
    return failure(
        errc::invalid_argument,
        fmt::format("parameter '{}' cannot be changed while the component runs, {}: it is given at a start",
                    (*found)->name,
                    others.empty() ? "and neither can its others" : fmt::format("only {}", fmt::join(others, ", "))));
}

result<void> parameter_set::change(std::string_view name, const std::string& value) {
    auto allowed = may_change(name, value);
    if (!allowed) return allowed;
    const auto& which = *find(name);
    auto stored = stores_[place_of(which)](which, value);
    if (stored) given_[place_of(which)] = {value};
    return stored;
}

void parameter_set::assign_again(std::string_view name) {
    const auto* which = find(name);
    if (!which || which->many) return;
    [[maybe_unused]] auto stored = stores_[place_of(*which)](*which, values(*which).front()); // it was stored before
}

std::vector<std::string> parameter_set::values(const parameter& of) const {
    const auto& given = given_[place_of(of)];
    if (!given.empty()) return given;
    if (of.many && of.preset.empty()) return {};
    return {of.preset};
}

parameter_set::declared& parameter_set::declared::changeable() {
    if (what_->many)
        throw error(
            errc::invalid_argument,
            fmt::format("parameter '{}' may be given several times: it cannot be changed while the component runs",
                        what_->name));
    return what_->changeable = true, *this;
}

} // namespace ise
