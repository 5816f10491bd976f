#include <components/foxglove_gateway/foxglove_gateway.hpp>

#include <ise/http/http_server.hpp>

#include <ise/bag/protobuf.hpp>
#include <ise/component/discover.hpp>
#include <ise/component/introspection.hpp>
#include <ise/component/parameter_services.hpp>
#include <ise/core/buffer.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/readable.hpp>
#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>

#include <asio/ip/address.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <exception>
#include <map>
#include <set>
#include <utility>

namespace ise::foxglove {
namespace {

constexpr duration tick_period = std::chrono::seconds(1);
constexpr duration time_period = std::chrono::milliseconds(100);
constexpr duration unused_time = std::chrono::seconds(5);   // until a subscription without viewers ends
constexpr duration status_period = std::chrono::seconds(5); // between reports of skipped messages
constexpr duration parameter_period = std::chrono::seconds(2);
constexpr duration graph_period = std::chrono::seconds(5);
constexpr duration question_limit = std::chrono::seconds(5);
constexpr duration longest_pause = std::chrono::seconds(30);
constexpr std::size_t max_channels = 16384;
constexpr std::size_t max_operations = 1024;                     // of all viewers
constexpr std::size_t max_message_bytes = std::size_t{32} << 20; // of a channel
constexpr std::uint32_t derived_depth = 256;                     // packets; a derivation keeps what it needs of each

bool contains(const std::vector<std::string>& all, const std::string& one) {
    return std::ranges::find(all, one) != all.end();
}

std::string_view host_of_origin(std::string_view origin) {
    auto begin = origin.find("://");
    if (begin == std::string_view::npos) return {};
    origin.remove_prefix(begin + 3);
    auto end = origin.starts_with('[') ? origin.find(']') : origin.find(':');
    if (end == std::string_view::npos) return origin;
    return origin.substr(0, origin[end] == ']' ? end + 1 : end);
}

/// What viewers see of an error in a subscription.
std::string condition_of(const std::string& topic) { return "subscription:" + topic; }

} // namespace

bool is_allowed_origin(const std::string& origin, const std::vector<std::string>& allowed) {
    static constexpr std::array known = {"https://app.foxglove.dev", "https://studio.foxglove.dev", "file://"};
    if (origin.empty() || std::ranges::find(known, origin) != known.end()) return true;
    if (contains(allowed, "*") || contains(allowed, origin)) return true;
    if (!origin.starts_with("http://") && !origin.starts_with("https://")) return false;
    auto host = host_of_origin(origin);
    return host == "localhost" || host == "127.0.0.1" || host == "[::1]";
}

struct foxglove_gateway::state : std::enable_shared_from_this<state> {
    state(component& of, const gateway_options& how) : self(of), options(how) {}

    // --- what there is -----------------------------------------------------------------------------------------------

    struct source;
    struct channel {
        channel_info info;
        source* from = nullptr;
        std::shared_ptr<const channel_message> last;
        std::vector<viewer::subscription*> subscribers;
    };
    /// A subscription of the gateway, made while a viewer wants one of its channels.
    struct source : std::enable_shared_from_this<source> {
        explicit source(dynamic_contract of) : contract(std::move(of)) {}
        std::string path;
        dynamic_contract contract;
        std::unique_ptr<derivation> derived; // null: the packets themselves
        std::unique_ptr<bag::protobuf_type> type;
        std::vector<std::unique_ptr<channel>> channels;
        std::function<void()> leave; // ends the subscription that there is
        bool running = false;        // its coroutine
        bool wanted = false;
        bool left = false;      // by `leave`
        bool withdrawn = false; // nothing is sent any more
        time_point unused_since{};
        std::string problem;
        bool used() const {
            return (derived && derived->always()) ||
                   std::ranges::any_of(channels, [](const auto& one) { return !one->subscribers.empty(); });
        }
    };
    struct callable {
        service_info info;
        std::string path;
        dynamic_contract contract;
        std::unique_ptr<bag::protobuf_type> request, response;
        callable(std::string of, dynamic_contract service) : path(std::move(of)), contract(std::move(service)) {}
    };
    /// A component as it was described.
    struct known {
        std::map<std::string, std::string> services; // those that are shown: name, and what identifies its types
        std::map<std::string, std::vector<std::shared_ptr<source>>> sources;
        std::map<std::string, std::shared_ptr<callable>> callables;
        std::optional<component_info> about;
        bool has_parameters = false;
    };

