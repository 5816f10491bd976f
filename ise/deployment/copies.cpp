#include <ise/deployment/copies.hpp>

#include <fmt/format.h>

#include <string>
#include <string_view>

namespace ise::deployment {
namespace {

constexpr std::string_view mark = "{n}";

void put_in(std::string& text, const std::string& number) {
    for (std::size_t at = 0; (at = text.find(mark, at)) != std::string::npos; at += number.size())
        text.replace(at, mark.size(), number);
}

void put_in(value& into, const std::string& number) {
    if (into.is == value::kind::text) put_in(into.text, number);
    for (auto& one : into.items) put_in(one, number);
    for (auto& one : into.entries) put_in(one.what, number);
}

const value* integer_of(const entry& copies, const char* key) {
    const auto* found = copies.what.find(key);
    return found && found->what.is == value::kind::integer ? &found->what : nullptr;
}

} // namespace

void make_copies(value& root, std::vector<problem>& problems) {
    entry* components = nullptr;
    for (auto& one : root.entries)
        if (one.key == "components") components = &one;
    if (!components) return;
    std::vector<entry> made;
    for (auto& one : components->what.entries) {
        const auto* copies = one.what.find("copies");
        if (!copies) {
            made.push_back(std::move(one));
            continue;
        }
        auto of = fmt::format("'copies' of component '{}'", one.key.substr(0, 200));
        const auto *first = integer_of(*copies, "first"), *last = integer_of(*copies, "last");
        if (!first || !last || copies->what.entries.size() != 2) {
            problems.push_back({copies->at, of + " is a table of two whole numbers: { first = 2, last = 5 }"});
            continue;
        }
        if (first->integer < 0 || last->integer >= first->integer + static_cast<std::int64_t>(max_components)) {
            problems.push_back(
                {copies->at, fmt::format("{} are numbers from 0 on, and at most {} of them, not {} to {}", of,
                                         max_components, first->integer, last->integer)});
            continue;
        }
        if (one.key.find(mark) == std::string::npos) {
            problems.push_back({one.at, fmt::format("component '{}' has copies of one name: write {{n}} for the number",
                                                    one.key.substr(0, 200))});
            continue;
        }
        auto numbers = std::pair(first->integer, last->integer);
        std::erase_if(one.what.entries, [](const entry& key) { return key.key == "copies"; });
        for (auto number = numbers.first; number <= numbers.second; ++number) {
            auto copy = one;
            put_in(copy.key, std::to_string(number));
            put_in(copy.what, std::to_string(number));
            made.push_back(std::move(copy));
        }
    }
    components->what.entries = std::move(made);
}

} // namespace ise::deployment
