#include <ise/access/guard.hpp>

#include <fmt/format.h>

#include <utility>
#include <vector>

namespace ise::access {
namespace {

std::string file_name(const std::string& path) { return path.substr(path.rfind('/') + 1); }

std::string rule_of(const verdict& why, const policy& by) {
    return why.line == 0 ? std::string() : fmt::format("{}:{}", file_name(by.file()), why.line);
}

// What it may not do: "call 'telecommand' of atirma/communication".
std::string deed(const request& what) {
    auto target = what.targets.empty() ? std::string() : what.targets.front();
    auto component = target.empty() ? std::string("a component without a name") : target;
    switch (what.what) {
        case action::call: return fmt::format("call '{}' of {}", what.item, component);
        case action::subscribe: return fmt::format("subscribe to '{}' of {}", what.item, component);
        case action::read: return fmt::format("read what {} tells of itself", component);
        case action::name: return fmt::format("have the name {}", target);
        case action::role: return fmt::format("serve the role {} with priority {}", target, what.priority);
        case action::set:
            if (what.any_path) return "set parameters of any component";
            return what.item.empty() ? fmt::format("set parameters of {}", component)
                                     : fmt::format("set the parameter '{}' of {}", what.item, component);
        case action::start:
        case action::stop:
            if (what.any_path) return fmt::format("{} components on host {}", name_of(what.what), what.host);
            return fmt::format("{} {}{} on host {}{}{}", name_of(what.what), target,
                               what.type.empty() ? "" : fmt::format(" of type '{}'", what.type), what.host,
                               what.identity.empty() ? "" : fmt::format(" with the identity '{}'", what.identity),
                               what.user.empty() ? "" : fmt::format(" as user '{}'", what.user));
        case action::look_up: return "look up names";
    }
    return {};
}

// Texts of peers are cut: they go into answers and into the audit log.
std::string cut(std::string text) {
    constexpr std::size_t most = 1024;
    if (text.size() > most) text.replace(most, std::string::npos, "...");
    return text;
}

} // namespace

failure denial(std::string_view identity, const request& what, const verdict& why, const policy& by) {
    auto who = std::string(shown(identity));
    auto cause = why.denied ? fmt::format("{} denies it", rule_of(why, by))
                            : fmt::format("no rule of {} allows it", file_name(by.file()));
    return {errc::access_denied, fmt::format("{} may not {}: {} (ise access why {} {})", who, cut(deed(what)), cause,
                                             who, cut(text_of(what)))};
}

guard::guard(environment& env, std::string file, audit_log audit)
    : env_(env), file_(std::move(file)), audit_(std::move(audit)) {}

result<std::shared_ptr<guard>> guard::load(environment& env, const std::string& file, audit_log audit) {
    std::shared_ptr<guard> made(new guard(env, file, std::move(audit)));
    auto read = made->read();
    if (!read) return read.error();
    made->looked_at_ = env.now();
    return made;
}

// With the mutex, or alone.
result<void> guard::read() {
    auto text = env_.read_trusted(file_, policy::max_bytes);
    if (!text) return text.error();
    if (now_ && !broken_ && *text == seen_) return {};
    std::vector<remark> problems;
    auto made = policy::parse(*text, file_, problems);
    if (!made) {
        std::string all;
        constexpr std::size_t most = 5;
        for (std::size_t at = 0; at < problems.size() && at < most; ++at)
            all += fmt::format("{}{}:{}:{}: {}", at == 0 ? "" : "; ", file_, problems[at].line, problems[at].column,
                               problems[at].text);
        if (problems.size() > most) all += fmt::format("; and {} more (ise access check)", problems.size() - most);
        return failure(errc::invalid_argument, all);
    }
    now_ = std::move(made);
    seen_ = std::move(*text);
    read_at_ = env_.wall();
    version_.fetch_add(1, std::memory_order_acq_rel);
    return {};
}

void guard::refresh() {
    std::lock_guard lock(mutex_);
    auto now = env_.now();
    if (now - looked_at_ < reread_after) return;
    looked_at_ = now;
    auto done = read();
    if (done) {
        if (std::exchange(broken_, std::nullopt)) version_.fetch_add(1, std::memory_order_acq_rel);
        return;
    }
    failure result(
        errc::access_denied,
        fmt::format("{}, so that no new session is made, and for existing ones the policy with hash {} counts: "
                    "{}",
                    unusable_policy, now_->hash(), done.error().message()));
    bool news = !broken_ || broken_->message() != result.message();
    broken_ = std::move(result);
    if (news) version_.fetch_add(1, std::memory_order_acq_rel);
}

std::shared_ptr<const policy> guard::current() const {
    std::lock_guard lock(mutex_);
    return now_;
}

std::optional<failure> guard::broken() const {
    std::lock_guard lock(mutex_);
    return broken_;
}

wall_time guard::read_at() const {
    std::lock_guard lock(mutex_);
    return read_at_;
}

std::optional<failure> guard::objection(const verified_peer* by, const request& what, std::string_view component,
                                        bool keep) {
    if (!by || by->same_process) return {};
    auto policy = current();
    auto said = policy->decide(by->who, what);
    if (keep) note(*by, what, component, said);
    if (said.allowed) return {};
    return denial(by->who, what, said, *policy);
}

std::optional<failure> guard::objection(const view& by, const verified_peer& peer, const request& what,
                                        std::string_view component, bool keep) {
    auto said = by.decide(what);
    if (said.allowed) return {};
    if (keep) note(peer, what, component, said);
    return denial(peer.who, what, said, *by.of());
}

void guard::note(const verified_peer& by, const request& what, std::string_view component, const verdict& why) {
    if (!audit_.keeps()) return;
    audit_entry entry;
    entry.at = env_.wall();
    entry.who = shown(by.who);
    entry.serial = by.serial;
    entry.from = by.from;
    entry.component = component;
    entry.what = cut(text_of(what));
    entry.allowed = why.allowed;
    entry.rule = rule_of(why, *current());
    audit_.keep(entry);
}

} // namespace ise::access
