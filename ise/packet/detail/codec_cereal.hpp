#pragma once
#include <ise/packet/detail/codec_containers.hpp>

#include <limits>

/// Types that only their own cereal functions know. cereal and its archives cost every file a tenth of a second to
/// compile: only those that have such types include them.
namespace ise::detail {

/// `write`, `read`, `describe`; defined by <ise/packet/archive.hpp>.
template <class T>
struct by_cereal;
template <class T>
concept archives_included = requires {
    sizeof(by_cereal<T>);
};

template <own_serialize T>
requires(!opaque<T> && !parts<T>::known) struct codec<T> {
    static_assert(archives_included<T>,
                  "ise: this packet has a serialize of its own: include <ise/packet/archive.hpp> before it is used");
    static constexpr std::size_t min_size = 0; // known at run time only
    static constexpr bool fixed = false;
    static constexpr bool raw = false;

    static void write(writer to, const T& value) { by_cereal<T>::write(to.out(), value); }
    static bool read(reader& in, T& value) { return by_cereal<T>::read(in, value); }
    static type_description describe() { return by_cereal<T>::describe(); }
};

template <opaque T>
struct codec<T> {
    static_assert(archives_included<T>,
                  "ise: this packet has a serialize of its own: include <ise/packet/archive.hpp> before it is used");
    static constexpr std::size_t min_size = 4;
    static constexpr bool fixed = false;
    static constexpr bool raw = false;

    static void write(writer to, const T& value) {
        buffer& out = to.out();
        std::size_t at = out.size();
        out.append(std::uint32_t{0});
        by_cereal<T>::write(out, value);
        std::size_t size = out.size() - at - 4;
        if (size > std::numeric_limits<std::uint32_t>::max()) writer::fail_count(size);
        out.patch_u32(at, static_cast<std::uint32_t>(size));
    }
    static bool read(reader& in, T& value) {
        std::size_t size = 0;
        if (!in.take_count(size, 1, 1, "bytes")) return false;
        std::size_t behind = in.left() - size;
        if (!by_cereal<T>::read(in, value)) return false;
        if (in.left() == behind) return true;
        return in.fail("its serialize reads another number of bytes than was written");
    }
    static type_description describe() {
        type_description type;
        type.kind = type_kind::opaque;
        type.name = std::string(opaque_type<T>::name);
        type.version = opaque_type<T>::version;
        type.complete();
        return type;
    }
};

} // namespace ise::detail
