#include <components/mqtt_bridge/mqtt_bridge.hpp>

#include <components/mqtt_bridge/client_calls.hpp>
#include <components/mqtt_bridge/client_publications.hpp>
#include <components/mqtt_bridge/service_feeds.hpp>
#include <components/mqtt_bridge/topics.hpp>

#include <ise/component/discover.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/readable.hpp>
#include <ise/core/url.hpp>
#include <ise/core/waiter.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <map>
#include <optional>
#include <system_error>
#include <utility>

namespace ise::mqtt {
namespace {

constexpr duration tick = std::chrono::milliseconds(200); // what is older is on disk
constexpr duration first_retry = std::chrono::seconds(1);
constexpr duration longest_retry = std::chrono::seconds(10);
constexpr duration steady =
    std::chrono::seconds(10); // a connection that lasted so long was none of a broker in trouble
constexpr duration tidy_period = std::chrono::minutes(1);

std::string text_of(const service_info& service) {
    auto made = fmt::format("{}", service.kind);
    for (const auto& packet : service.packets) made += "\n" + packet.schema;
    return made;
}

} // namespace

struct mqtt_bridge::state {
    state(std::shared_ptr<bridge_context> shared, std::shared_ptr<database> opened,
          std::shared_ptr<outgoing_messages> to)
        : in(std::move(shared)), disk(std::move(opened)), out(std::move(to)),
          feeds(std::make_shared<service_feeds>(in, out)),
          calls(std::make_shared<client_calls>(in, out, disk, in->self.env().random() >> 1)), publications(in),
          wake(in->self.on()) {}

    std::shared_ptr<bridge_context> in;
    std::shared_ptr<database> disk;
    std::shared_ptr<outgoing_messages> out;
    std::shared_ptr<service_feeds> feeds;
    std::shared_ptr<client_calls> calls;
    client_publications publications;
    std::map<std::string, std::map<std::string, std::string>> components; // services by path: what identifies the types

    broker_options broker;
    std::unique_ptr<broker_session> session;
    std::optional<failure> closed;
    time_point connected_at{};
    waiter<std::error_code> wake;

    // --- the system --------------------------------------------------------------------------------------------------

    void show(const std::string& path, const dynamic_contract& service) {
        if (service.kind() == service_kind::request_response) calls->add(path, service);
        else feeds->add(path, service);
    }

    void hide(const std::string& path, const std::string& service) {
        calls->remove(path, service);
        feeds->remove(path, service);
    }

    void on_described(const std::string& path, const component_info& about) {
        const auto& options = in->options;
        for (const auto& service : about.services) publications.learn(path, service);
        if (!options.has(path)) return;
        calls->add_component(path);
        auto& known = components[path];
        std::map<std::string, std::string> now;
        for (const auto& service : about.services)
            if (options.has(service)) now[service.name] = text_of(service);
        for (const auto& [name, types] : std::map(known))
            if (auto still = now.find(name); still == now.end() || still->second != types) {
                known.erase(name);
                hide(path, name);
            }
        for (const auto& service : about.services) {
            if (!options.has(service) || !known.emplace(service.name, now[service.name]).second) continue;
            auto contract = contract_of(service);
            std::string why = contract ? "" : contract.error().message();
            try {
                if (contract) show(path, *contract);
            } catch (const error& refused) { // a type that protobuf cannot have
                why = refused.what();
            }
            if (!why.empty()) in->note(fmt::format("'{}/{}' is not sent: {}", path, service.name, why));
        }
    }

    void on_gone(const std::string& path) {
        auto found = components.find(path);
        if (found == components.end()) return;
        for (const auto& [name, types] : found->second) hide(path, name);
        calls->remove_component(path);
        components.erase(found);
    }

    // --- the broker --------------------------------------------------------------------------------------------------

    session_events events() {
        session_events made;
        made.received = [this](message what) { take(std::move(what)); };
        made.confirmed = [this](int token, const std::optional<failure>& why, bool later) {
            out->on_confirmed(token, why, later);
        };
        made.not_subscribed = [this](const std::string&, const failure& why) { trouble(why); };
        made.closed = [this](const failure& why) {
            closed = why;
            out->close();
            wake.resume({});
        };
        return made;
    }

    void trouble(const failure& why) {
        in->counts.trouble = why.message();
        in->note(why.message());
    }

    void begin(std::unique_ptr<broker_session> made) {
        const auto& options = in->options;
        session = std::move(made);
        connected_at = in->self.now();
        ++in->counts.connections;
        in->counts.trouble.clear();
        in->self.log().info("connected to the broker", {{"broker", options.broker.url}});
        message online = broker.will;
        online.payload = "online";
        out->begin(*session, std::move(online));
        if (options.allow_calls) listen_to(in->topic_below("call/#"));
        if (!options.publish.empty()) listen_to(in->topic_below("in/+"));
        out->resume();
        if (options.on_connected) options.on_connected(options.broker.url);
    }

