#include <ise/deployment/variables.hpp>

#include <ise/component/nearest.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <charconv>
#include <map>
#include <set>

namespace ise::deployment {
namespace {

constexpr std::size_t max_text = 64 << 10;

template <class T>
bool reads(const std::string& text, T& into) {
    auto [end, problem] = std::from_chars(text.data(), text.data() + text.size(), into);
    return problem == std::errc() && end == text.data() + text.size();
}

// As it would have stood in the file.
value typed(const std::string& text) {
    value made;
    made.at = {"--set", 0, 0};
    made.text = text;
    if (reads(text, made.integer)) made.is = value::kind::integer;
    else if (reads(text, made.number)) made.is = value::kind::number;
    else if (text == "true" || text == "false") made.is = value::kind::boolean, made.boolean = text == "true";
    else made.is = value::kind::text;
    return made;
}

class filler {
public:
    filler(std::map<std::string, value> known, std::vector<problem>& problems)
        : known_(std::move(known)), problems_(problems) {}

    void fill(value& into) {
        if (into.is == value::kind::text) into = filled(into);
        for (auto& one : into.items) fill(one);
        for (auto& one : into.entries) fill(one.what);
    }

private:
    value filled(const value& from) {
        auto made = from;
        made.text.clear();
        const auto& text = from.text;
        for (std::size_t at = 0; at < text.size();) {
            if (text[at] != '$' || at + 1 == text.size() || (text[at + 1] != '{' && text[at + 1] != '$')) {
                made.text += text[at++];
            } else if (text[at + 1] == '$') {
                made.text += '$';
                at += 2;
            } else {
                auto end = text.find('}', at);
                if (end == text.npos) {
                    problems_.push_back({from.at, "a '${' has no '}': write $$ for a dollar sign"});
                    return unknown(from.at);
                }
                auto with = look_up(text.substr(at + 2, end - at - 2), from.at);
                if (with.is == value::kind::unknown) return unknown(from.at);
                if (at == 0 && end + 1 == text.size()) {
                    with.at = from.at;
                    return with;
                }
                made.text += with.plain();
                at = end + 1;
            }
            if (made.text.size() > max_text) {
                problems_.push_back(
                    {from.at, fmt::format("with its variables the text has more than {} bytes", max_text)});
                return unknown(from.at);
            }
        }
        return made;
    }

    static value unknown(const place& at) {
        value made;
        made.at = at;
        made.is = value::kind::unknown;
        return made;
    }

    value look_up(const std::string& name, const place& at) {
        auto found = known_.find(name);
        if (found == known_.end()) {
            std::vector<std::string> names;
            for (const auto& [key, what] : known_) names.push_back(key);
            auto near = nearest(name, names);
            problems_.push_back(
                {at, fmt::format("there is no variable '{}'{}", name,
                                 near.empty() ? "" : fmt::format("; did you mean '{}'?", near.front()))});
            return unknown(at);
        }
        if (std::ranges::find(open_, name) != open_.end()) {
            auto circle = open_;
            circle.push_back(name);
            problems_.push_back({at, fmt::format("variables are made of each other: {}", fmt::join(circle, " of "))});
            return unknown(at);
        }
        if (found->second.is != value::kind::text || !done_.insert(name).second) return found->second;
        open_.push_back(name);
        found->second = filled(found->second); // once: variables of variables of variables are many
        open_.pop_back();
        return found->second;
    }

    std::map<std::string, value> known_;
    std::vector<problem>& problems_;
    std::vector<std::string> open_;
    std::set<std::string> done_; // of the known ones
};

} // namespace

void put_variables_in(value& into, const settings& given, std::vector<problem>& problems) {
    std::map<std::string, value> known;
    if (const auto* table = into.find("variables")) {
        if (table->what.is != value::kind::table)
            problems.push_back({table->at, fmt::format("'variables' is a table, not {}", table->what.kind_name())});
        for (const auto& one : table->what.entries) {
            bool plain = one.what.is != value::kind::table && one.what.is != value::kind::array;
            if (!plain)
                problems.push_back({one.at, fmt::format("the variable '{}' is a text, a number, true or false, not {}",
                                                        one.key, one.what.kind_name())});
            else known[one.key] = one.what;
        }
    }
    std::vector<std::string> names;
    for (const auto& [name, what] : known) names.push_back(name);
    for (const auto& [name, text] : given) {
        auto found = known.find(name);
        if (found != known.end()) {
            found->second = typed(text);
            continue;
        }
        auto near = nearest(name, names);
        auto advice = names.empty()  ? "it has none"
                      : near.empty() ? fmt::format("it has {}", fmt::join(names, ", "))
                                     : fmt::format("did you mean '{}'?", near.front());
        auto& unknown = problems.emplace_back();
        unknown.at.file = "--set";
        unknown.what = fmt::format("the file has no variable '{}'; {}", name, advice);
    }
    std::erase_if(into.entries, [](const entry& one) { return one.key == "variables"; });
    filler(std::move(known), problems).fill(into);
}

} // namespace ise::deployment
