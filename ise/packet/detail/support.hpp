#pragma once
#include <ise/packet/reflect.hpp>

#include <array>
#include <chrono>
#include <concepts>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <string>
#include <tuple>
#include <type_traits>
#include <utility>
#include <variant>
#include <vector>

namespace cereal {
class access; // its header, and <iostream> behind it, is for those who have such types
}

namespace ise {

/// Specialise it for a type whose cereal `serialize` has no fixed sequence of fields (it branches, it follows
/// pointers): the type then travels as bytes that only the same name and version can read.
/// ```cpp
/// template <> struct ise::opaque_type<route> {
///     static constexpr std::string_view name = "route";
///     static constexpr std::uint32_t version = 1;
/// };
/// ```
template <class T>
struct opaque_type {};

} // namespace ise

namespace ise::detail {

template <class T>
concept opaque = requires {
    { opaque_type<T>::name } -> std::convertible_to<std::string_view>;
    { opaque_type<T>::version } -> std::convertible_to<std::uint32_t>;
};

// Does T bring a serialize, or save and load, of its own? Asked with an archive that has no part in namespace cereal,
// so that neither ISE's generic function nor cereal's own are found. Whoever writes `ar & x`, too.
struct probe_archive {
    template <class... T>
    probe_archive& operator()(T&&...);
    template <class T>
    probe_archive& operator&(T&&);
    template <class T>
    probe_archive& operator<<(T&&);
    template <class T>
    probe_archive& operator>>(T&&);
};

template <class T>
concept public_serialize = requires(T& value, probe_archive& archive) {
    value.serialize(archive);
}
|| requires(T& value, probe_archive& archive) { value.serialize(archive, 0); }
|| requires(const T& value, probe_archive& archive) { value.save(archive); }
|| requires(const T& value, probe_archive& archive) { value.save(archive, 0); }
|| requires(const T& value, const probe_archive& archive) { value.save_minimal(archive); };

// Private ones (`friend class cereal::access`) are asked for by that class, where its header was included.
template <class T, class Access = cereal::access>
concept befriended_serialize = requires(T& value, probe_archive& archive) {
    Access::member_serialize(archive, value);
}
|| requires(T& value, probe_archive& archive) { Access::member_serialize(archive, value, 0); }
|| requires(const T& value, probe_archive& archive) { Access::member_save(archive, value); }
|| requires(const T& value, probe_archive& archive) { Access::member_save(archive, value, 0); }
|| requires(const T& value, const probe_archive& archive) { Access::member_save_minimal(archive, value); };

// Where it was not, a private one is told by its name, which is ambiguous beside another one: such a type must not be
// taken apart in one file and written by its own functions in the next.
struct namesake {
    void serialize();
    void save();
    void save_minimal();
};
template <class T>
struct with_namesake : T, namesake {};
template <class T, class Access = cereal::access>
concept unseen_serialize = !requires {
    sizeof(Access);
}
&&!std::is_final_v<T> && ((
                              !requires { &with_namesake<T>::serialize; } && !requires { &T::serialize; }) ||
                          (
                              !requires { &with_namesake<T>::save; } && !requires { &T::save; }) ||
                          (
                              !requires { &with_namesake<T>::save_minimal; } && !requires { &T::save_minimal; }));

template <class T>
concept free_serialize = requires(T& value, probe_archive& archive) {
    serialize(archive, value);
}
|| requires(T& value, probe_archive& archive) { serialize(archive, value, std::uint32_t{}); }
|| requires(const T& value, probe_archive& archive) { save(archive, value); }
|| requires(const T& value, probe_archive& archive) { save(archive, value, std::uint32_t{}); };

/// A class that is described by its own cereal functions, be they private (`friend class cereal::access`). They win
/// over reflection.
template <class T>
concept own_serialize = std::is_class_v<T> &&
    (public_serialize<T> || befriended_serialize<T> || free_serialize<T> || unseen_serialize<T>);

// Maps and sets of unique keys are known by what they have: naming them would take their headers.
template <class T>
concept of_std = full_type_name<T>()
.starts_with("std::");
template <class T>
concept standard_set = requires {
    typename T::key_type;
    typename T::insert_return_type;
}
&&!requires { typename T::mapped_type; }
&&of_std<T>;
template <class T>
concept standard_map = requires {
    typename T::mapped_type;
    typename T::insert_return_type;
}
&&of_std<T>;

// Standard templates and what they are made of.
template <class T>
struct parts {
    static constexpr bool known = false;
    using type = type_list<>;
};
template <class... T>
struct known_parts {
    static constexpr bool known = true;
    using type = type_list<T...>;
};
template <class A>
struct parts<std::basic_string<char, std::char_traits<char>, A>> : known_parts<> {};
template <class T, class A>
struct parts<std::vector<T, A>> : known_parts<T> {};
template <class T, std::size_t N>
struct parts<std::array<T, N>> : known_parts<T> {};
template <class T, std::size_t N>
struct parts<T[N]> : known_parts<T> {};
template <class T>
struct parts<std::optional<T>> : known_parts<T> {};
template <class... T>
struct parts<std::variant<T...>> : known_parts<T...> {};
template <class A, class B>
struct parts<std::pair<A, B>> : known_parts<A, B> {};
template <class... T>
struct parts<std::tuple<T...>> : known_parts<T...> {};
template <standard_map T>
struct parts<T> : known_parts<typename T::key_type, typename T::mapped_type> {};
template <standard_set T>
struct parts<T> : known_parts<typename T::key_type> {};
template <class R, class P>
struct parts<std::chrono::duration<R, P>> : known_parts<R> {};
template <class R, class P>
struct parts<std::chrono::time_point<std::chrono::system_clock, std::chrono::duration<R, P>>> : known_parts<R> {};

/// Time points of clocks that mean nothing to another process.
template <class T>
inline constexpr bool monotonic_time_point = false;
template <class Clock, class D>
inline constexpr bool monotonic_time_point<std::chrono::time_point<Clock, D>> =
    !std::is_same_v<Clock, std::chrono::system_clock>;

template <class T>
concept number = (std::is_integral_v<T> && sizeof(T) <= 8 && !std::is_same_v<T, wchar_t> &&
                  !std::is_same_v<T, char8_t> && !std::is_same_v<T, char16_t> && !std::is_same_v<T, char32_t> &&
                  !std::is_const_v<T> && !std::is_volatile_v<T>) ||
                 std::is_same_v<T, float> || std::is_same_v<T, double>;

template <class T>
concept reflected = reflectable<T> && !parts<T>::known && !own_serialize<T> && !opaque<T>;

} // namespace ise::detail
