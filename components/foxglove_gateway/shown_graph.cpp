#include <components/foxglove_gateway/shown_graph.hpp>

#include <fmt/format.h>

#include <chrono>
#include <vector>

namespace ise::foxglove {
namespace {

constexpr duration graph_period = std::chrono::seconds(5);
constexpr duration describe_limit = std::chrono::seconds(5); // for an answer

} // namespace

void shown_graph::take(const std::shared_ptr<viewer>& who, const graph_updates_message& asked) {
    if (std::exchange(who->graph, asked.begin) || !asked.begin) return;
    auto now = write_graph_change({}, told_);
    if (!now.empty()) who->text(std::move(now));
    drawn_at_ = {}; // it may be old
}

connection_graph shown_graph::draw() const {
    connection_graph made;
    for (const auto& [path, of] : in_->components) {
        if (!of.about) continue;
        for (const auto& [name, types] : of.services)
            (channels_->has(path, name) ? made.published : made.services)[fmt::format("{}/{}", path, name)].insert(
                path);
    }
    for (const auto& [path, of] : in_->components) {
        if (!of.about) continue;
        for (const auto& one : of.about->sessions)
            for (const auto& name : one.uses) {
                // "atirma/boat (local://…)"
                auto topic = fmt::format("{}/{}", one.peer.substr(0, one.peer.find(" (")), name);
                if (made.published.contains(topic)) made.subscribed[topic].insert(path);
            }
    }
    return made;
}

task<> shown_graph::follow(std::shared_ptr<shown_graph> me) {
    struct ending {
        shown_graph& mine;
        ~ending() { mine.drawing_ = false; }
    } guard{*me};
    std::vector<std::string> paths;
    for (const auto& [path, of] : me->in_->components) paths.push_back(path);
    for (const auto& path : paths) {
        auto who = me->in_->self.at(path);
        describe_request question;
        auto reply = co_await who.try_call(describe_service, question, describe_limit);
        if (reply && me->in_->components.contains(path)) me->described_(path, std::move(*reply));
    }
    auto now = me->draw();
    auto news = write_graph_change(me->told_, now);
    me->told_ = std::move(now);
    if (news.empty()) co_return;
    auto shared = std::make_shared<const std::string>(std::move(news));
    me->to_->each([&](viewer& who) {
        if (who.graph) who.text(shared);
    });
}

void shown_graph::tick() {
    bool wanted = false;
    to_->each([&](const viewer& who) { wanted = wanted || who.graph; });
    const auto now = in_->self.now();
    if (!wanted || drawing_ || now - drawn_at_ < graph_period) return;
    drawing_ = true;
    drawn_at_ = now;
    in_->self.spawn("connection graph", follow(shared_from_this()));
}

} // namespace ise::foxglove
