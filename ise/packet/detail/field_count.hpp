#pragma once
#include <cstddef>
#include <type_traits>
#include <utility>

/// Counts the fields of an aggregate by asking with how many initialisers it can be made.
namespace ise::detail {

/// Converts to whatever a field is, but to neither the aggregate itself nor a base of it.
template <class T>
struct any_field {
    template <class U>
    requires(!std::is_same_v<U, T> && !std::is_base_of_v<U, T>) operator U() const noexcept {
        __builtin_unreachable(); // only asked about, never called
    }
};

/// Converts to a base of the aggregate only.
template <class T>
struct any_base {
    template <class U>
    requires(!std::is_same_v<U, T> && std::is_base_of_v<U, T>) operator U() const noexcept {
        __builtin_unreachable(); // only asked about, never called
    }
};

template <class T, std::size_t>
using any_field_at = any_field<T>;

template <class T, std::size_t... I>
consteval bool takes_initialisers(std::index_sequence<I...>) {
    return requires { T{any_field_at<T, I>{}...}; };
}

template <class T, std::size_t count>
inline constexpr bool takes = takes_initialisers<T>(std::make_index_sequence<count>());

/// Whether T can be made from as many initialisers in parentheses: there each stands for one field, and none for an
/// array.
template <class T, std::size_t... I>
consteval bool takes_one_a_field(std::index_sequence<I...>) {
    return requires { T(any_field_at<T, I>{}...); };
}

/// Whether T can be made from `before` initialisers, a braced pair, and `after` more.
template <class T, std::size_t... Before, std::size_t... After>
consteval bool takes_nested(std::index_sequence<Before...>, std::index_sequence<After...>) {
    return requires { T{any_field_at<T, Before>{}..., {any_field<T>{}, any_field<T>{}}, any_field_at<T, After>{}...}; };
}

template <class T, std::size_t before, std::size_t after>
inline constexpr bool takes_pair = takes_nested<T>(std::make_index_sequence<before>(),
                                                   std::make_index_sequence<after>());

/// The largest n below `high` for which Test<n> holds, which holds at `low` and, from there on, up to that n.
template <template <std::size_t> class Test, std::size_t low, std::size_t high>
consteval std::size_t last_that_holds() {
    if constexpr (high - low <= 1) {
        return low;
    } else {
        constexpr std::size_t middle = low + (high - low) / 2;
        if constexpr (Test<middle>::value) {
            return last_that_holds<Test, middle, high>();
        } else {
            return last_that_holds<Test, low, middle>();
        }
    }
}

/// The first n at or above `from`, up to `to`, for which Test<n> holds; to + 1 if there is none.
template <template <std::size_t> class Test, std::size_t from, std::size_t to>
consteval std::size_t first_that_holds() {
    if constexpr (from > to) {
        return to + 1;
    } else if constexpr (Test<from>::value) {
        return from;
    } else {
        return first_that_holds<Test, from + 1, to>();
    }
}

/// Doubles the step until the test fails, so that a struct of a few fields costs a few questions.
template <template <std::size_t> class Test, std::size_t low, std::size_t step, std::size_t end>
consteval std::size_t gallop() {
    if constexpr (low + step >= end) {
        return last_that_holds<Test, low, end>();
    } else if constexpr (Test<low + step>::value) {
        return gallop<Test, low + step, step * 2, end>();
    } else {
        return last_that_holds<Test, low, low + step>();
    }
}

template <class T>
struct initialisers {
    template <std::size_t n>
    struct accepted : std::bool_constant<takes<T, n>> {};

    static constexpr std::size_t none = static_cast<std::size_t>(-1);
    static constexpr std::size_t required = first_that_holds<accepted, 0, 64>(); // > 0: a field has no default
    static constexpr bool countable = required <= 64;

    static consteval std::size_t total() {
        if constexpr (!countable) {
            return none;
        } else {
            return gallop<accepted, required, 8, (sizeof(T) > required ? sizeof(T) : required) + 2>();
        }
    }
};

template <class T, std::size_t at>
struct after_pair {
    template <std::size_t n>
    struct accepted : std::bool_constant<takes_pair<T, at, n>> {};
};

/// C arrays swallow one initialiser an element: the initialisers that the field at `at` takes.
template <class T, std::size_t at, std::size_t total>
consteval std::size_t initialisers_of_field() {
    if constexpr (total - at < 2) {
        return 1;
    } else if constexpr (takes_pair<T, at, total - at - 1>) {
        return 1; // the pair stood for one initialiser: a nested struct, a container
    } else {
        constexpr std::size_t most = total - at - 2; // what may follow an array of two
        auto search = []<std::size_t... I>(std::index_sequence<I...>) consteval {
            // Found from the top, for fields without a default make too few initialisers fail, too.
            std::size_t follow = static_cast<std::size_t>(-1);
            ((follow == static_cast<std::size_t>(-1) && takes_pair<T, at, most - I> ? void(follow = most - I) : void()),
             ...);
            return follow;
        };
        if constexpr (takes_pair<T, at, most>) {
            return 2;
        } else {
            if constexpr (takes_pair<T, at, 0>) {
                return total - at - last_that_holds<after_pair<T, at>::template accepted, 0, most>();
            } else {
                constexpr std::size_t follow = search(std::make_index_sequence<most + 1>());
                return follow == static_cast<std::size_t>(-1) ? 1 : total - at - follow;
            }
        }
    }
}

template <class T, std::size_t at, std::size_t total>
consteval std::size_t count_from() {
    if constexpr (at >= total) {
        return 0;
    } else {
        return 1 + count_from<T, at + initialisers_of_field<T, at, total>(), total>();
    }
}

/// False where a field is a reference or has a type that nothing converts to.
template <class T>
inline constexpr bool countable_fields = initialisers<T>::countable;

template <class T>
inline constexpr bool has_base = requires {
    T{any_base<T>{}};
};

/// A base and members of its own: structured bindings cannot take it apart.
template <class T>
inline constexpr bool has_base_and_members = requires {
    T{any_base<T>{}, any_field<T>{}};
};

template <class T>
consteval std::size_t count_fields() {
    if constexpr (std::is_empty_v<T> || !countable_fields<T>) { // the latter is refused elsewhere, with its reason
        return 0;
    } else if constexpr (has_base<T>) {
        return initialisers<T>::total(); // all fields are the base's: its initialisers without their braces
    } else {
        constexpr std::size_t total = initialisers<T>::total();
        // One question in place of one a field, where no field is an array.
        if constexpr (takes_one_a_field<T>(std::make_index_sequence<total>())) {
            return total;
        } else {
            return count_from<T, 0, total>();
        }
    }
}

} // namespace ise::detail
