#include <components/foxglove_gateway/foxglove_gateway.hpp>

#include <components/foxglove_gateway/shown_channels.hpp>
#include <components/foxglove_gateway/shown_graph.hpp>
#include <components/foxglove_gateway/shown_parameters.hpp>
#include <components/foxglove_gateway/shown_services.hpp>
#include <components/foxglove_gateway/viewer_assets.hpp>
#include <components/foxglove_gateway/viewer_sessions.hpp>

#include <ise/component/discover.hpp>
#include <ise/component/parameter_services.hpp>
#include <ise/component/served_runs.hpp>
#include <ise/core/environment.hpp>
#include <ise/http/http_server.hpp>
#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>

#include <asio/ip/address.hpp>
#include <fmt/format.h>

#include <chrono>
#include <map>
#include <optional>
#include <system_error>
#include <utility>
#include <variant>

namespace ise::foxglove {
namespace {

constexpr duration tick_period = std::chrono::seconds(1);
constexpr duration time_period = std::chrono::milliseconds(100);

} // namespace

struct foxglove_gateway::state {
    state(component& of, const gateway_options& how)
        : in(std::make_shared<gateway_context>(of, how)), viewers(std::make_shared<viewer_sessions>(in, events())),
          channels(std::make_shared<shown_channels>(in, viewers)),
          services(std::make_shared<shown_services>(in, viewers)),
          parameters(std::make_shared<shown_parameters>(in, viewers)),
          graph(std::make_shared<shown_graph>(
              in, viewers, channels,
              [this](const std::string& path, component_info about) { learn(path, std::move(about)); })),
          assets(in), session(fmt::format("{:016x}", of.env().random())) {}

    std::shared_ptr<gateway_context> in;
    std::shared_ptr<viewer_sessions> viewers;
    std::shared_ptr<shown_channels> channels;
    std::shared_ptr<shown_services> services;
    std::shared_ptr<shown_parameters> parameters;
    std::shared_ptr<shown_graph> graph;
    viewer_assets assets;
    std::string session;
    std::unique_ptr<http_server> server;
    publication<std::remove_const_t<decltype(published_service)>> published;

    // --- the system --------------------------------------------------------------------------------------------------

    void show(const std::string& path, const dynamic_contract& service, const dynamic_contract* runs) {
        if (service.kind() == service_kind::request_response) services->add(path, service);
        else if (!is_action(*service.types())) channels->add(path, service);
        else if (runs) channels->add_runs(path, service, *runs); // to subscribe to the action itself would start a run
    }
    void hide(const std::string& path, const std::string& service) {
        channels->remove(path, service);
        services->remove(path, service);
    }
    void announce() {
        channels->announce();
        services->announce();
    }

    /// A component has been described.
    void learn(const std::string& path, component_info about) {
        auto& of = in->components[path];
        std::map<std::string, std::string> now;
        of.has_parameters = false;
        std::optional<dynamic_contract> runs;
        for (const auto& service : about.services) {
            of.has_parameters = of.has_parameters || (service.provided && service.name == parameters_service.name());
            if (!service.provided || service.name != served_runs_service.name()) continue;
            if (auto contract = contract_of(service)) runs.emplace(std::move(*contract));
        }
        for (const auto& service : about.services) {
            if (!in->options.has(service)) continue;
            auto& types = now[service.name];
            types = fmt::format("{}{}", service.kind, runs ? " with runs" : "");
            for (const auto& packet : service.packets) types += "\n" + packet.schema;
        }
        for (const auto& [name, types] : std::map(of.services))
            if (auto still = now.find(name); still == now.end() || still->second != types) {
                of.services.erase(name);
                hide(path, name);
            }
        for (const auto& service : about.services) {
            if (!in->options.has(service) || of.services.contains(service.name)) continue;
            of.services[service.name] = now[service.name];
            if (channels->size() >= max_channels) {
                in->note(fmt::format("'{}/{}' is not shown: there are {} channels already", path, service.name,
                                     max_channels));
                continue;
            }
            auto contract = contract_of(service);
            std::string why = contract ? "" : contract.error().message();
            try {
                if (contract) show(path, *contract, runs ? &*runs : nullptr);
            } catch (const error& refused) { // a type that protobuf cannot have
                why = refused.what();
            }
            if (!why.empty()) in->self.log().warning(fmt::format("'{}/{}' is not shown: {}", path, service.name, why));
        }
        of.about = std::move(about);
        announce();
    }

