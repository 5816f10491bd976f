#include <ise/bag/difference.hpp>

#include <ise/packet/detail/text_forms.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <utility>

namespace ise::bag {
namespace {

using json = nlohmann::ordered_json; // fields in the order of the packet

// ISO 8601, in UTC.
std::string utc_text(timestamp at) {
    type_description nanoseconds;
    nanoseconds.kind = type_kind::instant;
    nanoseconds.period_den = 1'000'000'000;
    std::string quoted;
    detail::append_json_time(quoted, nanoseconds, static_cast<std::int64_t>(at));
    return quoted.substr(1, quoted.size() - 2);
}

struct comparison {
    const std::string& service;
    const ignored_fields& ignored;

    // `place` with list positions is for people, `field` without them is what `ignored` has.
    std::optional<field_difference> operator()(const json& recorded, const json& now, const std::string& place,
                                               const std::string& field) const {
        if (!field.empty() && ignored.has(service, field)) return std::nullopt;
        if (recorded.is_object() && now.is_object()) {
            auto below = [](const std::string& path, const std::string& name) {
                return path.empty() ? name : path + "." + name;
            };
            for (const auto& [name, value] : recorded.items()) {
                auto other = now.find(name);
                if (other == now.end()) return of(value, nullptr, below(place, name), below(field, name));
                if (auto found = (*this)(value, *other, below(place, name), below(field, name))) return found;
            }
            for (const auto& [name, value] : now.items())
                if (!recorded.contains(name)) return of(nullptr, value, below(place, name), below(field, name));
            return std::nullopt;
        }
        if (recorded.is_array() && now.is_array()) {
            for (std::size_t i = 0; i < std::min(recorded.size(), now.size()); ++i)
                if (auto found = (*this)(recorded[i], now[i], fmt::format("{}[{}]", place, i), field)) return found;
            const auto both = std::min(recorded.size(), now.size());
            if (recorded.size() == now.size()) return std::nullopt;
            const auto end = fmt::format("{}[{}]", place, both);
            return recorded.size() > both ? of(recorded[both], nullptr, end, field)
                                          : of(nullptr, now[both], end, field);
        }
        return recorded == now ? std::nullopt : of(recorded, now, place, field);
    }

    std::optional<field_difference> of(const json& recorded, const json& now, const std::string& place,
                                       const std::string& field) const {
        if (!field.empty() && ignored.has(service, field)) return std::nullopt;
        auto text = [](const json& value) { return value.is_null() ? std::string() : value.dump(); };
        return field_difference{place, text(recorded), text(now)};
    }
};

} // namespace

std::string difference::text() const {
    auto shown = [](const std::string& value) { return value.empty() ? std::string("nothing") : value; };
    return fmt::format("{} {}: {} {} of '{}'{}: {} in the recording, {} now", utc_text(at), component, what, number,
                       service, field.empty() ? std::string() : ", field " + field, shown(recorded), shown(now));
}

bool ignored_fields::has(const std::string& service, const std::string& field) const {
    return std::ranges::any_of(fields_, [&](const std::string& one) {
        const auto slash = one.find('/');
        if (slash != one.npos) return one == service + "/" + field;
        return field == one || field.ends_with("." + one);
    });
}

std::optional<field_difference> compare_packets(const schema& of, bytes_view recorded, bytes_view now,
                                                const std::string& service, const ignored_fields& ignored) {
    if (std::ranges::equal(recorded, now)) return std::nullopt;
    const auto before = json::parse(to_json(of, recorded));
    const auto after = json::parse(to_json(of, now));
    auto found = comparison{service, ignored}(before, after, {}, {});
    // Bytes that differ only in what JSON does not show, such as the payload of a NaN.
    if (!found && ignored.empty() && before == after) return field_difference{"", "other bytes", "other bytes"};
    return found;
}

} // namespace ise::bag
