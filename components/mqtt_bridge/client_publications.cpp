#include <components/mqtt_bridge/client_publications.hpp>

#include <components/mqtt_bridge/payload_codec.hpp>
#include <components/mqtt_bridge/topics.hpp>

#include <ise/component/discover.hpp>
#include <ise/component/provide_dynamic.hpp>
#include <ise/core/readable.hpp>
#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cstdint>
#include <string_view>

namespace ise::mqtt {

struct client_publications::inlet {
    inlet(const schema& of, bool protobuf) : codec(of, protobuf) {}
    payload_codec codec;
    dynamic_publication out;
    std::uint64_t type = 0;
};

client_publications::client_publications(std::shared_ptr<bridge_context> in) : in_(std::move(in)) {}
client_publications::~client_publications() = default;

void client_publications::learn(const std::string& path, const service_info& service) {
    const auto& wanted = in_->options.publish;
    if (std::ranges::find(wanted, service.name) == wanted.end() ||
        service.kind != static_cast<std::uint8_t>(service_kind::subscription))
        return;
    auto contract = contract_of(service);
    if (!contract || is_action(*contract->types())) return;
    const auto type = contract->packet(role::published).fingerprint();
    if (auto found = all_.find(service.name); found != all_.end()) {
        if (found->second->type != type)
            in_->note(fmt::format("'{}' uses other packets of '{}' than the bridge learnt from another component: it "
                                  "gets what can be adapted",
                                  path, service.name));
        return;
    }
    try {
        auto made = std::make_unique<inlet>(contract->packet(role::published), in_->options.protobuf);
        made->out = publish_dynamic(in_->self, *contract);
        made->type = type;
        all_.emplace(service.name, std::move(made));
        in_->self.log().info("MQTT clients may publish", {{"service", service.name}, {"as_used_by", path}});
    } catch (const error& refused) {
        in_->note(fmt::format("'{}' is not provided: {}", service.name, refused.what()));
    }
}

void client_publications::take(const message& what) {
    auto fail = [&](const std::string& why) {
        ++in_->counts.not_published;
        in_->note(fmt::format("a message of {} is not published: {}", readable(what.topic.substr(0, 200)), why));
    };
    auto begin = in_->topic_below("in/");
    if (!what.topic.starts_with(begin)) return fail("it belongs to no service");
    auto service = unescape(std::string_view(what.topic).substr(begin.size()));
    if (!service) return fail(service.error().message());
    const auto& wanted = in_->options.publish;
    if (std::ranges::find(wanted, *service) == wanted.end()) return fail("nobody may publish there (--publish)");
    auto found = all_.find(*service);
    if (found == all_.end())
        return fail(fmt::format("no component uses '{}' yet, so that its packets are unknown", *service));
    auto packet = found->second->codec.decode(what.payload);
    if (!packet) return fail(packet.error().message());
    ++in_->counts.published;
    found->second->out(*packet);
}

} // namespace ise::mqtt