    void forget(const std::string& path) {
        auto found = in->components.find(path);
        if (found == in->components.end()) return;
        for (const auto& [name, types] : found->second.services) hide(path, name);
        in->components.erase(found);
        parameters->forget(path);
        announce();
    }

    // --- viewers -----------------------------------------------------------------------------------------------------

    viewer_sessions::events events() {
        viewer_sessions::events made;
        made.joined = [this](viewer& who) {
            who.text(write(info()));
            who.greet(channels->list());
            if (in->options.allow_calls) who.greet(services->list());
        };
        made.received = [this](const std::shared_ptr<viewer>& who, client_message& what) {
            std::visit([&](auto& asked) { take(who, asked); }, what);
        };
        made.left = [this](viewer& who) { channels->leave(who); };
        return made;
    }

    server_info info() const {
        const auto& options = in->options;
        const auto& self = in->self;
        server_info made;
        made.name = fmt::format("ISE {}", self.path().empty() ? "gateway" : self.path());
        made.capabilities = {"parameters", "parametersSubscribe", "connectionGraph"};
        if (options.allow_calls) made.capabilities.push_back("services");
        if (options.allow_publish) made.capabilities.push_back("clientPublish");
        if (options.allow_calls || options.allow_publish) made.encodings = {"protobuf", "json"};
        if (!options.assets.empty()) made.capabilities.push_back("assets");
        if (self.env().is_virtual()) made.capabilities.push_back("time");
        made.metadata = {{"gateway", self.path()}, {"host", self.env().identity().host_name}};
        made.session = session;
        return made;
    }

    void take(const std::shared_ptr<viewer>& who, const subscribe_message& asked) { channels->take(who, asked); }
    void take(const std::shared_ptr<viewer>& who, const unsubscribe_message& asked) { channels->take(who, asked); }
    void take(const std::shared_ptr<viewer>& who, call_message& asked) { services->take(who, asked); }
    void take(const std::shared_ptr<viewer>& who, get_parameters_message& asked) { parameters->take(who, asked); }
    void take(const std::shared_ptr<viewer>& who, set_parameters_message& asked) { parameters->take(who, asked); }
    void take(const std::shared_ptr<viewer>& who, const parameter_updates_message& asked) {
        parameters->take(who, asked);
    }
    void take(const std::shared_ptr<viewer>& who, const graph_updates_message& asked) { graph->take(who, asked); }
    void take(const std::shared_ptr<viewer>& who, fetch_asset_message& asked) { assets.take(who, asked); }

    void take(const std::shared_ptr<viewer>& who, const advertise_message& asked) {
        if (!in->options.allow_publish)
            return viewers->refuse(*who, "advertise: viewers may not publish here (--allow-publish)");
        for (const auto& one : asked.channels) {
            if (one.encoding != "json" && one.encoding != "protobuf")
                viewers->refuse(*who, fmt::format("advertise: the encoding of {} is '{}', not json or protobuf",
                                                  one.topic, one.encoding));
            else if (who->channels.size() >= who->limits().max_channels)
                viewers->refuse(
                    *who, fmt::format("advertise: more than {} channels (max_channels)", who->limits().max_channels));
            else if (!who->channels.emplace(one.id, one).second)
                viewers->refuse(*who, fmt::format("advertise: the channel id {} is in use", one.id));
        }
    }

