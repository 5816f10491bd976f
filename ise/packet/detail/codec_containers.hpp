#pragma once
#include <ise/packet/detail/codec_fixed.hpp>

#include <algorithm>

/// Types whose length is on the wire.
namespace ise::detail {

/// Fills a vector with elements that lie in the input as in memory, perhaps unaligned. resize() would zero them
/// first, which costs more than the copy.
template <class T, class A>
void assign_raw(std::vector<T, A>& values, const std::byte* from, std::size_t count) {
    bool aligned = reinterpret_cast<std::uintptr_t>(from) % alignof(T) == 0;
    if (values.size() < count && aligned) {
        const T* first = reinterpret_cast<const T*>(from);
        values.assign(first, first + count);
        return;
    }
    values.resize(count);
    if (count != 0) std::memcpy(static_cast<void*>(values.data()), from, count * sizeof(T));
}

template <class A>
struct codec<std::basic_string<char, std::char_traits<char>, A>> {
    using text = std::basic_string<char, std::char_traits<char>, A>;
    static constexpr std::size_t min_size = 4;
    static constexpr bool fixed = false;
    static constexpr bool raw = false;

    static void write(writer to, const text& value) {
        to.put_count(value.size());
        to.put_raw(as_bytes(value));
    }
    static bool read(reader& in, text& value) {
        std::size_t size = 0;
        if (!in.take_count(size, 1, 1, "bytes")) [[unlikely]]
            return false;
        if (size == 0) {
            value.clear();
        } else {
            value.assign(reinterpret_cast<const char*>(in.take(size)), size);
        }
        return true;
    }
    static type_description describe() { return describe_scalar(type_kind::string); }
};

template <class T, class A>
struct codec<std::vector<T, A>> {
    static constexpr std::size_t min_size = 4;
    static constexpr bool fixed = false;
    static constexpr bool raw = false;
    static constexpr bool is_bits = std::is_same_v<T, bool>;

    static void write(writer to, const std::vector<T, A>& values) {
        to.put_count(values.size());
        if constexpr (codec<T>::raw) {
            to.put_raw(bytes_view(reinterpret_cast<const std::byte*>(values.data()), values.size() * sizeof(T)));
        } else if constexpr (codec<T>::fixed) {
            constexpr std::size_t step = codec<T>::min_size;
            std::byte* at = to.out().grow(values.size() * step);
            for (const auto& value : values) {
                codec<T>::put(at, value);
                at += step;
            }
        } else {
            for (const auto& value : values) to(value);
        }
    }
    static bool read(reader& in, std::vector<T, A>& values) {
        std::size_t count = 0;
        if (!in.take_count(count, codec<T>::min_size, sizeof(T))) [[unlikely]]
            return false;
        if constexpr (codec<T>::raw) {
            assign_raw(values, in.take(count * sizeof(T)), count);
        } else if constexpr (is_bits) {
            values.resize(count);
            for (std::size_t i = 0; i < count; ++i) {
                bool value = false;
                if (!in(value)) [[unlikely]]
                    return in.in_element(i);
                values[i] = value;
            }
        } else {
            values.resize(count); // elements that are there already keep their own memory
            for (std::size_t i = 0; i < count; ++i)
                if (!in(values[i])) [[unlikely]]
                    return in.in_element(i);
        }
        return true;
    }
    static type_description describe() { return describe_parts(type_kind::vector, {&codec<T>::describe}); }
};

template <class T>
struct codec<std::optional<T>> {
    static constexpr std::size_t min_size = 1;
    static constexpr bool fixed = false;
    static constexpr bool raw = false;

    static void write(writer to, const std::optional<T>& value) {
        to(value.has_value());
        if (value) to(*value);
    }
    static bool read(reader& in, std::optional<T>& value) {
        const std::byte* flag = in.take(1);
        if (!flag) [[unlikely]]
            return in.fail_short(1);
        if (*flag == std::byte{0}) {
            value.reset();
            return true;
        }
        if (*flag != std::byte{1}) [[unlikely]]
            return in.fail_flag("the flag of an optional", std::to_integer<unsigned>(*flag));
        return in(value ? *value : value.emplace());
    }
    static type_description describe() { return describe_parts(type_kind::optional, {&codec<T>::describe}); }
};

template <class... T>
struct codec<std::variant<T...>> {
    using index = std::conditional_t<(sizeof...(T) > 255), std::uint16_t, std::uint8_t>;
    static constexpr std::size_t min_size = sizeof(index) + std::min({codec<T>::min_size...});
    static constexpr bool fixed = false;
    static constexpr bool raw = false;

