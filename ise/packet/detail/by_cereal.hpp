#pragma once
#include <ise/packet/detail/cereal_archives.hpp>
#include <ise/packet/detail/codec_cereal.hpp>

/// What `codec` needs of types that only their own cereal functions know.
namespace ise::detail {

/// Writes nothing down but the sequence of the types that a serialize hands over.
class recording_archive : public cereal::OutputArchive<recording_archive, cereal::AllowEmptyClassElision> {
    using base = cereal::OutputArchive<recording_archive, cereal::AllowEmptyClassElision>;

public:
    explicit recording_archive(type_description& into) : base(this), into_(&into) {}

    template <class... T>
    recording_archive& operator()(T&&... values) {
        (one({}, values), ...);
        return *this;
    }
    template <class T>
    recording_archive& operator&(T&& value) {
        return one({}, value), *this;
    }
    template <class T>
    recording_archive& operator<<(T&& value) {
        return one({}, value), *this;
    }

    template <class T>
    void by_cereal(const T& value) {
        base::operator()(value);
    }

    template <class T>
    void one(std::string name, const T& value) {
        if constexpr (is_wrapper<T>) {
            one(value.name, value.value);
        } else if constexpr (packet<T>) {
            if (name.empty()) name = "field_" + std::to_string(into_->members.size());
            buffer preset;
            writer{preset}(value);
            add_field(*into_, name, codec<T>::describe(), preset.view());
        } else {
            static_assert(std::is_base_of_v<cereal::traits::detail::BaseCastBase, T>,
                          "ise: the serialize of this type has no fixed sequence of fields (it hands over a pointer, a "
                          "size or raw bytes): specialise ise::opaque_type for it");
            base::operator()(value);
        }
    }

private:
    type_description* into_;
};

template <number T>
void CEREAL_SAVE_FUNCTION_NAME(recording_archive& archive, const T& value) {
    archive(value);
}
inline void CEREAL_SAVE_FUNCTION_NAME(recording_archive& archive, const std::string& value) { archive(value); }
template <class T>
void CEREAL_SAVE_FUNCTION_NAME(recording_archive& archive, const cereal::NameValuePair<T>& pair) {
    archive.one(pair.name, pair.value);
}

template <class T>
inline void write_by_cereal(buffer& out, const T& value) {
    output_archive archive(out);
    archive.by_cereal(value);
}

template <class T>
inline bool read_by_cereal(reader& in, T& value) {
    if (!in.enter()) return false;
    try {
        // Its own functions may append to what is there: they get a fresh value.
        if constexpr (std::is_move_assignable_v<T> && std::is_default_constructible_v<T>) value = T{};
        input_archive archive(in);
        archive.by_cereal(value);
    } catch (const std::exception&
                 why) { // the reader's (which the reader knows), cereal's, or the type's own opinion of its values
        return in.fail(why.what());
    }
    in.leave();
    return !in.failed(); // its own functions may have swallowed what was wrong
}

template <class T>
struct by_cereal {
    static void write(buffer& out, const T& value) { write_by_cereal(out, value); }
    static bool read(reader& in, T& value) { return read_by_cereal(in, value); }
    static type_description describe() {
        type_description type;
        type.kind = type_kind::structure;
        type.name = std::string(type_name<T>);
        recording_archive archive(type);
        const T sample{};
        archive.by_cereal(sample);
        type.complete();
        return type;
    }
};

} // namespace ise::detail
