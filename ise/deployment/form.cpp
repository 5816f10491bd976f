#include <ise/deployment/form.hpp>

#include <ise/component/nearest.hpp>
#include <ise/core/time_text.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>

namespace ise::deployment {

form& form::key(std::string name, reader read) {
    keys_.emplace_back(std::move(name), std::move(read));
    return *this;
}

form& form::text(std::string name, std::string& into) {
    return key(std::move(name), [this, &into](const entry& one) {
        if (one.what.is == value::kind::text) into = one.what.text;
        else wrong_kind(one, "a text");
    });
}

form& form::texts(std::string name, std::vector<value>& into) {
    return key(std::move(name), [this, &into](const entry& one) {
        auto all = one.what.is == value::kind::array ? one.what.items : std::vector<value>{one.what};
        std::erase_if(all, [](const value& item) { return item.is == value::kind::unknown; });
        for (const auto& item : all)
            if (item.is != value::kind::text) return wrong_kind(one, "a text or an array of texts");
        into = std::move(all);
    });
}

form& form::length(std::string name, duration& into) {
    return key(std::move(name), [this, &into](const entry& one) {
        bool plain = one.what.is == value::kind::text || one.what.is == value::kind::integer ||
                     one.what.is == value::kind::number;
        if (!plain) return wrong_kind(one, "a time such as \"5s\"");
        auto read = parse_duration(one.what.plain());
        if (read) into = *read;
        else wrong(one.what.at, fmt::format("'{}' of {}: {}", one.key, of_, read.error().message()));
    });
}

form& form::count(std::string name, std::uint32_t& into, std::int64_t most) {
    return key(std::move(name), [this, &into, most](const entry& one) {
        if (one.what.is != value::kind::integer) return wrong_kind(one, "an integer");
        if (one.what.integer < 0 || one.what.integer > most)
            return wrong(one.what.at,
                         fmt::format("'{}' of {} is 0 to {}, not {}", one.key, of_, most, one.what.integer));
        into = static_cast<std::uint32_t>(one.what.integer);
    });
}

void form::read(const value& from) const {
    if (from.is != value::kind::table)
        return wrong(from.at, fmt::format("{} is a table, not {}", of_, from.kind_name()));
    for (const auto& one : from.entries) {
        auto known = std::ranges::find(keys_, one.key, &std::pair<std::string, reader>::first);
        if (known != keys_.end()) {
            if (one.what.is == value::kind::unknown) continue;
            known->second(one);
            continue;
        }
        std::vector<std::string> names;
        for (const auto& [name, reads] : keys_) names.push_back(name);
        auto near = nearest(one.key, names);
        auto advice = near.empty() ? fmt::format("there are {}", fmt::join(names, ", "))
                                   : fmt::format("did you mean '{}'?", near.front());
        wrong(one.at, fmt::format("{} has no key '{}'; {}", of_, one.key.substr(0, 200), advice));
    }
}

void form::wrong(const place& at, std::string what) const { problems_.push_back({at, std::move(what)}); }

void form::wrong_kind(const entry& which, std::string_view wanted) const {
    wrong(which.what.at, fmt::format("'{}' of {} is {}, not {}", which.key, of_, wanted, which.what.kind_name()));
}

} // namespace ise::deployment