    static void write(writer to, const std::variant<T...>& value) {
        if (value.valueless_by_exception()) [[unlikely]]
            writer::fail_valueless();
        to(static_cast<index>(value.index()));
        std::visit([to](const auto& held) { to(held); }, value);
    }
    static bool read(reader& in, std::variant<T...>& value) {
        const std::byte* raw_index = in.take(sizeof(index));
        if (!raw_index) [[unlikely]]
            return in.fail_short(sizeof(index));
        std::size_t which = load_little<index>(raw_index);
        if (which >= sizeof...(T)) [[unlikely]]
            return in.fail_alternative(which, sizeof...(T));
        return read_alternative(in, value, which, std::index_sequence_for<T...>()) || in.in_alternative(which);
    }
    static type_description describe() { return describe_parts(type_kind::variant, {&codec<T>::describe...}); }

private:
    template <std::size_t... I>
    static bool read_alternative(reader& in, std::variant<T...>& value, std::size_t which, std::index_sequence<I...>) {
        bool done = false;
        auto one = [&]<std::size_t i>(std::integral_constant<std::size_t, i>) {
            if (which != i) return false;
            done = in(value.index() == i ? *std::get_if<i>(&value) : value.template emplace<i>());
            return true;
        };
        (void)(one(std::integral_constant<std::size_t, I>()) || ...);
        return done;
    }
};

// --- maps and sets ------------------------------------------------------------------------------------------------
/// Puts encoded elements into the order of their encoded keys, so that equal values have equal bytes.
class element_sorter {
public:
    explicit element_sorter(buffer& out) noexcept : out_(out), start_(out.size()) {}
    void begin_element();
    void end_key();
    void sort();

private:
    struct element {
        std::size_t begin, key_end, end;
    };
    buffer& out_;
    std::size_t start_;
    std::vector<element> elements_;
};

/// Whether many keys share the bucket of this one, as a sender may have chosen: each further one would cost as much as
/// all of them.
template <class Container, class K>
bool is_crowded(const Container& in, const K& key) {
    constexpr std::size_t small = 1024, most = 64;
    if constexpr (requires { in.bucket_size(in.bucket(key)); })
        return in.size() > small && in.bucket_size(in.bucket(key)) > most;
    else return false;
}

template <class Set, class K>
struct set_codec {
    static constexpr std::size_t min_size = 4;
    static constexpr bool fixed = false;
    static constexpr bool raw = false;
    static constexpr bool sorts = requires { typename Set::hasher; };

    static void write(writer to, const Set& keys) {
        to.put_count(keys.size());
        element_sorter sorter(to.out());
        for (const K& key : keys) {
            if constexpr (sorts) sorter.begin_element();
            to(key);
            if constexpr (sorts) sorter.end_key();
        }
        if constexpr (sorts) sorter.sort();
    }
    static bool read(reader& in, Set& keys) {
        std::size_t count = 0;
        if (!in.take_count(count, codec<K>::min_size, sizeof(K) + 4 * sizeof(void*))) [[unlikely]]
            return false;
        keys.clear();
        for (std::size_t i = 0; i < count; ++i) {
            K key{};
            if (!in(key)) [[unlikely]]
                return in.in_element(i);
            [[maybe_unused]] auto at = keys.emplace_hint(keys.end(), std::move(key));
            if (keys.size() == i) [[unlikely]]
                return in.fail("is there twice"), in.in_element(i);
            if constexpr (sorts)
                if (is_crowded(keys, *at)) [[unlikely]]
                    return in.fail("has too many keys with the same hash", errc::too_large), in.in_element(i);
        }
        return true;
    }
    static type_description describe() { return describe_parts(type_kind::set, {&codec<K>::describe}); }
};
template <standard_set Set>
struct codec<Set> : set_codec<Set, typename Set::key_type> {};

template <class Map, class K, class V>
struct map_codec {
    static constexpr std::size_t min_size = 4;
    static constexpr bool fixed = false;
    static constexpr bool raw = false;
    static constexpr bool sorts = requires { typename Map::hasher; };

    static void write(writer to, const Map& values) {
        to.put_count(values.size());
        element_sorter sorter(to.out());
        for (const auto& [key, value] : values) {
            if constexpr (sorts) sorter.begin_element();
            to(key);
            if constexpr (sorts) sorter.end_key();
            to(value);
        }
        if constexpr (sorts) sorter.sort();
    }
    static bool read(reader& in, Map& values) {
        std::size_t count = 0;
        if (!in.take_count(count, codec<K>::min_size + codec<V>::min_size, sizeof(K) + sizeof(V) + 4 * sizeof(void*)))
            [[unlikely]]
            return false;
        values.clear();
        for (std::size_t i = 0; i < count; ++i) {
            K key{};
            if (!in(key)) [[unlikely]]
                return in.in_field("key"), in.in_element(i);
            auto at = values.emplace_hint(values.end(), std::move(key), V{});
            if (values.size() == i) [[unlikely]]
                return in.fail("is there twice"), in.in_field("key"), in.in_element(i);
            if constexpr (sorts)
                if (is_crowded(values, at->first)) [[unlikely]]
                    return in.fail("has too many keys with the same hash", errc::too_large), in.in_element(i);
            if (!in(at->second)) [[unlikely]]
                return in.in_element(i);
        }
        return true;
    }
    static type_description describe() {
        return describe_parts(type_kind::map, {&codec<K>::describe, &codec<V>::describe});
    }
};
template <standard_map Map>
struct codec<Map> : map_codec<Map, typename Map::key_type, typename Map::mapped_type> {};

} // namespace ise::detail
