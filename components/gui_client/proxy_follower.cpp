#include <components/gui_client/proxy_follower.hpp>

#include <components/boat/find_component.hpp>

namespace atirma::console {
namespace {

template <class Contract>
std::string service_name(const Contract& service) {
    return std::string(service.name());
}

} // namespace

const std::set<std::string>& proxy_follower::followed_services() {
    static const std::set<std::string> all = {service_name(services::telemetry),
                                              service_name(services::telecommand),
                                              service_name(services::telecommand_state),
                                              service_name(services::xb_local),
                                              service_name(services::gprs),
                                              service_name(services::iridium_account)};
    return all;
}

void proxy_follower::follow(const std::string& path, const std::set<std::string>& provided) {
    auto known = followed_.find(path);
    std::set<std::string> fresh;
    for (const auto& service : followed_services())
        if (provided.contains(service) && (known == followed_.end() || !known->second.contains(service)))
            fresh.insert(service);
    if (fresh.empty()) return;
    if (!context_.state.add_link(path)) {
        context_.self.log().warning("too many proxies: this one is not followed", {{"path", path}});
        return;
    }
    followed_[path].insert(fresh.begin(), fresh.end());
    auto adds = [&](const auto& service) { return fresh.contains(service_name(service)); };
    if (adds(services::telecommand)) context_.state.takes_commands(path);
    if (adds(services::telemetry)) follow_telemetry(path);
    if (adds(services::telecommand_state)) follow_telecommands(context_, path);
    if (adds(services::xb_local)) follow_newest(path, services::xb_local, &console_state::on_xbee);
    if (adds(services::gprs)) follow_newest(path, services::gprs, &console_state::on_gprs);
    if (adds(services::iridium_account)) follow_newest(path, services::iridium_account, &console_state::on_account);
}

void proxy_follower::report() {
    const auto& links = context_.state.links();
    for (const auto& [path, health] : telemetry_) {
        auto shown = links.find(path);
        if (shown == links.end() || shown->second.connected != health.reached()) context_.news();
        context_.state.on_link(path, health.reached(), health.trouble(), context_.clock());
    }
}

void proxy_follower::follow_telemetry(const std::string& path) {
    stream_use use(services::telemetry);
    use.options = ise::subscribe_options::keep_last(512);
    use.health = &telemetry_.try_emplace(path, "is looked for").first->second;
    use.on_packet = [this, path](const auto& packet) {
        if (auto lost = packet.lost_before().value_or(0); lost != 0) context_.state.on_lost(path, lost);
        context_.state.on_telemetry(path, *packet, context_.clock());
        return true;
    };
    context_.self.spawn("telemetry of " + path,
                        follow_stream(context_, find_component(context_.self, path), std::move(use)));
}

template <class Contract>
void proxy_follower::follow_newest(const std::string& path, const Contract& service,
                                   void (console_state::*on_value)(const std::string&,
                                                                   const typename Contract::packet_type&, utc_time)) {
    stream_use use(service);
    use.optional = true; // the proxy of another link
    use.on_packet = [this, path, on_value](const auto& value) {
        (context_.state.*on_value)(path, *value, context_.clock());
        return true;
    };
    context_.self.spawn(service_name(service) + " of " + path,
                        follow_stream(context_, find_component(context_.self, path), std::move(use)));
}

void follow_telecommands(client_context& context, const std::string& path) {
    stream_use use(services::telecommand_state);
    use.options = ise::subscribe_options::keep_last(256);
    use.on_response = [&context, path](const auto& response) {
        for (const auto& open : response.now) context.state.on_status(path, open, context.clock());
    };
    use.on_packet = [&context, path](const auto& state) {
        context.state.on_status(path, *state, context.clock());
        return true;
    };
    context.self.spawn("telecommands of " + path,
                       follow_stream(context, find_component(context.self, path), std::move(use)));
}

} // namespace atirma::console