    component& self;
    const gateway_options& options;
    std::unique_ptr<ise::http_server> server;
    std::string session;
    std::map<std::string, known> components; // by path
    std::map<std::uint32_t, channel*> channels;
    std::map<std::uint32_t, std::shared_ptr<callable>> callables;
    std::map<std::string, std::uint32_t> numbers; // of channels and services that there were, by what they are
    std::uint32_t last_number = 0;
    std::shared_ptr<const std::string> all_channels, all_services; // as advertised; null: to be made
    struct connection {
        std::shared_ptr<viewer> who;
        std::weak_ptr<ise::web_socket> over;
        std::string peer;
        time_point told_at{};
    };
    std::map<const viewer*, connection> viewers;
    std::map<std::string, std::vector<parameter_info>> parameters; // by path, as they were told last
    bool reading_parameters = false, drawing_graph = false;
    connection_graph graph;
    time_point parameters_at{}, graph_at{};
    publication<std::remove_const_t<decltype(published_service)>> published;
    gateway_status counts;
    std::size_t operations = 0;
    log_limiter quiet;

    bool shows(const ise::service_info& service) const { return options.has(service); }

    // The same channel has the same number when it comes again.
    std::uint32_t number_of(const std::string& what) {
        if (numbers.size() > 4 * max_channels) numbers.clear(); // the count goes on
        auto& made = numbers[what];
        if (made == 0) made = ++last_number;
        return made;
    }
    static std::string text_of(const schema_info& of) {
        return fmt::format("{}\n{}\n{}\n{}", of.encoding, of.name, of.schema_encoding, of.schema);
    }

    void tell_all(std::string message) {
        auto shared = std::make_shared<const std::string>(std::move(message));
        for (auto& [raw, one] : viewers) one.who->text(shared);
    }

    // --- coming and going --------------------------------------------------------------------------------------------

    void add_channel(const std::shared_ptr<source>& from, std::string topic, schema_info schema,
                     std::vector<const channel_info*>& news) {
        auto made = std::make_unique<channel>();
        made->info.id = number_of(fmt::format("channel\n{}\n{}", topic, text_of(schema)));
        if (channels.contains(made->info.id)) { // two derivations under one name: the first one counts
            self.log().warning(fmt::format("two channels have the topic {}: one is not shown", topic));
            made->info.id = ++last_number;
        }
        made->info.topic = std::move(topic);
        made->info.schema = std::move(schema);
        made->from = from.get();
        channels[made->info.id] = made.get();
        news.push_back(&made->info);
        from->channels.push_back(std::move(made));
    }

    void show(const std::string& path, const dynamic_contract& service, known& of,
              std::vector<const channel_info*>& new_channels, std::vector<const service_info*>& new_services) {
        const auto name = fmt::format("{}/{}", path, service.name());
        auto& shown = of.sources[service.name()];
        if (service.kind() == service_kind::request_response) {
            if (!options.allow_calls) return;
            auto made = std::make_shared<callable>(path, service);
            made->request = std::make_unique<bag::protobuf_type>(service.packet(role::request));
            made->response = std::make_unique<bag::protobuf_type>(service.packet(role::response));
            made->info.name = name;
            made->info.type = made->request->name();
            made->info.request = protobuf_schema(made->request->name(), made->request->descriptors());
            made->info.response = protobuf_schema(made->response->name(), made->response->descriptors());
            made->info.id = number_of(
                fmt::format("service\n{}\n{}\n{}", name, text_of(made->info.request), text_of(made->info.response)));
            callables[made->info.id] = made;
            of.callables[service.name()] = made;
            new_services.push_back(&made->info);
            return;
        }
        if (is_action(*service.types())) return; // to subscribe would start a run
        auto raw = std::make_shared<source>(service);
        raw->path = path;
        raw->type = std::make_unique<bag::protobuf_type>(service.packet(role::published));
        add_channel(raw, name, protobuf_schema(raw->type->name(), raw->type->descriptors()), new_channels);
        shown.push_back(raw);
        for (const auto& make : options.derivations) {
            auto derived = make(path, service);
            if (!derived) continue;
            auto from = std::make_shared<source>(service);
            from->path = path;
            for (const auto& one : derived->channels()) add_channel(from, one.topic, one.schema, new_channels);
            from->derived = std::move(derived);
            shown.push_back(from);
        }
        for (const auto& one : shown)
            if (one->used()) want(one);
    }

    void hide(known& of, const std::string& name, std::vector<std::uint32_t>& old_channels,
              std::vector<std::uint32_t>& old_services) {
        of.services.erase(name);
        if (auto found = of.sources.find(name); found != of.sources.end()) {
            for (const auto& from : found->second) {
                from->withdrawn = true;
                for (const auto& one : from->channels) {
                    old_channels.push_back(one->info.id);
                    channels.erase(one->info.id);
                    for (auto* each : std::exchange(one->subscribers, {})) each->of->unsubscribe(each->id);
                }
                from->channels.clear();
                stop(*from);
            }
            of.sources.erase(found);
        }
        if (auto found = of.callables.find(name); found != of.callables.end()) {
            old_services.push_back(found->second->info.id);
            callables.erase(found->second->info.id);
            of.callables.erase(found);
        }
    }

