// The file: TOML as headers only and without exceptions, so that what is wrong with a text is a value. The library
// asserts over values that it has made itself of a text that it refused.
#define TOML_HEADER_ONLY 1
#define TOML_EXCEPTIONS 0
#define TOML_ASSERT(condition) static_cast<void>(0)
#include <toml++/toml.h>

#include <ise/access/policy.hpp>
#include <ise/core/toml_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <initializer_list>
#include <limits>

namespace ise::access {
namespace {

std::uint64_t hash_of(std::string_view text) noexcept {
    std::uint64_t hash = 0xcbf29ce484222325;
    for (char one : text) hash = (hash ^ static_cast<unsigned char>(one)) * 0x100000001b3;
    return hash;
}

// The system of `ise://SYSTEM/…`, where it has no wildcard.
std::string system_in(std::string_view identity) {
    constexpr std::string_view scheme = "ise://";
    if (!identity.starts_with(scheme)) return {};
    auto rest = identity.substr(scheme.size());
    auto name = rest.substr(0, rest.find('/'));
    return name.find_first_of("*{}") == name.npos ? std::string(name) : std::string();
}

} // namespace

class policy_reader {
public:
    policy_reader(policy& into, std::vector<remark>& problems) : made_(into), problems_(problems) {}

    void read(const toml::table& all) {
        known_keys(all, {"version", "system", "audit", "groups", "unix", "allow", "deny"});
        const auto* version = all.get("version");
        if (!version) wrong(all, "'version = 1' is missing");
        else if (version->value_exact<std::int64_t>() != 1) wrong(*version, "'version' is 1 here");
        if (const auto* groups = all.get("groups")) read_groups(*groups);
        if (const auto* users = all.get("unix")) read_users(*users);
        for (bool allows : {true, false})
            if (const auto* rules = all.get(allows ? "allow" : "deny")) read_rules(*rules, allows);
        if (const auto* audited = all.get("audit")) made_.audited_ = targets(*audited, "audit");
        if (const auto* system = all.get("system")) {
            const auto* text = system->as_string();
            if (!text || !check_identity("ise://" + text->get() + "/key"))
                wrong(*system, "'system' is the name of the system, such as \"atirma\"");
            else made_.system_ = text->get();
        } else if (std::ranges::all_of(systems_, [&](const auto& one) { return one == systems_.front(); })) {
            if (!systems_.empty()) made_.system_ = systems_.front();
        }
    }

private:
    void wrong(const toml::node& at, std::string text) {
        problems_.push_back({at.source().begin.line, at.source().begin.column, std::move(text)});
    }
    static std::uint32_t line_of(const toml::node& at) noexcept { return at.source().begin.line; }

    void known_keys(const toml::table& in, std::initializer_list<std::string_view> known) {
        for (const auto& [key, value] : in)
            if (std::ranges::find(known, key.str()) == known.end())
                problems_.push_back(
                    {key.source().begin.line, key.source().begin.column,
                     fmt::format("'{}' is not known here; known are {}", key.str(), fmt::join(known, ", "))});
    }

    // A text, or an array of them.
    template <class Take>
    void each_text(const toml::node& from, std::string_view what, Take take) {
        auto one = [&](const toml::node& node) {
            if (const auto* text = node.as_string()) take(node, text->get());
            else wrong(node, fmt::format("'{}' has texts", what));
        };
        if (const auto* array = from.as_array()) {
            for (const auto& node : *array) one(node);
        } else {
            one(from);
        }
    }

    std::optional<pattern> pattern_of(const toml::node& at, std::string_view text) {
        auto parsed = pattern::parse(text);
        if (parsed) return std::move(*parsed);
        wrong(at, parsed.error().message());
        return {};
    }

    // "*" in an identity, "@group", "nobody".
    void add_subject(const toml::node& at, const std::string& text, std::vector<subject>& into, bool in_group) {
        if (text.starts_with('@')) {
            auto found = groups_.find(text.substr(1));
            if (in_group) return wrong(at, "a group holds identities, no other groups");
            if (found == groups_.end()) return wrong(at, fmt::format("there is no group '{}'", text.substr(1)));
            into.insert(into.end(), found->second.begin(), found->second.end());
            return;
        }
        bool known = text == "nobody" || text.starts_with("ise://") || text.starts_with("unix:") ||
                     text.starts_with("*") || text.starts_with("{");
        if (!known)
            return wrong(at,
                         fmt::format("'{}' is not an identity: write it like ise://atirma/web, unix:1001, @group or "
                                     "nobody",
                                     text));
        auto parsed = pattern_of(at, text);
        if (!parsed) return;
        for (const auto& one : parsed->alternatives())
            if (auto system = system_in(one); !system.empty()) systems_.push_back(std::move(system));
        subject made{std::move(*parsed), text == "nobody"};
        into.push_back(std::move(made));
    }