    void listen_to(const std::string& filter) {
        if (auto done = session->subscribe(filter); !done) trouble(done.error());
    }

    void end() {
        out->close();
        session.reset();
        out->end();
    }

    void take(message what) {
        if (what.retain) { // nobody knows how old it is
            ++in->counts.not_published;
            in->note(fmt::format("a retained message of {} is not heeded: send without retain", readable(what.topic)));
            return;
        }
        if (what.topic.starts_with(in->topic_below("call/"))) return calls->take(std::move(what));
        publications.take(what);
    }

    static task<> stay_connected(std::shared_ptr<state> me) {
        auto& self = me->in->self;
        auto& trouble = me->in->counts.trouble;
        duration pause = first_retry;
        bool usable = false; // the options
        for (;;) {
            me->closed.reset();
            auto broker = me->broker;
            auto events = me->events();
            auto made = co_await me->in->options.connect(self, std::move(broker), std::move(events));
            if (made) {
                usable = true;
                me->begin(std::move(*made));
                while (!me->closed) co_await me->wake.wait(); // throws what it is resumed with
                if (self.now() - me->connected_at >= steady) pause = first_retry;
                me->end();
                trouble = me->closed->message();
            } else {
                if (made.error().code() == errc::invalid_argument && !usable) throw error(made.error());
                usable = true;
                trouble = made.error().message();
            }
            me->in->note(fmt::format("no connection to the broker, it is tried again: {}", trouble));
            co_await self.sleep(pause);
            pause = std::min(2 * pause, longest_retry);
        }
    }

    // --- from time to time -------------------------------------------------------------------------------------------

    static task<> look_after(std::shared_ptr<state> me) {
        auto& self = me->in->self;
        auto tidied = time_point::min();
        for (;;) {
            co_await self.sleep(tick);
            me->out->store(self.now() - tick);
            me->out->pump();
            if (tidied != time_point::min() && self.now() - tidied < tidy_period) continue;
            tidied = self.now();
            me->calls->tidy();
        }
    }

    bridge_status status() const {
        auto made = in->counts;
        made.broker = in->options.broker.url;
        made.connected = session != nullptr && !closed;
        made.topics = feeds->topics();
        out->count_into(made);
        return made;
    }
};

mqtt_bridge::mqtt_bridge(bridge_options options) : options_(std::move(options)) {}
mqtt_bridge::~mqtt_bridge() = default;

task<> mqtt_bridge::run() {
    auto wrong = [](std::string text) { return error(errc::invalid_argument, std::move(text)); };
    if (auto fine = check_prefix(options_.prefix); !fine) throw error(fine.error());
    if (!options_.broker.version_5 && options_.allow_calls)
        throw wrong("calls need MQTT 5: leave out --allow-calls, or use --protocol 5");
    if (!options_.broker.version_5 && options_.protobuf)
        throw wrong("MQTT 3.1.1 has no properties for the times of packets: use --encoding json, or --protocol 5");
    const auto name = options_.store.empty() ? fmt::format("memory:mqtt-{:016x}", env().random()) : options_.store;
    auto clock = [this] { return std::chrono::time_point_cast<std::chrono::system_clock::duration>(wall()); };
    auto damaged = when_damaged::keeping_readable(when_damaged(log(), clock));
    auto opened = database::open(name, bridge_schema, std::move(damaged));
    if (!opened) throw error(opened.error().code(), fmt::format("the store: {} (--store)", opened.error().message()));
    auto disk = std::make_shared<database>(std::move(*opened));
    auto shared = std::make_shared<bridge_context>(*this, options_);
    auto out = outgoing_messages::open(shared, disk);
    if (!out) throw error(out.error().code(), fmt::format("the store: {} (--store)", out.error().message()));
    auto held = std::make_shared<state>(shared, disk, *out);
    held->broker = options_.broker;
    if (held->broker.client_id.empty())
        held->broker.client_id =
            fmt::format("ise-{}-{}", escape(env().identity().host_name, false), escape(path(), false));
    held->broker.will.topic = shared->topic_below("status");
    held->broker.will.payload = "offline";
    held->broker.will.retain = true;
    struct closing {
        state& mine;
        ~closing() {
            mine.out->close();
            mine.session.reset();
            mine.out->store(time_point::max());
        }
    } guard{*held};
    provide(status_service, [raw = held.get()](const status_request&) { return raw->status(); });
    system_news news;
    news.described = [raw = held.get()](const std::string& of, component_info about) { raw->on_described(of, about); };
    news.gone = [raw = held.get()](const std::string& of) { raw->on_gone(of); };
    news.trouble = [raw = held.get()](const std::string& what) { raw->in->note(what); };
    system_watch watch(*this, service_selection(), options_.name_servers, std::move(news));
    spawn("store", state::look_after(held));
    co_await state::stay_connected(held);
}

} // namespace ise::mqtt
