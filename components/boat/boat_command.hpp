#pragma once
#include <components/boat/telecommands.hpp>

#include <ise/core/result.hpp>
#include <ise/packet/archive.hpp>

#include <chrono>
#include <tuple>
#include <utility>

namespace atirma {

template <class C>
concept telecommand_struct = requires {
    { C::traits.kind } -> std::convertible_to<command_kind>;
};

/// Calls `f(C())` for every telecommand, with its arguments' presets.
template <class F>
constexpr void for_each_telecommand(F&& f) {
    auto one = [&f]<class C>(std::in_place_type_t<C>) {
        if constexpr (telecommand_struct<C>) f(C());
    };
    [&one]<class... C>(std::in_place_type_t<std::variant<C...>>) {
        (one(std::in_place_type<C>), ...);
    }(std::in_place_type<any_telecommand>);
}

/// A telecommand without its id and time, as a value of any kind; a ping unless it is told otherwise.
///
///     boat_command command = commands::set_mode{sailing_mode::hold};
///     command.for_each_argument([](std::string_view name, const auto& value) { … });
///     command.visit([](const auto& each) { … });                      // each is one of telecommands.hpp
///     if (auto* set = command.get_if<commands::set_mode>()) set->mode …
///
/// In messages, records and JSON it is a struct of its kind and of all arguments that any telecommand has, of which
/// those of its kind count: `{"kind":"set_mode","mode":"hold"}`.
class boat_command {
public:
    boat_command() = default;
    template <class C>
    requires telecommand_struct<C> || std::same_as<C, commands::unknown> boat_command(C what)
        : what_(what) {} // NOLINT: each of them is one
    /// Of that kind with its presets; `unknown` where no telecommand has that number.
    explicit boat_command(command_kind kind);

    template <class F>
    decltype(auto) visit(F&& f) const {
        return std::visit(std::forward<F>(f), what_);
    }
    template <class F>
    decltype(auto) visit(F&& f) {
        return std::visit(std::forward<F>(f), what_);
    }
    /// Calls `f(name, value)` for each argument, in the order in which they travel; an unknown telecommand has none.
    template <class F>
    void for_each_argument(F&& f) const {
        visit([&f]<class C>(const C& each) {
            if constexpr (telecommand_struct<C>) ise::for_each_field(each, f);
        });
    }
    template <class F>
    void for_each_argument(F&& f) {
        visit([&f]<class C>(C& each) {
            if constexpr (telecommand_struct<C>) ise::for_each_field(each, f);
        });
    }
    template <class C>
    const C* get_if() const noexcept {
        return std::get_if<C>(&what_);
    }

    command_kind kind() const noexcept;
    /// See telecommands.hpp; empty, or false, where there is none.
    std::string_view danger() const noexcept;
    std::string_view caution() const noexcept;
    bool replaces(const boat_command& older) const noexcept;

    bool operator==(const boat_command& other) const;

    template <class Archive>
    void save(Archive& to) const;
    template <class Archive>
    void load(Archive& from);

private:
    any_telecommand what_;
};

/// Those of a kind; of an unknown one, what is safe to assume.
const command_traits& traits_of(command_kind kind) noexcept;

/// How long a telecommand of that kind over that link is valid if its request names nothing.
std::chrono::seconds default_validity(command_kind kind, link_id over) noexcept;

/// Where this number has a range: nothing where it may be any.
std::optional<argument_range> range_of(const boat_command& command, std::string_view argument);

/// Whether a boat could execute it: else invalid_argument, with the argument and its range. Shore and boat check by it.
ise::result<void> check(const boat_command& command);

namespace detail {

/// The arguments of all telecommands side by side. One of a name that an earlier telecommand has as well is not used.
class argument_columns {
public:
    void put(const boat_command& command) {
        command.for_each_argument([this](std::string_view name, const auto& value) { column(name, value) = value; });
    }
    void get(boat_command& command) {
        command.for_each_argument([this](std::string_view name, auto& value) { value = column(name, value); });
    }
    template <class Archive>
    void pass(Archive& archive) {
        for_each_column([&](std::string_view name, auto& value) {
            if (&column(name, value) == &value) archive(cereal::make_nvp(std::string(name).c_str(), value));
        });
    }

private:
    template <class V>
    struct row;
    template <class... C>
    struct row<std::variant<C...>> {
        using type = std::tuple<C...>;
    };

    template <class F>
    void for_each_column(F&& f) {
        auto one = [&f](auto& command) {
            if constexpr (telecommand_struct<std::remove_cvref_t<decltype(command)>>) ise::for_each_field(command, f);
        };
        std::apply([&one](auto&... command) { (one(command), ...); }, all_);
    }
    /// The first of that name and type.
    template <class T>
    T& column(std::string_view name, const T&) {
        T* found = nullptr;
        for_each_column([&](std::string_view other, auto& value) {
            if constexpr (std::is_same_v<T, std::remove_cvref_t<decltype(value)>>)
                if (!found && other == name) found = &value;
        });
        return *found;
    }

    row<any_telecommand>::type all_;
};

} // namespace detail

template <class Archive>
void boat_command::save(Archive& to) const {
    detail::argument_columns columns;
    columns.put(*this);
    auto of = kind();
    to(cereal::make_nvp("kind", of));
    columns.pass(to);
}

template <class Archive>
void boat_command::load(Archive& from) {
    detail::argument_columns columns;
    command_kind of{};
    from(cereal::make_nvp("kind", of));
    columns.pass(from);
    *this = boat_command(of);
    columns.get(*this);
}

} // namespace atirma