    void read_groups(const toml::node& from) {
        const auto* table = from.as_table();
        if (!table) return wrong(from, "[groups] is a table: operators = [\"ise://atirma/operator/*\"]");
        for (const auto& [key, value] : *table) {
            auto& members = groups_[std::string(key.str())];
            each_text(value, key.str(),
                      [&](const toml::node& at, const std::string& text) { add_subject(at, text, members, true); });
        }
    }

    void read_users(const toml::node& from) {
        const auto* table = from.as_table();
        if (!table) return wrong(from, "[unix] is a table: \"uid:1001\" = \"ise://atirma/shore/web\"");
        for (const auto& [key, value] : *table) {
            std::string_view name = key.str();
            constexpr std::string_view prefix = "uid:";
            std::uint32_t user = 0;
            auto digits = name.starts_with(prefix) ? name.substr(prefix.size()) : std::string_view();
            auto [end, problem] = std::from_chars(digits.data(), digits.data() + digits.size(), user);
            if (digits.empty() || problem != std::errc() || end != digits.data() + digits.size()) {
                problems_.push_back({key.source().begin.line, key.source().begin.column,
                                     fmt::format("'{}' is no user: write it like \"uid:1001\"", name)});
                continue;
            }
            const auto* text = value.as_string();
            auto good = text ? check_identity(text->get())
                             : result<void>(failure(errc::invalid_argument, "an identity is a text"));
            if (!good) {
                wrong(value, good.error().message());
                continue;
            }
            made_.users_[user] = text->get();
            systems_.push_back(system_in(text->get()));
        }
    }

    std::vector<target> targets(const toml::node& from, std::string_view key) {
        std::vector<target> made;
        each_text(from, key, [&](const toml::node& at, const std::string& text) {
            auto colon = text.rfind(':');
            if (colon == text.npos || colon == 0 || colon + 1 == text.size())
                return wrong(at,
                             fmt::format("'{}' is not PATH:{}: write it like atirma/boat:{}", text,
                                         key == "set" ? "PARAMETER" : "SERVICE", key == "set" ? "rate" : "telemetry"));
            auto path = pattern_of(at, std::string_view(text).substr(0, colon));
            auto named = pattern_of(at, std::string_view(text).substr(colon + 1));
            if (path && named) made.push_back({std::move(*path), std::move(*named), line_of(at)});
        });
        return made;
    }

    std::vector<place> places(const toml::node& from, std::string_view what) {
        std::vector<place> made;
        each_text(from, what, [&](const toml::node& at, const std::string& text) {
            if (auto path = pattern_of(at, text)) made.push_back({std::move(*path), line_of(at)});
        });
        return made;
    }

    std::optional<pattern> text_in(const toml::table& of, std::string_view key, bool needed) {
        const auto* node = of.get(key);
        if (!node) {
            if (needed) wrong(of, fmt::format("'{}' is missing", key));
            return {};
        }
        const auto* text = node->as_string();
        if (!text) {
            wrong(*node, fmt::format("'{}' is a text", key));
            return {};
        }
        return pattern_of(*node, text->get());
    }

    template <class Take>
    void each_table(const toml::node& from, std::string_view example, Take take) {
        const auto* array = from.as_array();
        if (!array) return wrong(from, fmt::format("write it like {}", example));
        for (const auto& node : *array) {
            if (const auto* table = node.as_table()) take(*table);
            else wrong(node, fmt::format("write it like {}", example));
        }
    }

    std::vector<role_grant> roles(const toml::node& from) {
        std::vector<role_grant> made;
        each_table(from, "role = [{ role = \"atirma/gateway\", max-priority = 100 }]", [&](const toml::table& one) {
            known_keys(one, {"role", "max-priority"});
            auto role = text_in(one, "role", true);
            std::optional<std::int32_t> most;
            if (const auto* given = one.get("max-priority")) {
                auto number = given->value_exact<std::int64_t>();
                if (!number || *number < std::numeric_limits<std::int32_t>::min() ||
                    *number > std::numeric_limits<std::int32_t>::max())
                    wrong(*given, "'max-priority' is a whole number of 32 bits");
                else most = static_cast<std::int32_t>(*number);
            }
            if (role) made.push_back({std::move(*role), most, line_of(one)});
        });
        return made;
    }

