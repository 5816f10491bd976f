#include "cpp_header.hpp"

#include <ise/core/little_endian.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/action.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string_view>
#include <utility>

namespace ise::cli {
namespace {

// Why a service is left out of the header.
struct not_declared {
    std::string why;
};

constexpr std::array cpp_words{
    "alignas",     "alignof",  "and",        "and_eq",    "asm",       "auto",         "bitand",
    "bitor",       "bool",     "break",      "case",      "catch",     "char",         "char16_t",
    "char32_t",    "char8_t",  "class",      "co_await",  "co_return", "co_yield",     "compl",
    "concept",     "const",    "const_cast", "consteval", "constexpr", "constinit",    "continue",
    "decltype",    "default",  "delete",     "do",        "double",    "dynamic_cast", "else",
    "enum",        "explicit", "export",     "extern",    "false",     "float",        "for",
    "friend",      "goto",     "if",         "inline",    "int",       "long",         "mutable",
    "namespace",   "new",      "noexcept",   "not",       "not_eq",    "nullptr",      "operator",
    "or",          "or_eq",    "private",    "protected", "public",    "register",     "reinterpret_cast",
    "requires",    "return",   "short",      "signed",    "sizeof",    "static",       "static_assert",
    "static_cast", "struct",   "switch",     "template",  "this",      "thread_local", "throw",
    "true",        "try",      "typedef",    "typeid",    "typename",  "union",        "unsigned",
    "using",       "virtual",  "void",       "volatile",  "wchar_t",   "while",        "xor",
    "xor_eq"};

bool is_word(std::string_view name) { return std::ranges::find(cpp_words, name) != cpp_words.end(); }

// A name of C++ that is near.
std::string identifier(std::string_view from) {
    std::string made;
    for (char letter : from) {
        const auto raw = static_cast<unsigned char>(letter);
        made += std::isalnum(raw) || raw >= 0x80 ? letter : '_';
    }
    if (made.empty() || std::isdigit(static_cast<unsigned char>(made.front()))) made.insert(0, "_");
    if (is_word(made)) made += '_';
    return made;
}

std::string scalar_name(type_kind kind) {
    switch (kind) {
        case type_kind::boolean: return "bool";
        case type_kind::character: return "char";
        case type_kind::byte: return "std::byte";
        case type_kind::i8: return "std::int8_t";
        case type_kind::u8: return "std::uint8_t";
        case type_kind::i16: return "std::int16_t";
        case type_kind::u16: return "std::uint16_t";
        case type_kind::i32: return "std::int32_t";
        case type_kind::u32: return "std::uint32_t";
        case type_kind::i64: return "std::int64_t";
        case type_kind::u64: return "std::uint64_t";
        case type_kind::f32: return "float";
        default: return "double";
    }
}

class declarations {
public:
    /// The name of a packet's type; declares it.
    std::string packet(const schema& of, const std::string& otherwise) {
        if (of.type().members.empty()) return "ise::nothing";
        return type_of(of.type(), otherwise);
    }
    const std::string& text() const { return text_; }

    /// As it was before a service that cannot be declared.
    struct point {
        std::string text;
        std::map<std::string, std::string> known;
        std::set<std::string> names;
    };
    point here() const { return {text_, known_, names_}; }
    void back_to(point where) {
        text_ = std::move(where.text);
        known_ = std::move(where.known);
        names_ = std::move(where.names);
    }

    std::string free_name(const std::string& wanted) {
        auto name = identifier(wanted);
        for (int number = 2; !names_.insert(name).second; ++number)
            name = fmt::format("{}_{}", identifier(wanted), number);
        return name;
    }

private:
    std::string type_of(const type_description& of, const std::string& otherwise) {
        auto inner = [&](std::size_t place) { return type_of(of.members[place].type, otherwise + "_part"); };
        switch (of.kind) {
            case type_kind::string: return "std::string";
            case type_kind::vector: return fmt::format("std::vector<{}>", inner(0));
            case type_kind::set: check_key(of.members[0].type); return fmt::format("std::set<{}>", inner(0));
            case type_kind::map:
                check_key(of.members[0].type);
                return fmt::format("std::map<{}, {}>", inner(0), inner(1));
            case type_kind::array: return fmt::format("std::array<{}, {}>", inner(0), of.length);
            case type_kind::optional: return fmt::format("std::optional<{}>", inner(0));
            case type_kind::variant:
            case type_kind::tuple: {
                std::string all;
                for (std::size_t i = 0; i < of.members.size(); ++i) all += (i == 0 ? "" : ", ") + inner(i);
                return fmt::format("std::{}<{}>", of.kind == type_kind::variant ? "variant" : "tuple", all);
            }
            case type_kind::time_span: return span_of(of);
            case type_kind::instant: return fmt::format("std::chrono::sys_time<{}>", span_of(of));
            case type_kind::enumeration: return enumeration(of, otherwise);
            case type_kind::structure: return structure(of, otherwise);
            case type_kind::opaque:
                throw not_declared{fmt::format("the class '{}' has its own functions: its header is needed", of.name)};
            default: return scalar_name(of.kind);
        }
    }