    void advertise(const std::vector<const channel_info*>& new_channels,
                   const std::vector<const service_info*>& new_services, const std::vector<std::uint32_t>& old_channels,
                   const std::vector<std::uint32_t>& old_services) {
        if (!old_channels.empty()) tell_all(write_unadvertise(old_channels));
        if (!old_services.empty()) tell_all(write_unadvertise_services(old_services));
        if (!new_channels.empty()) tell_all(write_advertise(new_channels));
        if (!new_services.empty()) tell_all(write_advertise_services(new_services));
        if (!old_channels.empty() || !new_channels.empty()) all_channels.reset();
        if (!old_services.empty() || !new_services.empty()) all_services.reset();
    }

    /// A component has been described.
    void learn(const std::string& path, component_info outcome) {
        auto& of = components[path];
        std::vector<const channel_info*> new_channels;
        std::vector<const service_info*> new_services;
        std::vector<std::uint32_t> old_channels, old_services;
        std::map<std::string, std::string> now;
        of.has_parameters = false;
        for (const auto& service : outcome.services) {
            of.has_parameters = of.has_parameters || (service.provided && service.name == parameters_service.name());
            if (!shows(service)) continue;
            auto& types = now[service.name];
            types = fmt::format("{}", service.kind);
            for (const auto& packet : service.packets) types += "\n" + packet.schema;
        }
        for (const auto& [name, types] : std::map(of.services))
            if (auto still = now.find(name); still == now.end() || still->second != types)
                hide(of, name, old_channels, old_services);
        for (const auto& service : outcome.services) {
            if (!shows(service) || of.services.contains(service.name)) continue;
            of.services[service.name] = now[service.name];
            if (channels.size() >= max_channels) {
                note(fmt::format("'{}/{}' is not shown: there are {} channels already", path, service.name,
                                 max_channels));
                continue;
            }
            auto contract = contract_of(service);
            std::string why = contract ? "" : contract.error().message();
            try {
                if (contract) show(path, *contract, of, new_channels, new_services);
            } catch (const error& refused) { // a type that protobuf cannot have
                why = refused.what();
            }
            if (!why.empty()) self.log().warning(fmt::format("'{}/{}' is not shown: {}", path, service.name, why));
        }
        of.about = std::move(outcome);
        advertise(new_channels, new_services, old_channels, old_services);
    }

    void forget(const std::string& path) {
        auto found = components.find(path);
        if (found == components.end()) return;
        std::vector<std::uint32_t> old_channels, old_services;
        for (const auto& [name, types] : std::map(found->second.services))
            hide(found->second, name, old_channels, old_services);
        components.erase(found);
        parameters.erase(path);
        advertise({}, {}, old_channels, old_services);
    }

    // --- packets -----------------------------------------------------------------------------------------------------

    void want(const std::shared_ptr<source>& from) {
        from->wanted = true;
        if (std::exchange(from->running, true)) return;
        self.spawn(fmt::format("show {}/{}", from->path, from->contract.name()), feed(shared_from_this(), from));
    }

    void stop(source& from) {
        from.wanted = false;
        for (const auto& one : from.channels) one->last.reset(); // it will be old for the next viewer
        if (!from.leave) return;
        from.left = true;
        from.leave();
    }

    static task<> feed(std::shared_ptr<state> me, std::shared_ptr<source> from) {
        struct ending {
            source& mine;
            ~ending() { mine.running = false; }
        } guard{*from};
        auto who = me->self.at(from->path);
        subscribe_options terms = subscribe_options::latest();
        if (from->derived) terms = subscribe_options::last(derived_depth);
        else if (me->options.viewer.depth > 1) terms = subscribe_options::last(me->options.viewer.depth);
        duration pause = tick_period;
        while (from->wanted) {
            auto request = default_packet(from->contract.packet(role::subscribe_request));
            auto made = co_await subscribe_dynamic(who, from->contract, std::move(request), terms);
            if (!from->wanted) break;
            std::string problem;
            from->left = false;
            if (made) {
                pause = tick_period;
                me->settle(*from, {});
                // Held here, so that it is not destroyed while it is awaited.
                auto held = std::make_shared<dynamic_stream>(std::move(*made));
                from->leave = [held] { held->leave(); };
                ++me->counts.subscriptions;
                struct counted {
                    state& of;
                    source& mine;
                    ~counted() {
                        --of.counts.subscriptions;
                        mine.leave = nullptr;
                    }
                } count{*me, *from};
                for (;;) {
                    auto packet = co_await held->next();
                    if (!packet) break;
                    if (!from->withdrawn) me->take(*from, *packet, packet.published_at().value_or(me->self.wall()));
                }
                if (held->ended()) problem = held->cause().message();
            } else {
                problem = made.error().message();
            }
            if (!from->wanted || from->withdrawn) break;
            if (from->left) continue; // and wanted again since
            me->settle(*from, problem);
            co_await me->self.sleep(pause);
            pause = std::min(2 * pause, longest_pause);
        }
    }

