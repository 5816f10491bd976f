#include <ise/packet/compatibility.hpp>

#include <ise/packet/detail/schema_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace ise {

namespace {
class comparison {
public:
    void compare(const type_description& reader, const type_description& writer, const std::string& path) {
        if (differences_.size() >= most_) return;
        if (reader.kind != writer.kind) return differ(path, short_text(reader), short_text(writer));
        switch (reader.kind) {
            case type_kind::structure: return compare_fields(reader, writer, path);
            case type_kind::variant: return compare_alternatives(reader, writer, path);
            case type_kind::enumeration: return compare_enumerators(reader, writer, path);
            case type_kind::opaque:
                if (reader.name != writer.name || reader.version != writer.version)
                    differ(path, short_text(reader), short_text(writer));
                return;
            case type_kind::time_span:
            case type_kind::instant:
                if (reader.number != writer.number || reader.period_num != writer.period_num ||
                    reader.period_den != writer.period_den)
                    differ(path, short_text(reader), short_text(writer));
                return;
            case type_kind::tuple:
                if (reader.members.size() != writer.members.size())
                    return differ(path, short_text(reader), short_text(writer));
                for (std::size_t i = 0; i < reader.members.size(); ++i)
                    compare(reader.members[i].type, writer.members[i].type, fmt::format("{}.{}", path, i));
                return;
            case type_kind::array:
                if (reader.length != writer.length) return differ(path, short_text(reader), short_text(writer));
                return compare(reader.members[0].type, writer.members[0].type, path + "[]");
            case type_kind::vector:
            case type_kind::set: return compare(reader.members[0].type, writer.members[0].type, path + "[]");
            case type_kind::optional: return compare(reader.members[0].type, writer.members[0].type, path);
            case type_kind::map:
                compare(reader.members[0].type, writer.members[0].type, path + "[].key");
                return compare(reader.members[1].type, writer.members[1].type, path + "[]");
            default: return; // equal scalars, strings
        }
    }

    std::vector<std::string> take() { return std::move(differences_); }

private:
    void note(const std::string& path, std::string_view text) {
        std::string_view shown = path;
        if (shown.starts_with('.')) shown.remove_prefix(1);
        if (differences_.size() < most_)
            differences_.push_back(fmt::format("{}: {}", shown.empty() ? "packet" : shown, text));
    }
    void differ(const std::string& path, const std::string& reader, const std::string& writer) {
        note(path, fmt::format("reader {}, writer {}", reader, writer));
    }

    void compare_fields(const type_description& reader, const type_description& writer, const std::string& path) {
        std::size_t common = std::min(reader.members.size(), writer.members.size());
        for (std::size_t i = 0; i < common; ++i) {
            const auto& r = reader.members[i];
            const auto& w = writer.members[i];
            if (r.name != w.name) {
                differ(path, fmt::format("has '{}' as field {}", r.name, i + 1),
                       fmt::format("has '{}'{}", w.name, advice(reader, writer, r.name, w.name)));
                return; // what follows is shifted
            }
            compare(r.type, w.type, fmt::format("{}.{}", path, r.name));
        }
    }

    static bool has(const type_description& type, const std::string& name) {
        return std::any_of(type.members.begin(), type.members.end(), [&](const auto& m) { return m.name == name; });
    }
    static std::string_view advice(const type_description& reader, const type_description& writer, const std::string& r,
                                   const std::string& w) {
        bool writer_lacks = !has(writer, r);
        bool reader_lacks = !has(reader, w);
        if (writer_lacks && reader_lacks) return " (renamed? a field keeps its name)";
        if (writer_lacks) return " (inserted at the reader, or removed at the writer: new fields go to the end)";
        if (reader_lacks) return " (inserted at the writer, or removed at the reader: new fields go to the end)";
        return " (fields keep their order)";
    }

    void compare_alternatives(const type_description& reader, const type_description& writer, const std::string& path) {
        // The index grows from one byte to two with the 256th alternative; each schema knows its own.
        std::size_t common = std::min(reader.members.size(), writer.members.size());
        for (std::size_t i = 0; i < common; ++i)
            compare(reader.members[i].type, writer.members[i].type, fmt::format("{}<{}>", path, i));
    }

    void compare_enumerators(const type_description& reader, const type_description& writer, const std::string& path) {
        if (reader.number != writer.number)
            return differ(path, fmt::format("enum over {}", name_of(reader.number)),
                          fmt::format("enum over {}", name_of(writer.number)));
        std::map<std::string_view, std::int64_t> by_name;
        std::map<std::int64_t, std::string_view> by_value;
        for (const auto& e : reader.enumerators) {
            by_name.emplace(e.name, e.value);
            by_value.emplace(e.value, e.name);
        }
        for (const auto& e : writer.enumerators) {
            if (auto same = by_name.find(e.name); same != by_name.end() && same->second != e.value) {
                differ(path, fmt::format("{}={}", e.name, same->second), fmt::format("{}={}", e.name, e.value));
            } else if (auto other = by_value.find(e.value); other != by_value.end() && other->second != e.name) {
                differ(path, fmt::format("{}={}", other->second, e.value), fmt::format("{}={}", e.name, e.value));
            }
        }
    }

    static constexpr std::size_t most_ = 20; // more help nobody
    std::vector<std::string> differences_;
};
} // namespace

std::optional<std::string> incompatibility(const schema& reader, const schema& writer) {
    if (reader == writer) return std::nullopt; // by their texts: a stranger can make one for a given fingerprint
    comparison both;
    both.compare(reader.type(), writer.type(), {});
    auto differences = both.take();
    if (differences.empty()) return std::nullopt;
    std::string text = fmt::format("the reader's {} and the writer's {} differ:", reader.name(), writer.name());
    for (const auto& line : differences) text += "\n  " + line;
    return text;
}

} // namespace ise
