#include <components/boat/boat_command.hpp>

#include <components/boat/raw_payload.hpp>

#include <fmt/format.h>

#include <cmath>
#include <vector>

namespace atirma {

template std::span<const enum_name<command_kind>> names_of() noexcept;

namespace {

// The boat does not obey it without authority.
constexpr command_traits unknown_traits{.kind = command_kind{}, .help = {}};

template <class T>
requires std::is_enum_v<T> ise::result<void> check_argument(std::string_view name, T value, const argument_range*) {
    if (is_known(value)) return {};
    return ise::failure(ise::errc::invalid_argument, fmt::format("no {} has number {}", name, static_cast<int>(value)));
}

template <class T>
requires std::is_arithmetic_v<T> ise::result<void> check_argument(std::string_view name, T value,
                                                                  const argument_range* range) {
    auto number = static_cast<double>(value);
    if (!range) {
        if (std::isfinite(number)) return {};
        return ise::failure(ise::errc::invalid_argument, fmt::format("{} is not a number", name));
    }
    if (number >= range->minimum && number <= range->maximum) return {}; // false where it is not a number, too
    if (range->zero_is_off && number == 0) return {};
    return ise::failure(ise::errc::invalid_argument, fmt::format("{} is {}{:g} to {:g} {}, not {:g}", range->called,
                                                                 range->zero_is_off ? "0 (off) or " : "",
                                                                 range->minimum, range->maximum, range->unit, number));
}

ise::result<void> check_argument(std::string_view, const std::string& payload, const argument_range*) {
    auto good = payload_bytes(payload);
    if (!good) return good.error();
    return {};
}

ise::result<void> check_argument(std::string_view name, const waypoint& at, const argument_range*) {
    if (at.latitude_deg >= -90 && at.latitude_deg <= 90 && at.longitude_deg >= -180 && at.longitude_deg <= 180)
        return {};
    return ise::failure(
        ise::errc::invalid_argument,
        fmt::format("{} is latitude -90 to 90 and longitude -180 to 180 deg; {:g}, {:g} is not a place on the globe",
                    name, at.latitude_deg, at.longitude_deg));
}

} // namespace

argument_range commands::set_parameter::range_of(std::string_view argument, parameter_id id) {
    const auto* info = find_parameter(id);
    if (!info) return {argument, 0, 0, {}}; // the parameter itself is refused before
    return {.argument = argument,
            .minimum = static_cast<double>(info->minimum),
            .maximum = static_cast<double>(info->maximum),
            .unit = info->unit,
            .called = name_of(id)};
}

boat_command::boat_command(command_kind kind) : what_(commands::unknown{kind}) {
    for_each_telecommand([&](const auto& each) {
        if (each.traits.kind == kind) what_ = each;
    });
}

command_kind boat_command::kind() const noexcept {
    return visit([]<class C>(const C& each) {
        if constexpr (telecommand_struct<C>) return C::traits.kind;
        else return each.kind;
    });
}

std::string_view boat_command::danger() const noexcept {
    return visit([](const auto& each) -> std::string_view {
        if constexpr (requires { each.danger(); }) return each.danger();
        else return {};
    });
}

std::string_view boat_command::caution() const noexcept {
    return visit([](const auto& each) -> std::string_view {
        if constexpr (requires { each.caution(); }) return each.caution();
        else return {};
    });
}

bool boat_command::replaces(const boat_command& older) const noexcept {
    return visit([&older]<class C>(const C& newer) {
        if constexpr (requires { newer.replaces(newer); })
            if (const auto* same = older.get_if<C>()) return newer.replaces(*same);
        return false;
    });
}

bool boat_command::operator==(const boat_command& other) const {
    return visit([&]<class C>(const C& each) {
        const auto* same = other.get_if<C>();
        if (!same) return false;
        return ise::apply_fields(each, [same](const auto&... mine) {
            return ise::apply_fields(*same, [&](const auto&... theirs) { return ((mine == theirs) && ...); });
        });
    });
}

const command_traits& traits_of(command_kind kind) noexcept {
    const auto* found = &unknown_traits;
    for_each_telecommand([&]<class C>(const C&) {
        if (C::traits.kind == kind) found = &C::traits;
    });
    return *found;
}

std::chrono::seconds default_validity(command_kind kind, link_id over) noexcept {
    const auto& traits = traits_of(kind);
    return over == link_id::iridium ? traits.valid_by_satellite : traits.valid;
}

std::optional<argument_range> range_of(const boat_command& command, std::string_view argument) {
    return command.visit([&](const auto& each) -> std::optional<argument_range> {
        if constexpr (requires { each.ranges(); })
            for (const auto& range : each.ranges())
                if (range.argument == argument) return range;
        return std::nullopt;
    });
}

ise::result<void> check(const boat_command& command) {
    if (command.get_if<commands::unknown>())
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("no telecommand has number {}", static_cast<int>(command.kind())));
    ise::result<void> good;
    command.for_each_argument([&](std::string_view name, const auto& value) {
        auto range = range_of(command, name);
        if (good) good = check_argument(name, value, range ? &*range : nullptr);
    });
    return good;
}

} // namespace atirma