    std::vector<host_grant> hosts(const toml::node& from) {
        std::vector<host_grant> made;
        constexpr auto example = "host = [{ host = \"shore\", do = [\"start\", \"stop\"], type = \"*-proxy\", path = "
                                 "\"atirma/shore/**\" }]";
        each_table(from, example, [&](const toml::table& one) {
            known_keys(one, {"host", "do", "type", "path", "identity", "user"});
            host_grant grant{};
            auto host = text_in(one, "host", true);
            grant.type = text_in(one, "type", false);
            grant.path = text_in(one, "path", false);
            grant.identity = text_in(one, "identity", false);
            grant.user = text_in(one, "user", false);
            grant.line = line_of(one);
            const auto* what = one.get("do");
            if (!what) wrong(one, "'do' is missing: \"start\", \"stop\", or both");
            else
                each_text(*what, "do", [&](const toml::node& at, const std::string& text) {
                    if (text == "start") grant.start = true;
                    else if (text == "stop") grant.stop = true;
                    else wrong(at, fmt::format("'{}' is neither start nor stop", text));
                });
            if (!host) return;
            grant.host = std::move(*host);
            made.push_back(std::move(grant));
        });
        return made;
    }

    void read_rules(const toml::node& from, bool allows) {
        auto word = allows ? "allow" : "deny";
        const auto* array = from.as_array();
        if (!array) return wrong(from, fmt::format("rules are written [[{}]]", word));
        for (const auto& node : *array) {
            const auto* table = node.as_table();
            if (!table) {
                wrong(node, fmt::format("rules are written [[{}]]", word));
                continue;
            }
            if (made_.rules_.size() >= policy::max_rules)
                return wrong(node, fmt::format("more than {} rules", policy::max_rules));
            read_rule(*table, allows);
        }
    }

    void read_rule(const toml::table& from, bool allows) {
        known_keys(from, {"who", "call", "subscribe", "read", "name", "role", "set", "host"});
        rule made;
        made.allows = allows;
        made.line = line_of(from);
        if (const auto* who = from.get("who")) {
            each_text(*who, "who",
                      [&](const toml::node& at, const std::string& text) { add_subject(at, text, made.who, false); });
        } else {
            wrong(from, "'who' is missing: identities, @groups or nobody");
        }
        if (const auto* node = from.get("call")) made.call = targets(*node, "call");
        if (const auto* node = from.get("subscribe")) made.subscribe = targets(*node, "subscribe");
        if (const auto* node = from.get("set")) made.set = targets(*node, "set");
        if (const auto* node = from.get("read")) made.read = places(*node, "read");
        if (const auto* node = from.get("name")) made.name = places(*node, "name");
        if (const auto* node = from.get("role")) made.roles = roles(*node);
        if (const auto* node = from.get("host")) made.hosts = hosts(*node);
        made_.rules_.push_back(std::move(made));
    }

    policy& made_;
    std::vector<remark>& problems_;
    std::map<std::string, std::vector<subject>, std::less<>> groups_;
    std::vector<std::string> systems_;
};

std::shared_ptr<const policy> policy::parse(const std::string& text, const std::string& file,
                                            std::vector<remark>& problems) {
    if (text.size() > max_bytes) {
        problems.push_back({0, 0, fmt::format("{} bytes, {} are allowed", text.size(), max_bytes)});
        return nullptr;
    }
    if (auto stray = stray_character(text)) {
        problems.push_back({stray->line, stray->column, stray_character_text});
        return nullptr;
    }
    auto parsed = toml::parse(std::string_view(text), std::string_view(file));
    if (!parsed) {
        const auto& at = parsed.error().source().begin;
        problems.push_back({at.line, at.column, std::string(parsed.error().description())});
        return nullptr;
    }
    auto made = std::make_shared<policy>();
    made->file_ = file;
    made->hash_ = fmt::format("{:016x}", hash_of(text));
    policy_reader(*made, problems).read(parsed.table());
    return problems.empty() ? made : nullptr;
}

} // namespace ise::access
