#include <ise/packet/detail/describe.hpp>

#include <ise/packet/detail/natural.hpp>

#include <utility>

namespace ise::detail {

type_description describe_scalar(type_kind kind) { return describe_parts(kind, {}); }

type_description describe_parts(type_kind kind, std::initializer_list<describer> parts) {
    type_description type;
    type.kind = kind;
    for (auto describe : parts) type.members.push_back({{}, describe(), {}});
    type.complete();
    return type;
}

type_description describe_enumeration(std::string_view name, type_kind number, const std::vector<enumerator>& of) {
    type_description type;
    type.kind = type_kind::enumeration;
    // Over char, too, an enum is a number: char alone is text.
    type.number = number == type_kind::character ? type_kind::i8 : number;
    type.name = std::string(name);
    type.enumerators = of;
    type.complete();
    return type;
}

type_description describe_structure(std::string_view name, std::span<const described_field> fields) {
    type_description type;
    type.kind = type_kind::structure;
    type.name = std::string(name);
    buffer preset;
    for (const auto& field : fields) {
        preset.clear();
        field.encode(preset, field.preset);
        add_field(type, field.name, field.describe(), preset.view());
    }
    type.complete();
    return type;
}

void add_field(type_description& into, std::string_view name, type_description type, bytes_view preset) {
    type_member member{std::string(name), std::move(type), {}};
    if (!is_natural(member.type, preset)) member.preset = bytes(preset.begin(), preset.end());
    into.members.push_back(std::move(member));
}

} // namespace ise::detail
