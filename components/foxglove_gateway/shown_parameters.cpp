#include <components/foxglove_gateway/shown_parameters.hpp>

#include <ise/component/parameter_services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace ise::foxglove {
namespace {

constexpr duration parameter_period = std::chrono::seconds(2);
constexpr duration parameter_limit = std::chrono::seconds(5); // for an answer

std::string owner_of(const std::string& name) { return name.substr(0, std::min(name.rfind('/'), name.size())); }

std::vector<parameter_info> infos(const std::string& path, const parameters_response& details) {
    std::vector<parameter_info> made;
    for (const auto& one : details.parameters) {
        auto& next = made.emplace_back();
        next.name = fmt::format("{}/{}", path, one.about.name);
        next.kind = one.about.kind;
        next.many = one.about.many;
        next.values = one.values;
    }
    return made;
}

} // namespace

void shown_parameters::take(const std::shared_ptr<viewer>& who, get_parameters_message& asked) {
    auto under_way = to_->begin(who);
    if (!under_way) return to_->refuse(*who, "getParameters: " + to_->too_much(*who));
    in_->self.spawn("get parameters", get(shared_from_this(), who, std::move(asked), std::move(*under_way)));
}

void shown_parameters::take(const std::shared_ptr<viewer>& who, set_parameters_message& asked) {
    if (!in_->options.allow_parameters)
        return to_->refuse(*who, "setParameters: viewers may not set parameters here (--allow-parameters)");
    auto under_way = to_->begin(who);
    if (!under_way) return to_->refuse(*who, "setParameters: " + to_->too_much(*who));
    in_->self.spawn("set parameters", set(shared_from_this(), who, std::move(asked), std::move(*under_way)));
}

void shown_parameters::take(const std::shared_ptr<viewer>& who, const parameter_updates_message& asked) {
    if (asked.begin) {
        if (asked.names.empty()) who->all_parameters = true;
        for (const auto& name : asked.names) {
            if (who->parameters.size() >= who->limits().max_parameters)
                return to_->refuse(*who, fmt::format("more than {} parameters are followed (max_parameters)",
                                                     who->limits().max_parameters));
            who->parameters.insert(name);
        }
        return;
    }
    if (asked.names.empty()) who->parameters.clear();
    if (asked.names.empty()) who->all_parameters = false;
    for (const auto& name : asked.names) who->parameters.erase(name);
}

bool shown_parameters::has_parameters(const std::string& path) const {
    auto found = in_->components.find(path);
    return found != in_->components.end() && found->second.has_parameters;
}

// Asks a component for its parameters, and tells viewers that follow them of changes.
task<> shown_parameters::read(std::shared_ptr<shown_parameters> me, std::string path) {
    auto who = me->in_->self.at(path);
    parameters_request question;
    auto reply = co_await who.try_call(parameters_service, question, parameter_limit);
    if (reply) me->refresh(path, infos(path, *reply));
}

void shown_parameters::refresh(const std::string& path, std::vector<parameter_info> now) {
    if (!in_->components.contains(path)) return;
    auto& was = told_[path];
    to_->each([&](viewer& who) {
        std::vector<const parameter_info*> news;
        for (const auto& each : now) {
            if (!who.all_parameters && !who.parameters.contains(each.name)) continue;
            if (std::ranges::find(was, each) == was.end()) news.push_back(&each);
        }
        if (!news.empty()) who.text(write_parameters(news, std::nullopt));
    });
    was = std::move(now);
}

/// The components that have parameters of these names; without names all.
std::set<std::string> shown_parameters::owners(const std::vector<std::string>& names) const {
    std::set<std::string> made;
    for (const auto& name : names) made.insert(owner_of(name));
    if (names.empty())
        for (const auto& [path, of] : in_->components) made.insert(path);
    std::erase_if(made, [&](const auto& path) { return !has_parameters(path); });
    return made;
}

void shown_parameters::tell(viewer& who, const std::vector<std::string>& names, const std::optional<std::string>& id) {
    std::vector<const parameter_info*> outcome;
    for (const auto& path : owners(names))
        for (const auto& one : told_[path])
            if (names.empty() || std::ranges::find(names, one.name) != names.end()) outcome.push_back(&one);
    who.text(write_parameters(outcome, id));
}

task<> shown_parameters::get(std::shared_ptr<shown_parameters> me, std::shared_ptr<viewer> who,
                             get_parameters_message asked, [[maybe_unused]] viewer_sessions::operation under_way) {
    auto paths = me->owners(asked.names);
    for (const auto& path : paths) co_await read(me, path);
    me->tell(*who, asked.names, asked.id);
}

task<> shown_parameters::set(std::shared_ptr<shown_parameters> me, std::shared_ptr<viewer> who,
                             set_parameters_message asked, [[maybe_unused]] viewer_sessions::operation under_way) {
    std::map<std::string, change_parameters_request> changes;
    std::vector<std::string> names;
    for (auto& one : asked.parameters) {
        auto path = owner_of(one.name);
        names.push_back(one.name);
        if (!me->has_parameters(path)) {
            me->to_->refuse(*who, fmt::format("setParameters: there is no parameter {}", one.name));
            continue;
        }
        parameter_setting setting;
        setting.name = one.name.substr(path.size() + 1);
        setting.value = std::move(one.value);
        changes[path].settings.push_back(std::move(setting));
    }
    for (const auto& [path, change] : changes) {
        auto provider = me->in_->self.at(path);
        auto reply = co_await provider.try_call(change_parameters_service, change, parameter_limit);
        if (!reply) me->to_->refuse(*who, fmt::format("setParameters: {}: {}", path, reply.error().message()));
        co_await read(me, path);
    }
    me->tell(*who, names, asked.id);
}

task<> shown_parameters::follow(std::shared_ptr<shown_parameters> me) {
    struct ending {
        shown_parameters& mine;
        ~ending() { mine.following_ = false; }
    } guard{*me};
    std::set<std::string> paths;
    me->to_->each([&](const viewer& who) {
        std::vector<std::string> names(who.parameters.begin(), who.parameters.end());
        if (who.all_parameters) names.clear();
        else if (names.empty()) return;
        paths.merge(me->owners(names));
    });
    for (const auto& path : paths) co_await read(me, path);
}

void shown_parameters::tick() {
    bool wanted = false;
    to_->each([&](const viewer& who) { wanted = wanted || who.all_parameters || !who.parameters.empty(); });
    const auto now = in_->self.now();
    if (!wanted || following_ || now - followed_at_ < parameter_period) return;
    following_ = true;
    followed_at_ = now;
    in_->self.spawn("parameters", follow(shared_from_this()));
}

} // namespace ise::foxglove
