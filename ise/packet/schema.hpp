#pragma once
#include <ise/core/result.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/type.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <string_view>

namespace ise {

/// Limits on the text of a schema, which may come from untrusted sources.
struct schema_limits {
    std::size_t max_text_bytes = std::size_t{256} << 10;       ///< of the text
    std::size_t max_depth = 64;                                ///< of types within types
    std::size_t max_types = 4096;                              ///< types of all fields together, at all depths
    std::size_t max_members = 1024;                            ///< fields of one struct, alternatives of one variant
    std::size_t max_enumerators = 4096;                        ///< of one enum
    std::size_t max_name_bytes = 256;                          ///< of one name
    std::uint64_t max_min_size = std::uint64_t{256} << 20;     ///< minimum encoded size of a value
    std::uint64_t max_array_length = std::uint64_t{256} << 20; ///< of one array, in elements
};

/// The description of a packet type, at any depth. Immutable and shared: copies are cheap, and may be used from any
/// thread.
class schema {
public:
    /// The schema of an empty packet.
    schema();
    /// Throws `invalid_argument` if a name (of an opaque type) is not valid in a text.
    explicit schema(type_description type);

    /// Parses a canonical text, also from untrusted sources. Fails with `malformed` (where, what was expected) or
    /// `too_large`. The fingerprint is always computed from the text.
    static result<schema> parse(std::string_view canonical_text, const schema_limits& limits = {});

    /// 64 bits over fields' names, order and types, enumerators, alternatives: equal with every compiler. Names of
    /// structs and enums and default values are not part of it.
    std::uint64_t fingerprint() const noexcept { return data_->fingerprint; }
    /// The canonical one-line text (LAYOUT.md has its grammar), including defaults.
    const std::string& text() const noexcept { return data_->text; }
    /// For people: indented, one field per line, without defaults.
    std::string pretty() const;
    /// The name of the packet's type, for messages.
    const std::string& name() const noexcept { return data_->name; }
    /// The type as a tree.
    const type_description& type() const noexcept { return data_->type; }

    /// The same text: same fields, names and defaults.
    friend bool operator==(const schema& a, const schema& b) noexcept {
        return a.data_ == b.data_ || a.data_->text == b.data_->text;
    }

private:
    struct data {
        type_description type;
        std::string text;
        std::string name;
        std::uint64_t fingerprint = 0;
    };
    std::shared_ptr<const data> data_;
};

/// The schema of a packet type, made once.
template <class T>
const schema& schema_of() {
    if constexpr (check_packet<T>()) {
        static const schema made(detail::codec<T>::describe());
        return made;
    }
}

/// One type as in a schema's text, shortened for messages.
std::string short_text(const type_description& type);

} // namespace ise
