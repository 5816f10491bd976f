#pragma once
#include <ise/core/result.hpp>
#include <ise/packet/bounded.hpp>

#include <cstdint>
#include <functional>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <type_traits>
#include <vector>

namespace ise {

/// The kind of a parameter's values. Kinds are only appended, because descriptions are sent to other programs.
enum class parameter_kind : std::uint8_t {
    text,
    integer,
    number,
    boolean,     ///< true or false
    path,        ///< of a file or device; launch rules allow folders
    hexadecimal, ///< up to 16 digits
    endpoint,    ///< on which the component listens: tcp://127.0.0.1:7411; launch rules allow addresses
    address,     ///< the same without scheme and port: 127.0.0.1
    url,         ///< to which the component connects: https://host/path, tcp://host:7411; launch rules allow hosts
};

/// "text", "integer", "number", …
std::string_view name_of(parameter_kind kind) noexcept;

/// The declaration of a parameter of a component type. It is a packet too.
struct parameter {
    std::string name;                           ///< "wind-speed": lower-case letters, digits and dashes
    parameter_kind kind = parameter_kind::text; ///< of its values
    std::string description;                    ///< for `--help`
    std::string unit;                           ///< "m/s"; empty: none
    std::string preset;                         ///< the default value
    std::optional<double> minimum;              ///< the lowest number allowed; empty: no limit
    std::optional<double> maximum;              ///< the highest number allowed; empty: no limit
    std::vector<std::string> choices;           ///< the only allowed texts, if not empty
    bool many = false;                          ///< may be given several times
    bool changeable = false;                    ///< while the component runs
    std::string address;                        ///< for a TCP port to listen on: the parameter with the address
};

/// The longest value, in bytes.
inline constexpr std::size_t max_parameter_value = 4096;

/// "a number from 0 to 40 (m/s)"
std::string allowed_values(const parameter& of);

/// Checks whether `value` is allowed: errc::invalid_argument names the parameter and the allowed values.
result<void> check(const parameter& of, std::string_view value);

namespace detail {
/// The value of a text that passed `check`; fails if the type cannot hold it.
result<void> read_value(const parameter& of, const std::string& text, double& into);
result<void> read_value(const parameter& of, const std::string& text, std::int64_t& into);
result<void> read_value(const parameter& of, const std::string& text, std::uint64_t& into);
std::string show_value(double value);
result<void> refuse_value(const parameter& of, const std::string& text);
std::string parameter_name(std::string_view field);
} // namespace detail

/// The environment variable that gives a parameter: ISE_PARAMETER_WIND_SPEED for "wind-speed".
std::string variable_of(const parameter& one);

/// The parameters of one component, bound to the variables that hold their values. The variables outlive it.
class parameter_set {
public:
    /// Refines the parameter declared last: `set.add("wind-speed", speed, "of the wind").range(0, 40).unit("m/s")`.
    class declared {
    public:
        /// Made by `parameter_set::add`.
        explicit declared(parameter& what) : what_(&what) {}
        /// The lowest and the highest number allowed.
        declared& range(double minimum, double maximum) {
            return what_->minimum = minimum, what_->maximum = maximum, *this;
        }
        /// The unit, for people.
        declared& unit(std::string name) { return what_->unit = std::move(name), *this; }
        /// The only texts allowed.
        declared& one_of(std::vector<std::string> choices) { return what_->choices = std::move(choices), *this; }
        /// The kind, of a text or an integer.
        declared& kind(parameter_kind kind) {
            what_->kind = kind;
            if (kind == parameter_kind::hexadecimal) what_->minimum = what_->maximum = std::nullopt;
            return *this;
        }
        /// The description, for `--help`.
        declared& described(std::string text) { return what_->description = std::move(text), *this; }
        /// The default value.
        declared& preset(std::string text) { return what_->preset = std::move(text), *this; }
        /// For an integer: the TCP port on which the component listens, at the address in the parameter `address`. Both
        /// together are an endpoint, which an instantiation server tries before a start.
        declared& port_at(std::string address) { return what_->address = std::move(address), *this; }
        /// It can be changed while the component runs (component_type::makes). Throws errc::invalid_argument for a
        /// parameter that may be given several times.
        declared& changeable();

    private:
        parameter* what_; // until the next is added
    };