    void take(const std::shared_ptr<viewer>& who, const unadvertise_message& asked) {
        for (auto id : asked.ids)
            if (who->channels.erase(id) == 0)
                viewers->refuse(*who, fmt::format("unadvertise: there is no channel {}", id));
    }

    void take(const std::shared_ptr<viewer>& who, client_data_message& asked) {
        if (!in->options.allow_publish) return viewers->refuse(*who, "viewers may not publish here (--allow-publish)");
        auto on = who->channels.find(asked.channel);
        if (on == who->channels.end())
            return viewers->refuse(*who,
                                   fmt::format("a message of channel {}, which was not advertised", asked.channel));
        viewer_message made;
        made.viewer = viewers->peer_of(*who);
        made.topic = on->second.topic;
        made.encoding = on->second.encoding;
        made.schema_name = on->second.schema_name;
        made.data = std::move(asked.payload);
        ++in->counts.published;
        published(made);
    }

    // --- from time to time -------------------------------------------------------------------------------------------

    void tick() {
        channels->tick();
        viewers->tick();
        graph->tick();
        parameters->tick();
    }

    static task<> tell_time(std::shared_ptr<state> me) {
        for (;;) {
            me->viewers->each([now = me->in->self.wall()](viewer& who) { who.clock(write_time(now)); });
            co_await me->in->self.sleep(time_period);
        }
    }

    gateway_status status() const {
        auto made = in->counts;
        if (server) made.url = url();
        made.channels = static_cast<std::uint32_t>(channels->size());
        viewers->count_into(made);
        return made;
    }
    std::string url() const { return "ws" + server->url().substr(4); }

    void listen() {
        const auto& options = in->options;
        auto& self = in->self;
        std::error_code not_numeric;
        auto address = asio::ip::make_address(options.address, not_numeric);
        if (not_numeric)
            throw error(errc::invalid_argument,
                        fmt::format("gateway: \"{}\" is not a numeric IP address; use such as 127.0.0.1, 0.0.0.0 or :: "
                                    "(--address)",
                                    options.address));
        endpoint at;
        at.host = address.to_string();
        at.port = options.port;
        http_limits limits;
        limits.max_connections = options.max_viewers + 16; // those that are being refused
        limits.message.max_body_bytes = 4096;
        server = std::make_unique<http_server>(self.on(), self.log(), limits, [&self](std::string name, task<> body) {
            self.spawn(std::move(name), std::move(body));
        });
        server->get("/", [to = viewers](const http_request& asked) { return to->admit(asked); });
        if (auto listening = server->listen(at); !listening)
            throw error(listening.error().code(),
                        fmt::format("gateway: {} (--address {}, --port {})", listening.error().message(),
                                    options.address, options.port));
        self.log().info("viewers may connect", {{"url", url()}});
        if (options.on_listening) options.on_listening(url());
    }
};

foxglove_gateway::foxglove_gateway(gateway_options options) : options_(std::move(options)) {}
foxglove_gateway::~foxglove_gateway() = default;

task<> foxglove_gateway::run() {
    auto held = std::make_shared<state>(*this, options_);
    state_ = held;
    struct closing {
        state& mine;
        ~closing() {
            if (mine.server) mine.server->stop();
        }
    } guard{*held};
    provide(status_service, [raw = held.get()](const status_request&) { return raw->status(); });
    if (options_.allow_publish) held->published = publish(published_service);
    held->listen();
    system_news news;
    news.described = [raw = held.get()](const std::string& path, component_info about) {
        raw->learn(path, std::move(about));
    };
    news.gone = [raw = held.get()](const std::string& path) { raw->forget(path); };
    news.trouble = [raw = held.get()](const std::string& what) { raw->in->note(what); };
    system_watch watch(*this, options_, options_.name_servers, std::move(news));
    if (env().is_virtual()) spawn("time", state::tell_time(held));
    for (;;) {
        co_await sleep(tick_period);
        held->tick();
    }
}

} // namespace ise::foxglove
