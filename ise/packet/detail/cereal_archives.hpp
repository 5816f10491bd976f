#pragma once
#include <ise/packet/bounded.hpp>
#include <ise/packet/concept.hpp>
#include <ise/packet/detail/codec_containers.hpp>

#include <cereal/cereal.hpp>

#include <cstring>
#include <optional>
#include <utility>

/// ISE's wire archive as a pair of cereal archives. Users' own `serialize`, `save` and `load` run on them; packets pass
/// through to the codec, so that the layout is the same on both ways.
namespace ise {

namespace detail {
template <class T>
inline constexpr bool is_wrapper = false; // of cereal: name and value, size tag, …
template <class T>
inline constexpr bool is_wrapper<cereal::NameValuePair<T>> = true;

inline constexpr decode_limits default_limits;
} // namespace detail

/// Appends what it is given to a buffer, as LAYOUT.md defines: of a packet, the bytes of `encode`.
class output_archive : public cereal::OutputArchive<output_archive, cereal::AllowEmptyClassElision> {
    using base = cereal::OutputArchive<output_archive, cereal::AllowEmptyClassElision>;

public:
    /// The buffer must live as long as the archive.
    explicit output_archive(buffer& out) : base(this), to_(out) {}

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
    detail::writer to() const noexcept { return to_; }

private:
    template <class T>
    void one(const T& value) {
        if constexpr (detail::is_wrapper<T>) {
            one(value.value);
        } else if constexpr (packet<T>) {
            to_(value);
        } else {
            base::operator()(value);
        }
    }
    detail::writer to_;
};

/// Reads what `output_archive` wrote. Every length is checked against the bytes that are left, and memory and depth are
/// limited, as in `decode`. Throws `malformed` or `too_large` with type and field; the value is then unspecified.
class input_archive : public cereal::InputArchive<input_archive, cereal::AllowEmptyClassElision> {
    using base = cereal::InputArchive<input_archive, cereal::AllowEmptyClassElision>;

public:
    /// Input and limits must live as long as the archive. Bytes that are left over are the caller's affair.
    explicit input_archive(bytes_view input, const decode_limits& limits = detail::default_limits)
        : base(this), own_(std::in_place, input, limits), in_(&*own_) {}
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

    /// cereal's functions know no failure but an exception.
    template <class T>
    void check(bool done) {
        if (!done) throw error(in_->take_failure(type_name<T>));
    }

private:
    template <class T>
    void one(T& value) {
        if constexpr (detail::is_wrapper<T>) {
            one(value.value);
        } else if constexpr (packet<T>) {
            if constexpr (detail::number<T>) value = {}; // g++ 12 fears that it may stay unset without an exception
            check<T>((*in_)(value));
        } else {
            check<T>(in_->enter());
            base::operator()(value);
            in_->leave();
        }
    }
    std::optional<detail::reader> own_;
    detail::reader* in_;
};

// What cereal's own functions hand down.
template <detail::number T>
void CEREAL_SAVE_FUNCTION_NAME(output_archive& archive, const T& value) {
    archive(value);
}
template <detail::number T>
void CEREAL_LOAD_FUNCTION_NAME(input_archive& archive, T& value) {
    archive(value);
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
    archive.to().put_count(static_cast<std::size_t>(tag.size));
}
template <class T>
void CEREAL_LOAD_FUNCTION_NAME(input_archive& archive, cereal::SizeTag<T>& tag) {
    std::size_t count = 0; // cereal reserves what the tag says: an element is taken to cost a byte, and 64 of memory
    archive.check<T>(archive.in().take_count(count, 1, 64));
    tag.size = static_cast<std::remove_reference_t<T>>(count);
}
template <class T>
void CEREAL_SAVE_FUNCTION_NAME(output_archive& archive, const cereal::BinaryData<T>& raw) {
    archive.to().put_raw(bytes_view(static_cast<const std::byte*>(static_cast<const void*>(raw.data)),
                                    static_cast<std::size_t>(raw.size)));
}
template <class T>
void CEREAL_LOAD_FUNCTION_NAME(input_archive& archive, cereal::BinaryData<T>& raw) {
    const auto size = static_cast<std::size_t>(raw.size);
    if (size == 0) return;
    const std::byte* from = archive.in().take(size);
    archive.check<T>(from || archive.in().fail_short(size));
    std::memcpy(static_cast<void*>(raw.data), from, size);
}

} // namespace ise

CEREAL_REGISTER_ARCHIVE(ise::output_archive)
CEREAL_REGISTER_ARCHIVE(ise::input_archive)
CEREAL_SETUP_ARCHIVE_TRAITS(ise::input_archive, ise::output_archive)