    /// Declares a parameter that is stored in `into`, whose present value is the default.
    declared add(std::string name, std::string& into, std::string description);
    /// The same, for a parameter that may be given several times.
    declared add(std::string name, std::vector<std::string>& into, std::string description);
    /// The same, for true or false.
    declared add(std::string name, bool& into, std::string description);
    /// The same, for a number.
    template <class T>
    requires std::is_arithmetic_v<T> declared add(std::string name, T& into, std::string description) {
        parameter made;
        made.name = std::move(name);
        made.description = std::move(description);
        if constexpr (std::is_floating_point_v<T>) {
            made.kind = parameter_kind::number;
            made.preset = detail::show_value(static_cast<double>(into));
            return add(std::move(made),
                       [&into](const parameter& of, const std::string& text) { return read<double>(of, text, into); });
        } else {
            made.kind = parameter_kind::integer;
            made.preset = std::to_string(into);
            if constexpr (std::is_unsigned_v<T> || sizeof(T) < 8)
                made.minimum = static_cast<double>(std::numeric_limits<T>::min());
            // Exact as a double.
            if constexpr (sizeof(T) < 8) made.maximum = static_cast<double>(std::numeric_limits<T>::max());
            using wide = std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>;
            return add(std::move(made),
                       [&into](const parameter& of, const std::string& text) { return read<wide>(of, text, into); });
        }
    }

    /// A number with its own range and unit.
    template <class T, auto Minimum, auto Maximum, unit_text Unit>
    declared add(std::string name, bounded<T, Minimum, Maximum, Unit>& into, std::string description) {
        using limited = bounded<T, Minimum, Maximum, Unit>;
        parameter made;
        made.name = std::move(name);
        made.description = std::move(description);
        made.unit = std::string(limited::unit);
        made.minimum = static_cast<double>(limited::minimum);
        made.maximum = static_cast<double>(limited::maximum);
        made.kind = std::is_floating_point_v<T> ? parameter_kind::number : parameter_kind::integer;
        if constexpr (std::is_floating_point_v<T>) made.preset = detail::show_value(static_cast<double>(into.value()));
        else made.preset = std::to_string(into.value());
        return add(std::move(made), [&into](const parameter& of, const std::string& text) {
            using wide = std::conditional_t<std::is_floating_point_v<T>, double,
                                            std::conditional_t<std::is_signed_v<T>, std::int64_t, std::uint64_t>>;
            T value{};
            auto got = read<wide>(of, text, value);
            if (!got) return got;
            if (!limited::allows(value)) return detail::refuse_value(of, text); // range() was made wider
            into = limited(value);
            return got;
        });
    }
    /// Adds every field of a packet, by its name: `wind_speed_mps` is "wind-speed-mps". Numbers, `bounded` numbers,
    /// bools, texts and lists of texts are parameters; another field does not compile. `operator[]` refines one.
    template <reflectable Options>
    void add_fields(Options& of) {
        for_each_field(of, [this](std::string_view name, auto& field) {
            this->add(detail::parameter_name(name), field, std::string());
        });
    }
    /// Refines a parameter declared before: `set["wind-speed"].described("of the wind").changeable()`. Throws
    /// errc::invalid_argument if there is none of that name.
    declared operator[](std::string_view name);

    /// Checks and stores a value; a parameter that may be given several times gets one more. errc::invalid_argument
    /// names the parameter and the allowed values, or for an unknown one the known parameters.
    result<void> set(std::string_view name, const std::string& value);
    /// Sets parameters that have not been given from the environment: "wind-speed" by ISE_PARAMETER_WIND_SPEED. Errors
    /// as `set`, with the variable's name.
    result<void> set_from(const std::function<std::optional<std::string>(const std::string&)>& variable);
    /// Whether `change` would succeed: errc::invalid_argument also if the parameter is not changeable.
    result<void> may_change(std::string_view name, const std::string& value) const;
    /// Changes the value while the component runs, without a notification.
    result<void> change(std::string_view name, const std::string& value);
    /// Restores the variable of a parameter with a single value to the value that `values` returns.
    void assign_again(std::string_view name);
    /// The declaration of a parameter; null if there is none of that name.
    const parameter* find(std::string_view name) const noexcept;
    /// The same; errc::invalid_argument with the nearest name, or those that there are.
    result<const parameter*> known(std::string_view name) const;
    /// The present value: one text, or any number for a parameter that may be given several times. `of` is one of
    /// all().
    std::vector<std::string> values(const parameter& of) const;
    /// All declarations, in their order.
    const std::vector<parameter>& all() const noexcept { return declared_; }

private:
    using store = std::function<result<void>(const parameter& of, const std::string& text)>;
    declared add(parameter made, store assign);
    std::size_t place_of(const parameter& which) const noexcept {
        return static_cast<std::size_t>(&which - declared_.data());
    }

    template <class Wide, class T>
    static result<void> read(const parameter& of, const std::string& text, T& into) {
        Wide value{};
        auto got = detail::read_value(of, text, value);
        if (got) into = static_cast<T>(value);
        return got;
    }

    std::vector<parameter> declared_;
    std::vector<store> stores_;
    std::vector<std::vector<std::string>> given_; // of each
};

} // namespace ise
