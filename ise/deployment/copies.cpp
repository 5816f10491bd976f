#include <ise/deployment/copies.hpp>

#include <fmt/format.h>

#include <string>
#include <string_view>

namespace ise::deployment {
namespace {

constexpr std::string_view mark_begin = "{n";

/// Where a mark begins: {n}, {nn}, {nnn}…, with a letter for each digit that there is at least.
std::size_t find_mark(std::string_view text, std::size_t from) {
    for (; (from = text.find(mark_begin, from)) != text.npos; ++from) {
        auto end = text.find_first_not_of('n', from + 1);
        if (end != text.npos && text[end] == '}') return from;
    }
    return text.npos;
}

void put_in(std::string& text, std::int64_t number) {
    for (std::size_t at = 0; (at = find_mark(text, at)) != std::string::npos;) {
        auto length = text.find('}', at) + 1 - at;
        auto digits = fmt::format("{:0{}}", number, length - 2);
        text.replace(at, length, digits);
        at += digits.size();
    }
}

void put_in(value& into, std::int64_t number) {
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
        if (find_mark(one.key, 0) == std::string::npos) {
            problems.push_back({one.at, fmt::format("component '{}' has copies of one name: write {{n}} for the number",
                                                    one.key.substr(0, 200))});
            continue;
        }
        auto numbers = std::pair(first->integer, last->integer);
        std::erase_if(one.what.entries, [](const entry& key) { return key.key == "copies"; });
        for (auto number = numbers.first; number <= numbers.second; ++number) {
            auto copy = one;
            put_in(copy.key, number);
            put_in(copy.what, number);
            made.push_back(std::move(copy));
        }
    }
    components->what.entries = std::move(made);
}

} // namespace ise::deployment