    // Tells viewers of a subscription that fails, or works again.
    void settle(source& from, const std::string& problem) {
        if (from.problem == problem) return;
        from.problem = problem;
        if (!problem.empty())
            note(fmt::format("'{}/{}' cannot be subscribed to: {}", from.path, from.contract.name(), problem));
        for (const auto& one : from.channels)
            for (auto* to : one->subscribers) to->of->text(condition(*one, problem));
    }
    static std::string condition(const channel& of, const std::string& problem) {
        auto id = condition_of(of.info.topic);
        if (problem.empty()) return write_status_removed(id);
        return write_status(status_level::error, fmt::format("no messages of {}: {}", of.info.topic, problem), id);
    }

    void take(source& from, const dynamic_packet& packet, wall_time at) {
        if (!from.derived) {
            buffer payload;
            if (auto done = from.type->encode(packet.encoded(), payload, false); !done) {
                note(fmt::format("a packet of '{}/{}' is not shown: {}", from.path, from.contract.name(),
                                 done.error().message()));
                return;
            }
            publish(*from.channels[0], at, std::string(as_text(payload.view())));
            return;
        }
        std::vector<derived_message> made;
        try {
            from.derived->take(packet, at, made);
        } catch (const std::exception& why) {
            note(fmt::format("a packet of '{}/{}' is not shown: {}", from.path, from.contract.name(), why.what()));
        }
        for (auto& one : made)
            if (one.channel < from.channels.size())
                publish(*from.channels[one.channel], one.at, std::move(one.payload));
    }

    void publish(channel& on, wall_time at, std::string payload) {
        if (payload.size() > max_message_bytes) {
            note(fmt::format("a message of {} is not shown: it has {} bytes, {} at most (max_message_bytes)",
                             on.info.topic, payload.size(), max_message_bytes));
            return;
        }
        auto made = std::make_shared<channel_message>();
        made->at = at;
        made->payload = std::move(payload);
        on.last = made;
        for (auto* to : on.subscribers) to->of->offer(*to, made);
    }

    // --- viewers -----------------------------------------------------------------------------------------------------

    void note(const std::string& what) {
        if (auto left_out = quiet.admit(self.now()))
            self.log().warning(what, {{"left_out", std::to_string(*left_out)}});
    }