    // A std::map needs an order of its keys.
    static void check_key(const type_description& of) {
        if (is_scalar(of.kind) || of.kind == type_kind::string || of.kind == type_kind::enumeration ||
            of.kind == type_kind::time_span || of.kind == type_kind::instant)
            return;
        throw not_declared{fmt::format("the keys of a map or set are {}", short_text(of))};
    }

    static std::string span_of(const type_description& of) {
        return fmt::format("std::chrono::duration<{}, std::ratio<{}, {}>>", scalar_name(of.number), of.period_num,
                           of.period_den);
    }

    static const std::string& checked(const std::string& name) {
        if (is_word(name)) throw not_declared{fmt::format("'{}' is a word of C++", name)};
        return name;
    }

    std::string enumeration(const type_description& of, const std::string& otherwise) {
        std::string body;
        for (const auto& one : of.enumerators)
            body += fmt::format("{}{} = {}", body.empty() ? " " : ", ", checked(one.name), one.value);
        return declare(of, otherwise,
                       fmt::format(" : {} {{{}{}}};\n", scalar_name(of.number), body, body.empty() ? "" : " "),
                       "enum class ");
    }

    std::string structure(const type_description& of, const std::string& otherwise) {
        std::string body = " {\n";
        for (const auto& member : of.members) {
            auto type = type_of(member.type, otherwise + "_" + member.name);
            body += fmt::format("    {} {}{};\n", type, checked(member.name), initial_value(member, type));
        }
        return declare(of, otherwise, body + "};\n", "struct ");
    }

    // Fields that are compared (numbers, texts, enums, lengths of time) have their defaults.
    std::string initial_value(const type_member& of, const std::string& type) {
        auto natural = [&]() -> std::string {
            if (is_scalar(of.type.kind) || of.type.kind == type_kind::enumeration ||
                of.type.kind == type_kind::time_span || of.type.kind == type_kind::instant ||
                of.type.kind == type_kind::array)
                return "{}";
            return {};
        };
        if (!of.preset) return natural();
        const dynamic_packet holder(schema(wrapped(of)), *of.preset);
        const auto value = holder.field(of.name);
        switch (of.type.kind) {
            case type_kind::boolean: return value.as_bool() ? " = true" : " = false";
            case type_kind::string: return " = " + quoted(value.as_string());
            case type_kind::f32:
            case type_kind::f64: return real(value.as_double(), type);
            case type_kind::enumeration: {
                for (const auto& one : of.type.enumerators)
                    if (one.value == value.as_int()) return fmt::format(" = {}::{}", type, one.name);
                return fmt::format(" = static_cast<{}>({})", type, value.as_int());
            }
            case type_kind::time_span:
                return of.type.number == type_kind::i64 ? fmt::format("{{{}}}", value.as_int()) : std::string("{}");
            default: break;
        }
        if (of.type.kind == type_kind::u64) return fmt::format(" = {}u", value.as_uint());
        if (of.type.kind == type_kind::i64 && value.as_int() == std::numeric_limits<std::int64_t>::min())
            return " = std::numeric_limits<std::int64_t>::min()";
        if (of.type.kind == type_kind::byte) return fmt::format("{{{}}}", value.as_uint());
        if (is_scalar(of.type.kind)) return fmt::format(" = {}", value.as_int());
        return natural() + fmt::format("; // by default {}", comment(value.to_json()));
    }

    static type_description wrapped(const type_member& of) {
        type_description made;
        made.kind = type_kind::structure;
        made.members.push_back({of.name, of.type, std::nullopt});
        made.complete();
        return made;
    }

    static std::string real(double value, const std::string& type) {
        if (std::isnan(value)) return fmt::format(" = std::numeric_limits<{}>::quiet_NaN()", type);
        if (std::isinf(value))
            return fmt::format(" = {}std::numeric_limits<{}>::infinity()", value < 0 ? "-" : "", type);
        auto text = type == "float" ? fmt::format("{}", static_cast<float>(value)) : fmt::format("{}", value);
        if (text.find_first_of(".e") == text.npos) text += ".0";
        return " = " + text + (type == "float" ? "f" : "");
    }

