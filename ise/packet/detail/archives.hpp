#pragma once
#include <ise/packet/concept.hpp>
#include <ise/packet/detail/codec_containers.hpp>

#include <cereal/cereal.hpp>

/// ISE's cereal archives. Users' own `serialize`, `save` and `load` run on them; whatever ISE knows itself (numbers,
/// standard containers, plain structs) is written by its codec, so that the layout is the same on both ways.
namespace ise {

namespace detail {
template <class T>
inline constexpr bool is_wrapper = false; // of cereal: name and value, size tag, …
template <class T>
inline constexpr bool is_wrapper<cereal::NameValuePair<T>> = true;
} // namespace detail

/// Writes to the end of a buffer.
class output_archive : public cereal::OutputArchive<output_archive, cereal::AllowEmptyClassElision> {
    using base = cereal::OutputArchive<output_archive, cereal::AllowEmptyClassElision>;

public:
    explicit output_archive(buffer& out) : base(this), out_(&out) {}

    template <class... T>
    output_archive& operator()(T&&... values) {
        (one(values), ...);
        return *this;
    }
    template <class T>
    output_archive& operator&(T&& value) {
        return one(value), *this;
    }
    template <class T>
    output_archive& operator<<(T&& value) {
        return one(value), *this;
    }

    /// Through the type's own cereal functions, not through ISE's codec.
    template <class T>
    void by_cereal(const T& value) {
        base::operator()(value);
    }
    buffer& out() noexcept { return *out_; }

private:
    template <class T>
    void one(const T& value) {
        if constexpr (detail::is_wrapper<T>) {
            one(value.value);
        } else if constexpr (packet<T>) {
            detail::write(*out_, value);
        } else {
            base::operator()(value);
        }
    }
    buffer* out_;
};

/// Reads bounded input; every length is checked against the bytes that are left.
class input_archive : public cereal::InputArchive<input_archive, cereal::AllowEmptyClassElision> {
    using base = cereal::InputArchive<input_archive, cereal::AllowEmptyClassElision>;

public:
    explicit input_archive(detail::reader& in) : base(this), in_(&in) {}

    template <class... T>
    input_archive& operator()(T&&... values) {
        (one(values), ...);
        return *this;
    }
    template <class T>
    input_archive& operator&(T&& value) {
        return one(value), *this;
    }
    template <class T>
    input_archive& operator>>(T&& value) {
        return one(value), *this;
    }

    template <class T>
    void by_cereal(T& value) {
        base::operator()(value);
    }
    detail::reader& in() noexcept { return *in_; }

    /// cereal's functions know no failure but an exception; `detail::codec` catches it.
    struct stopped {};

private:
    template <class T>
    void one(T& value) {
        if constexpr (detail::is_wrapper<T>) {
            one(value.value);
        } else if constexpr (packet<T>) {
            if (!detail::read(*in_, value)) throw stopped{};
        } else {
            if (!in_->enter()) throw stopped{};
            base::operator()(value);
            in_->leave();
        }
    }
    detail::reader* in_;
};

// What cereal's own functions hand down.
template <detail::number T>
void CEREAL_SAVE_FUNCTION_NAME(output_archive& archive, const T& value) {
    detail::write(archive.out(), value);
}
template <detail::number T>
void CEREAL_LOAD_FUNCTION_NAME(input_archive& archive, T& value) {
    if (!detail::read(archive.in(), value)) throw input_archive::stopped{};
}
template <class T>
void CEREAL_SAVE_FUNCTION_NAME(output_archive& archive, const cereal::NameValuePair<T>& pair) {
    archive(pair.value);
}
template <class T>
void CEREAL_LOAD_FUNCTION_NAME(input_archive& archive, cereal::NameValuePair<T>& pair) {
    archive(pair.value);
}
template <class T>
void CEREAL_SAVE_FUNCTION_NAME(output_archive& archive, const cereal::SizeTag<T>& tag) {
    detail::write_count(archive.out(), static_cast<std::size_t>(tag.size));
}
template <class T>
void CEREAL_LOAD_FUNCTION_NAME(input_archive& archive, cereal::SizeTag<T>& tag) {
    std::size_t count = 0; // cereal reserves what the tag says: an element is taken to cost a byte, and 64 of memory
    if (!archive.in().take_count(count, 1, 64)) throw input_archive::stopped{};
    tag.size = static_cast<std::remove_reference_t<T>>(count);
}
template <class T>
void CEREAL_SAVE_FUNCTION_NAME(output_archive& archive, const cereal::BinaryData<T>& raw) {
    archive.out().append(bytes_view(static_cast<const std::byte*>(static_cast<const void*>(raw.data)),
                                    static_cast<std::size_t>(raw.size)));
}
template <class T>
void CEREAL_LOAD_FUNCTION_NAME(input_archive& archive, cereal::BinaryData<T>& raw) {
    const std::byte* from = archive.in().take(static_cast<std::size_t>(raw.size));
    if (!from && raw.size != 0) {
        archive.in().fail_short(static_cast<std::size_t>(raw.size));
        throw input_archive::stopped{};
    }
    if (raw.size != 0) std::memcpy(static_cast<void*>(raw.data), from, static_cast<std::size_t>(raw.size));
}

} // namespace ise

CEREAL_REGISTER_ARCHIVE(ise::output_archive)
CEREAL_REGISTER_ARCHIVE(ise::input_archive)
CEREAL_SETUP_ARCHIVE_TRAITS(ise::input_archive, ise::output_archive)

namespace cereal {

/// Plain structs on any cereal archive, field by field with their names.
template <class Archive, ise::detail::reflected T>
requires ise::packet<T>
void CEREAL_SERIALIZE_FUNCTION_NAME(Archive& archive, T& value) {
    ise::for_each_field(value, [&archive](std::string_view name, auto& field) {
        archive(cereal::make_nvp(std::string(name).c_str(), field));
    });
}

} // namespace cereal