    server_info info() const {
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

    ise::http_response admit(const ise::http_request& asked) {
        auto origin = std::string(asked.message.header("origin"));
        if (!is_allowed_origin(origin, options.origins)) {
            ++counts.refused;
            note(fmt::format("a page of {} may not connect; allow it with --origin", readable(origin)));
            return refusal(403, fmt::format("Pages of {} may not connect to this gateway (--origin).", origin));
        }
        if (viewers.size() >= options.max_viewers) {
            ++counts.refused;
            note(fmt::format("{} viewers are connected: another one is refused (max-viewers)", viewers.size()));
            return refusal(503, "Too many viewers are connected (max-viewers). Try again later.");
        }
        auto talking = [me = shared_from_this(), peer = asked.peer](std::shared_ptr<ise::web_socket> over) {
            return talk(me, std::move(over), peer);
        };
        auto made = ise::accept_web_socket(asked, {std::begin(subprotocols), std::end(subprotocols)}, talking);
        if (made.status != 101) ++counts.refused;
        return made;
    }
    static ise::http_response refusal(int status, std::string why) {
        ise::http_response made;
        made.status = status;
        made.body = std::move(why) + "\n";
        return made;
    }

    static task<> talk(std::shared_ptr<state> me, std::shared_ptr<ise::web_socket> over, std::string peer) {
        auto wake = [weak = std::weak_ptr(over)] {
            if (auto there = weak.lock()) there->wake();
        };
        auto who = std::make_shared<viewer>(me->options.viewer, wake);
        struct leaving {
            state& of;
            viewer& mine;
            ~leaving() { of.leave(mine); }
        } guard{*me, *who};
        auto& entry = me->viewers[who.get()];
        entry.who = who;
        entry.over = over;
        entry.peer = peer;
        ++me->counts.accepted;
        over->on_room([who](std::string& to) { who->fill(to); });
        who->text(write(me->info()));
        who->greet(me->channel_list());
        if (me->options.allow_calls) who->greet(me->service_list());
        for (;;) {
            auto got = co_await over->next();
            if (!got) break;
            const bool text = got->kind == ise::web_socket_opcode::text;
            auto read = text ? read_text(got->payload) : read_binary(got->payload);
            if (read) {
                std::visit([&](auto& what) { me->take(who, what); }, *read);
            } else {
                ++me->counts.malformed;
                who->text(write_status(status_level::error, read.error().message()));
            }
            me->check(*who);
        }
    }

    std::shared_ptr<const std::string> channel_list() {
        if (!all_channels) {
            std::vector<const channel_info*> all;
            for (const auto& [id, one] : channels) all.push_back(&one->info);
            all_channels = std::make_shared<const std::string>(write_advertise(all));
        }
        return all_channels;
    }
    std::shared_ptr<const std::string> service_list() {
        if (!all_services) {
            std::vector<const service_info*> all;
            for (const auto& [id, one] : callables) all.push_back(&one->info);
            all_services = std::make_shared<const std::string>(write_advertise_services(all));
        }
        return all_services;
    }

    void leave(viewer& who) {
        who.gone = true;
        counts.messages += who.sent();
        counts.skipped += who.skipped();
        for (const auto& [id, one] : who.subscriptions()) detach(*one);
        viewers.erase(&who);
    }
    void detach(viewer::subscription& which) {
        auto found = channels.find(which.channel);
        if (found != channels.end()) std::erase(found->second->subscribers, &which);
    }

    // Who does not read what was asked for is disconnected: it cannot be skipped.
    void check(viewer& who) {
        if (!who.overrun()) return;
        auto found = viewers.find(&who);
        auto over = found == viewers.end() ? nullptr : found->second.over.lock();
        if (!over || over->over()) return;
        ++counts.disconnected;
        over->close(ise::web_socket_code::policy, fmt::format("more than {} bytes were not read (max_control_bytes)",
                                                              who.limits().max_control_bytes));
    }

    static void refuse(viewer& who, std::string_view why) { who.text(write_status(status_level::error, why)); }

    void take(const std::shared_ptr<viewer>& who, const subscribe_message& asked) {
        for (const auto& one : asked.subscriptions) {
            auto found = channels.find(one.channel);
            if (found == channels.end()) {
                refuse(*who, fmt::format("subscribe: there is no channel {}", one.channel));
                continue;
            }
            auto made = who->subscribe(one.id, one.channel);
            if (!made) {
                refuse(*who, fmt::format("subscribe: {}", made.error().message()));
                continue;
            }
            auto& on = *found->second;
            on.subscribers.push_back(*made);
            if (on.last) who->offer(**made, on.last);
            want(on.from->shared_from_this());
            if (!on.from->problem.empty()) who->text(condition(on, on.from->problem));
        }
    }

    void take(const std::shared_ptr<viewer>& who, const unsubscribe_message& asked) {
        for (auto id : asked.ids) {
            auto* which = who->find(id);
            if (!which) {
                refuse(*who, fmt::format("unsubscribe: there is no subscription {}", id));
                continue;
            }
            detach(*which);
            who->unsubscribe(id);
        }
    }

    void take(const std::shared_ptr<viewer>& who, const advertise_message& asked) {
        if (!options.allow_publish) return refuse(*who, "advertise: viewers may not publish here (--allow-publish)");
        for (const auto& one : asked.channels) {
            if (one.encoding != "json" && one.encoding != "protobuf")
                refuse(*who, fmt::format("advertise: the encoding of {} is '{}', not json or protobuf", one.topic,
                                         one.encoding));
            else if (who->channels.size() >= who->limits().max_channels)
                refuse(*who,
                       fmt::format("advertise: more than {} channels (max_channels)", who->limits().max_channels));
            else if (!who->channels.emplace(one.id, one).second)
                refuse(*who, fmt::format("advertise: the channel id {} is in use", one.id));
        }
    }

    void take(const std::shared_ptr<viewer>& who, const unadvertise_message& asked) {
        for (auto id : asked.ids)
            if (who->channels.erase(id) == 0) refuse(*who, fmt::format("unadvertise: there is no channel {}", id));
    }

    void take(const std::shared_ptr<viewer>& who, client_data_message& asked) {
        if (!options.allow_publish) return refuse(*who, "viewers may not publish here (--allow-publish)");
        auto on = who->channels.find(asked.channel);
        if (on == who->channels.end())
            return refuse(*who, fmt::format("a message of channel {}, which was not advertised", asked.channel));
        viewer_message made;
        made.viewer = viewers[who.get()].peer;
        made.topic = on->second.topic;
        made.encoding = on->second.encoding;
        made.schema_name = on->second.schema_name;
        made.data = std::move(asked.payload);
        ++counts.published;
        published(made);
    }

    void take(const std::shared_ptr<viewer>& who, const parameter_updates_message& asked) {
        if (asked.begin) {
            if (asked.names.empty()) who->all_parameters = true;
            for (const auto& name : asked.names) {
                if (who->parameters.size() >= who->limits().max_parameters)
                    return refuse(*who, fmt::format("more than {} parameters are followed (max_parameters)",
                                                    who->limits().max_parameters));
                who->parameters.insert(name);
            }
            return;
        }
        if (asked.names.empty()) who->parameters.clear();
        if (asked.names.empty()) who->all_parameters = false;
        for (const auto& name : asked.names) who->parameters.erase(name);
    }

    void take(const std::shared_ptr<viewer>& who, const graph_updates_message& asked) {
        if (std::exchange(who->graph, asked.begin) || !asked.begin) return;
        auto now = write_graph_change({}, graph);
        if (!now.empty()) who->text(std::move(now));
        graph_at = {}; // it may be old
    }

    /// Something that is answered later; false: too much at once.
    bool begin(viewer& who) {
        if (who.operations >= who.limits().max_operations || operations >= max_operations) return false;
        ++who.operations;
        ++operations;
        return true;
    }
    struct operation {
        state& of;
        viewer& mine;
        ~operation() {
            --mine.operations;
            --of.operations;
            of.check(mine);
        }
    };
    std::string too_much(const viewer& who) const {
        return fmt::format("{} requests are being answered: try again later (max_operations)", who.operations);
    }

    void take(const std::shared_ptr<viewer>& who, get_parameters_message& asked) {
        if (!begin(*who)) return refuse(*who, "getParameters: " + too_much(*who));
        self.spawn("get parameters", get_parameters(shared_from_this(), who, std::move(asked)));
    }
    void take(const std::shared_ptr<viewer>& who, set_parameters_message& asked) {
        if (!options.allow_parameters)
            return refuse(*who, "setParameters: viewers may not set parameters here (--allow-parameters)");
        if (!begin(*who)) return refuse(*who, "setParameters: " + too_much(*who));
        self.spawn("set parameters", set_parameters(shared_from_this(), who, std::move(asked)));
    }
    void take(const std::shared_ptr<viewer>& who, call_message& asked) {
        auto fails = [&](std::string why) {
            who->text(write_call_failure(asked.service, asked.call, why));
            ++counts.calls_failed;
        };
        if (!options.allow_calls) return fails("viewers may not call services here (--allow-calls)");
        auto found = callables.find(asked.service);
        if (found == callables.end()) return fails(fmt::format("there is no service {}", asked.service));
        if (asked.encoding != "json" && asked.encoding != "protobuf")
            return fails(fmt::format("the encoding is '{}', not protobuf or json", asked.encoding));
        if (!begin(*who)) return fails(too_much(*who));
        ++counts.calls;
        self.spawn("call " + found->second->info.name, call(shared_from_this(), who, found->second, std::move(asked)));
    }
    void take(const std::shared_ptr<viewer>& who, fetch_asset_message& asked) {
        if (options.assets.empty())
            return who->binary(write_asset_failure(asked.id, "this gateway has no assets (--assets)"));
        if (who->assets.size() >= who->limits().max_assets)
            return who->binary(write_asset_failure(asked.id, "too many assets were asked for (max_assets)"));
        who->assets.push_back(std::move(asked));
        if (!std::exchange(who->fetching, true)) self.spawn("fetch assets", fetch(shared_from_this(), who));
    }

    // --- what is answered later --------------------------------------------------------------------------------------

    static result<dynamic_packet> request_of(const callable& service, const call_message& asked) {
        try {
            const auto& type = service.contract.packet(role::request);
            if (asked.encoding == "json") return dynamic_packet::from_json(type, asked.payload);
            bag::protobuf_limits limits;
            limits.max_packet_bytes = std::size_t{16} << 20;
            auto packet = service.request->decode_fields(as_bytes(asked.payload), limits);
            if (!packet) return packet.error();
            return dynamic_packet(type, std::move(*packet));
        } catch (const error& why) {
            return why.why();
        }
    }
    static result<std::string> response_to(const callable& service, const call_message& asked,
                                           const dynamic_packet& response) {
        if (asked.encoding == "json") return response.to_json();
        buffer made;
        auto done = service.response->encode(response.encoded(), made, false);
        if (!done) return done.error();
        return std::string(as_text(made.view()));
    }

    static task<> call(std::shared_ptr<state> me, std::shared_ptr<viewer> who, std::shared_ptr<callable> service,
                       call_message asked) {
        operation under_way{*me, *who};
        auto request = request_of(*service, asked);
        std::optional<failure> why;
        std::string payload;
        if (request) {
            auto provider = me->self.at(service->path);
            auto answer =
                co_await call_dynamic(provider, service->contract, std::move(*request), me->options.call_deadline);
            if (answer) {
                auto made = response_to(*service, asked, *answer);
                if (made) payload = std::move(*made);
                else why = made.error();
            } else {
                why = answer.error();
            }
        } else {
            why = request.error();
        }
        if (!why) {
            who->binary(write_call_response(asked, payload));
            co_return;
        }
        ++me->counts.calls_failed;
        auto text = fmt::format("{}: {}", name_of(why->code()), why->message());
        if (why->executed() == execution::unknown) text += " (it may have been executed)";
        who->text(write_call_failure(asked.service, asked.call, text));
    }

    static std::vector<parameter_info> infos(const std::string& path, const parameters_response& details) {
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

    // Asks a component for its parameters, and tells those who follow them of changes.
    static task<> read_parameters(std::shared_ptr<state> me, std::string path) {
        auto who = me->self.at(path);
        parameters_request question;
        auto reply = co_await who.try_call(parameters_service, question, question_limit);
        if (reply) me->refresh(path, infos(path, *reply));
    }
    void refresh(const std::string& path, std::vector<parameter_info> now) {
        if (!components.contains(path)) return;
        auto& was = parameters[path];
        for (auto& [raw, one] : viewers) {
            std::vector<const parameter_info*> news;
            for (const auto& each : now) {
                if (!one.who->all_parameters && !one.who->parameters.contains(each.name)) continue;
                if (std::ranges::find(was, each) == was.end()) news.push_back(&each);
            }
            if (!news.empty()) one.who->text(write_parameters(news, std::nullopt));
        }
        was = std::move(now);
    }

    /// The components that have parameters of these names; without names all.
    std::set<std::string> owners(const std::vector<std::string>& names) const {
        std::set<std::string> made;
        for (const auto& name : names) made.insert(name.substr(0, std::min(name.rfind('/'), name.size())));
        if (names.empty())
            for (const auto& [path, of] : components) made.insert(path);
        std::erase_if(made, [&](const auto& path) {
            auto found = components.find(path);
            return found == components.end() || !found->second.has_parameters;
        });
        return made;
    }

    void tell_parameters(viewer& who, const std::vector<std::string>& names, const std::optional<std::string>& id) {
        std::vector<const parameter_info*> outcome;
        for (const auto& path : owners(names))
            for (const auto& one : parameters[path])
                if (names.empty() || contains(names, one.name)) outcome.push_back(&one);
        who.text(write_parameters(outcome, id));
    }

    static task<> get_parameters(std::shared_ptr<state> me, std::shared_ptr<viewer> who, get_parameters_message asked) {
        operation under_way{*me, *who};
        auto paths = me->owners(asked.names);
        for (const auto& path : paths) co_await read_parameters(me, path);
        me->tell_parameters(*who, asked.names, asked.id);
    }

    static task<> set_parameters(std::shared_ptr<state> me, std::shared_ptr<viewer> who, set_parameters_message asked) {
        operation under_way{*me, *who};
        std::map<std::string, change_parameters_request> changes;
        std::vector<std::string> names;
        for (auto& one : asked.parameters) {
            auto path = one.name.substr(0, std::min(one.name.rfind('/'), one.name.size()));
            names.push_back(one.name);
            auto found = me->components.find(path);
            if (found == me->components.end() || !found->second.has_parameters) {
                refuse(*who, fmt::format("setParameters: there is no parameter {}", one.name));
                continue;
            }
            parameter_setting setting;
            setting.name = one.name.substr(path.size() + 1);
            setting.value = std::move(one.value);
            changes[path].settings.push_back(std::move(setting));
        }
        for (const auto& [path, change] : changes) {
            auto provider = me->self.at(path);
            auto reply = co_await provider.try_call(change_parameters_service, change, question_limit);
            if (reply) {
                co_await read_parameters(me, path);
            } else {
                refuse(*who, fmt::format("setParameters: {}: {}", path, reply.error().message()));
                co_await read_parameters(me, path);
            }
        }
        me->tell_parameters(*who, names, asked.id);
    }

    static task<> follow_parameters(std::shared_ptr<state> me) {
        struct ending {
            state& mine;
            ~ending() { mine.reading_parameters = false; }
        } guard{*me};
        std::set<std::string> paths;
        for (const auto& [raw, one] : me->viewers) {
            std::vector<std::string> names(one.who->parameters.begin(), one.who->parameters.end());
            if (one.who->all_parameters) names.clear();
            else if (names.empty()) continue;
            paths.merge(me->owners(names));
        }
        for (const auto& path : paths) co_await read_parameters(me, path);
    }

    // One asset after the other: the next is read when the viewer has taken the last.
    static task<> fetch(std::shared_ptr<state> me, std::shared_ptr<viewer> who) {
        struct ending {
            viewer& mine;
            ~ending() { mine.fetching = false; }
        } guard{*who};
        while (!who->gone && !who->assets.empty()) {
            if (!who->idle()) {
                co_await me->self.sleep(std::chrono::milliseconds(50));
                continue;
            }
            auto asked = std::move(who->assets.front());
            who->assets.pop_front();
            auto path = asset_path(asked.uri);
            std::string why = path ? "" : path.error().message();
            if (path) {
                auto file = me->options.assets + "/" + *path;
                auto read = [&env = me->self.env(), file, most = me->options.max_asset_bytes] {
                    return env.read_file(file, most);
                };
                result<std::string> content = co_await me->self.offload(std::move(read));
                if (content) who->binary(write_asset(asked.id, *content));
                else why = fmt::format("no asset '{}': {}", *path, name_of(content.error().code()));
            }
            if (!why.empty()) who->binary(write_asset_failure(asked.id, why));
        }
    }

    // --- the graph ---------------------------------------------------------------------------------------------------

    connection_graph draw() const {
        connection_graph made;
        for (const auto& [path, of] : components) {
            if (!of.about) continue;
            for (const auto& [name, types] : of.services) {
                const bool topic = of.sources.contains(name) && !of.sources.at(name).empty();
                (topic ? made.published : made.services)[fmt::format("{}/{}", path, name)].insert(path);
            }
        }
        for (const auto& [path, of] : components) {
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

    static task<> follow_graph(std::shared_ptr<state> me) {
        struct ending {
            state& mine;
            ~ending() { mine.drawing_graph = false; }
        } guard{*me};
        std::vector<std::string> paths;
        for (const auto& [path, of] : me->components) paths.push_back(path);
        for (const auto& path : paths) {
            auto who = me->self.at(path);
            describe_request question;
            auto reply = co_await who.try_call(describe_service, question, question_limit);
            if (reply && me->components.contains(path)) me->learn(path, std::move(*reply));
        }
        auto now = me->draw();
        auto news = write_graph_change(me->graph, now);
        me->graph = std::move(now);
        if (news.empty()) co_return;
        auto shared = std::make_shared<const std::string>(std::move(news));
        for (auto& [raw, one] : me->viewers)
            if (one.who->graph) one.who->text(shared);
    }

    // --- from time to time -------------------------------------------------------------------------------------------

    void tick() {
        const auto now = self.now();
        for (const auto& [path, of] : components)
            for (const auto& [name, sources] : of.sources)
                for (const auto& from : sources) {
                    if (from->used()) from->unused_since = now;
                    else if (from->wanted && now - from->unused_since >= unused_time) stop(*from);
                }
        bool graph_wanted = false, parameters_wanted = false;
        for (auto& [raw, one] : viewers) {
            auto& who = *one.who;
            check(who);
            graph_wanted = graph_wanted || who.graph;
            parameters_wanted = parameters_wanted || who.all_parameters || !who.parameters.empty();
            if (who.skipped() == who.told_skipped || now - one.told_at < status_period) continue;
            who.text(write_status(status_level::warning,
                                  fmt::format("{} messages were skipped as this viewer does not take them in time; the "
                                              "newest of each channel is sent",
                                              who.skipped() - who.told_skipped)));
            who.told_skipped = who.skipped();
            one.told_at = now;
        }
        if (graph_wanted && !drawing_graph && now - graph_at >= graph_period) {
            drawing_graph = true;
            graph_at = now;
            self.spawn("connection graph", follow_graph(shared_from_this()));
        }
        if (parameters_wanted && !reading_parameters && now - parameters_at >= parameter_period) {
            reading_parameters = true;
            parameters_at = now;
            self.spawn("parameters", follow_parameters(shared_from_this()));
        }
    }

    static task<> tell_time(std::shared_ptr<state> me) {
        for (;;) {
            for (auto& [raw, one] : me->viewers) one.who->clock(write_time(me->self.wall()));
            co_await me->self.sleep(time_period);
        }
    }

    gateway_status status() const {
        auto made = counts;
        if (server) made.url = url();
        made.viewers = static_cast<std::uint32_t>(viewers.size());
        made.channels = static_cast<std::uint32_t>(channels.size());
        for (const auto& [raw, one] : viewers) {
            made.messages += one.who->sent();
            made.skipped += one.who->skipped();
        }
        return made;
    }
    std::string url() const { return "ws" + server->url().substr(4); }

    void listen() {
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
        ise::http_limits limits;
        limits.max_connections = options.max_viewers + 16; // those that are being refused
        limits.message.max_body_bytes = 4096;
        server =
            std::make_unique<ise::http_server>(self.on(), self.log(), limits, [this](std::string name, task<> body) {
                self.spawn(std::move(name), std::move(body));
            });
        server->get("/", [this](const ise::http_request& asked) { return admit(asked); });
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
    held->session = fmt::format("{:016x}", env().random());
    provide(status_service, [raw = held.get()](const status_request&) { return raw->status(); });
    if (options_.allow_publish) held->published = publish(published_service);
    held->listen();
    system_news news;
    news.described = [raw = held.get()](const std::string& path, component_info about) {
        raw->learn(path, std::move(about));
    };
    news.gone = [raw = held.get()](const std::string& path) { raw->forget(path); };
    news.trouble = [raw = held.get()](const std::string& what) { raw->note(what); };
    system_watch watch(*this, options_, options_.name_servers, std::move(news));
    if (env().is_virtual()) spawn("time", state::tell_time(held));
    for (;;) {
        co_await sleep(tick_period);
        held->tick();
    }
}

} // namespace ise::foxglove