    static std::string quoted(const std::string& text) {
        std::string made = "\"";
        for (char letter : text) {
            const auto raw = static_cast<unsigned char>(letter);
            if (letter == '"' || letter == '\\' || letter == '?') made += fmt::format("\\{}", letter);
            else if (raw < 0x20 || raw == 0x7f) made += fmt::format("\\{:03o}", raw);
            else made += letter;
        }
        return made + "\"";
    }

    static std::string comment(std::string text) {
        constexpr std::size_t longest = 60;
        if (text.size() > longest) text = text.substr(0, longest) + "...";
        std::erase_if(text, [](unsigned char letter) { return letter < 0x20 || letter == '\\'; });
        return text;
    }

    std::string declare(const type_description& of, const std::string& otherwise, const std::string& body,
                        const std::string& head) {
        const auto key = schema(of.kind == type_kind::structure ? of : wrapped({"x", of, std::nullopt})).text();
        if (auto found = known_.find(key); found != known_.end()) return found->second;
        auto name = free_name(of.name.empty() ? otherwise : of.name);
        known_.emplace(key, name);
        text_ += head + name + body;
        return name;
    }

    std::string text_;
    std::map<std::string, std::string> known_; // by the text of the type
    std::set<std::string> names_;
};

std::string constant_type(declarations& into, const dynamic_contract& service) {
    const auto base = identifier(service.name());
    if (service.kind() == service_kind::request_response) {
        auto request = into.packet(service.packet(role::request), base + "_request");
        auto response = into.packet(service.packet(role::response), base + "_response");
        return fmt::format("ise::request_response<{}, {}>", request, response);
    }
    if (is_action(*service.types())) {
        auto types = schemas_of_action(*service.types());
        auto goal = into.packet(types.goal, base + "_goal");
        auto feedback = into.packet(types.feedback, base + "_feedback");
        auto made = into.packet(types.result, base + "_result");
        return fmt::format("ise::action<{}, {}, {}>", goal, feedback, made);
    }
    std::vector<std::string> names;
    constexpr std::array order{role::published, role::subscribe_request, role::subscribe_response,
                               role::unsubscribe_request, role::unsubscribe_response};
    for (auto place : order) {
        auto suffix = std::string(role::name(service.kind(), place));
        names.push_back(into.packet(service.packet(place), base + "_" + identifier(suffix)));
    }
    while (names.size() > 1 && names.back() == "ise::nothing") names.pop_back();
    std::string all;
    for (const auto& name : names) all += (all.empty() ? "" : ", ") + name;
    return fmt::format("ise::subscription<{}>", all);
}

std::string namespace_of(const std::string& path) {
    std::string made;
    for (std::size_t at = 0; at <= path.size();) {
        const auto end = std::min(path.find('/', at), path.size());
        made += (made.empty() ? "" : "::") + identifier(path.substr(at, end - at));
        at = end + 1;
    }
    return made;
}

} // namespace

std::string cpp_header(const std::vector<header_part>& parts) {
    std::string text = "// Made by `ise types --cpp` from running components.\n"
                       "#pragma once\n"
                       "#include <ise/service/action.hpp>\n"
                       "#include <ise/session/contract.hpp>\n\n";
    for (const char* name : {"array", "chrono", "cstddef", "cstdint", "limits", "map", "optional", "ratio", "set",
                             "string", "tuple", "variant", "vector"})
        text += fmt::format("#include <{}>\n", name);
    for (const auto& part : parts) {
        declarations types;
        std::string constants, left_out;
        for (const auto& service : part.services) {
            auto before = types.here();
            try {
                auto type = constant_type(types, service);
                auto name = types.free_name(service.name());
                constants += fmt::format("inline constexpr {} {}{{\"{}\"}};\n", type, name, service.name());
            } catch (const not_declared& missing) {
                types.back_to(std::move(before));
                left_out += fmt::format("// '{}' is left out: {}.\n", service.name(), missing.why);
            }
        }
        const auto name = namespace_of(part.component);
        text += fmt::format("\nnamespace {} {{\n\n{}{}{}{}\n}} // namespace {}\n", name, types.text(),
                            types.text().empty() ? "" : "\n", constants, left_out, name);
    }
    return text;
}

} // namespace ise::cli
