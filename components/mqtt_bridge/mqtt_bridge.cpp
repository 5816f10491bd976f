#include <components/mqtt_bridge/mqtt_bridge.hpp>

#include <components/mqtt_bridge/call_journal.hpp>
#include <components/mqtt_bridge/topics.hpp>

#include <ise/bag/protobuf.hpp>
#include <ise/component/discover.hpp>
#include <ise/component/provide_dynamic.hpp>
#include <ise/core/buffer.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/readable.hpp>
#include <ise/core/url.hpp>
#include <ise/core/waiter.hpp>
#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <chrono>
#include <deque>
#include <map>
#include <set>
#include <utility>
#include <variant>

namespace ise::mqtt {
namespace {

constexpr duration tick = std::chrono::milliseconds(200); // what is older is on disk
constexpr duration first_pause = std::chrono::seconds(1);
constexpr duration most_pause = std::chrono::seconds(10);
constexpr duration steady =
    std::chrono::seconds(10); // a connection that lasted so long was none of a broker in trouble
constexpr duration tidy_period = std::chrono::minutes(1);
constexpr duration refused_pause = std::chrono::seconds(5); // before a message that the broker does not want now
constexpr std::uint32_t subscription_depth = 1024;          // packets between a provider and the bridge
constexpr std::size_t max_topics = 4096;
constexpr std::size_t max_message_bytes = std::size_t{4} << 20;
constexpr std::size_t max_calls_at_once = 256;
constexpr std::size_t max_answers = 1024;               // that wait for the broker
constexpr std::size_t max_unconfirmed = 2 * max_topics; // messages; answers wait then
constexpr std::size_t min_correlation = 8, max_correlation = 256;

bool is_one_of(const std::vector<std::string>& all, const std::string& one) {
    return std::ranges::find(all, one) != all.end();
}

std::string utc_text(wall_time at) {
    using namespace std::chrono;
    auto day = floor<days>(at);
    year_month_day date(day);
    hh_mm_ss time(floor<microseconds>(at - day));
    return fmt::format("{:04}-{:02}-{:02}T{:02}:{:02}:{:02}.{:06}Z", static_cast<int>(date.year()),
                       static_cast<unsigned>(date.month()), static_cast<unsigned>(date.day()), time.hours().count(),
                       time.minutes().count(), time.seconds().count(), time.subseconds().count());
}

} // namespace

struct mqtt_bridge::state : std::enable_shared_from_this<state> {
    /// Packets of one type as payloads of messages.
    class payload_codec {
    public:
        payload_codec(const schema& of, bool protobuf) : type_(of) {
            if (protobuf) message_ = std::make_unique<bag::protobuf_type>(of);
        }
        result<std::string> encode(const dynamic_packet& packet) const {
            if (!message_) return packet.to_json();
            buffer made;
            if (auto done = message_->encode(packet.encoded(), made, false); !done) return done.error();
            return std::string(as_text(made.view()));
        }
        result<dynamic_packet> decode(const std::string& payload) const {
            try {
                if (!message_) return dynamic_packet::from_json(type_, payload);
                bag::protobuf_limits limits;
                limits.max_packet_bytes = std::size_t{16} << 20;
                auto packet = message_->decode_fields(as_bytes(payload), limits);
                if (!packet) return packet.error();
                return dynamic_packet(type_, std::move(*packet));
            } catch (const error& why) {
                return why.why();
            }
        }
        const bag::protobuf_type* message() const noexcept { return message_.get(); }

    private:
        schema type_;
        std::unique_ptr<bag::protobuf_type> message_; // null: JSON
    };

    /// A subscription of the bridge.
    struct source {
        source(std::string of, dynamic_contract service, bool protobuf)
            : path(std::move(of)), contract(std::move(service)), codec(contract.packet(role::published), protobuf) {}
        std::string path;
        dynamic_contract contract;
        payload_codec codec;
        std::string topic, schema_topic;
        bool queued = false;
        bool withdrawn = false;
        std::function<void()> leave;
        std::string problem;
    };

    struct callable {
        callable(std::string of, dynamic_contract service, bool protobuf)
            : path(std::move(of)), contract(std::move(service)), request(contract.packet(role::request), protobuf),
              response(contract.packet(role::response), protobuf) {}
        std::string path;
        dynamic_contract contract;
        payload_codec request, response;
    };

    /// A component as it was described.
    struct known {
        std::map<std::string, std::string> services; // name, and what identifies the types
        std::map<std::string, std::shared_ptr<source>> sources;
        std::map<std::string, std::shared_ptr<callable>> callables;
    };

    /// The newest message of a topic of which only that counts.
    struct newest_message {
        queued_message what;
        time_point came{};
        std::string content_type;
        std::vector<std::pair<std::string, std::string>> user; // beside those of every packet
        bool plain = false;                                    // no packet: a schema, or nothing any more
        bool waiting = false, in_flight = false;
    };

    /// A service that MQTT clients publish to.
    struct inlet {
        inlet(const schema& of, bool protobuf) : codec(of, protobuf) {}
        payload_codec codec;
        dynamic_publication out;
        std::uint64_t type = 0;
    };

    state(component& of, const bridge_options& how, database opened)
        : self(of), options(how), db(std::move(opened)), journal(db, of.env().random() >> 1, how.remember),
          wake(of.on(), [this] { wake.resume(asio::error::operation_aborted); }) {}

    component& self;
    const bridge_options& options;
    broker_options broker;
    database db;
    std::optional<outgoing_queue> queue;
    call_journal journal;
    waiter<std::error_code> wake;

    std::unique_ptr<broker_session> session;
    std::optional<failure> closed;
    time_point connected_at{};
    time_point not_before{}; // the broker wants no queued message until then

    std::map<std::string, known> components;      // by path
    std::map<std::string, newest_message> newest; // by topic
    std::deque<std::string> waiting;              // topics of these, as they became so
    std::map<std::string, inlet> inlets;          // by service
    std::deque<message> answers;                  // that wait
    struct none {};
    using sent_message = std::variant<none, std::string, std::uint64_t, message>; // topic, number, answer
    std::map<int, sent_message> sent;                                             // by token
    std::size_t calls = 0;                                                        // now
    std::uint32_t topics = 0;
    bridge_status counts;
    std::uint64_t told_dropped = 0;
    bool told_full = false;
    log_limiter quiet;

    void note(const std::string& what) {
        if (auto left_out = quiet.admit(self.now()))
            self.log().warning(what, {{"left_out", std::to_string(*left_out)}});
    }
    std::string topic_below(std::string_view rest) const { return fmt::format("{}/{}", options.prefix, rest); }

    // --- the system --------------------------------------------------------------------------------------------------

    void show(known& of, const std::string& path, const dynamic_contract& service) {
        service_place place{path, service.name()};
        if (service.kind() == service_kind::request_response) {
            if (!options.allow_calls) return;
            of.callables[service.name()] = std::make_shared<callable>(path, service, options.protobuf);
            return;
        }
        if (is_action(*service.types())) return; // to subscribe would start a run
        if (topics >= max_topics) {
            note(fmt::format("'{}/{}' is not sent: there are {} topics already (max_topics)", path, service.name(),
                             max_topics));
            return;
        }
        auto topic = topic_of(options.prefix, "out", place);
        auto schema_topic = topic_of(options.prefix, "schema", place);
        if (!topic || !schema_topic) {
            note((topic ? schema_topic : topic).error().message());
            return;
        }
        auto made = std::make_shared<source>(path, service, options.protobuf);
        made->topic = std::move(*topic);
        made->queued = is_one_of(options.queued, service.name());
        ++topics;
        of.sources[service.name()] = made;
        if (const auto* type = made->codec.message()) {
            made->schema_topic = std::move(*schema_topic);
            newest_message about;
            about.what.topic = made->schema_topic;
            about.what.payload = std::string(as_text(type->descriptors()));
            about.what.retain = about.plain = true;
            about.content_type = "application/protobuf";
            about.user.emplace_back("message", type->name());
            put(std::move(about));
        }
        self.spawn(fmt::format("send {}/{}", path, service.name()), feed(shared_from_this(), made));
    }

    void hide(known& of, const std::string& name) {
        of.services.erase(name);
        of.callables.erase(name);
        auto found = of.sources.find(name);
        if (found == of.sources.end()) return;
        auto gone = found->second;
        of.sources.erase(found);
        --topics;
        gone->withdrawn = true;
        if (gone->leave) gone->leave();
        if (!gone->schema_topic.empty()) forget_retained(gone->schema_topic);
        if (!options.retain) return;
        if (gone->queued) { // behind its packets
            queued_message nothing;
            nothing.topic = gone->topic;
            nothing.retain = true;
            nothing.published = self.wall();
            queue->push(std::move(nothing), self.now(), self.wall());
        } else {
            forget_retained(gone->topic);
        }
        pump();
    }
    void forget_retained(const std::string& topic) {
        newest_message nothing;
        nothing.what.topic = topic;
        nothing.what.retain = nothing.plain = true;
        put(std::move(nothing));
    }

    static std::string text_of(const service_info& service) {
        auto made = fmt::format("{}", service.kind);
        for (const auto& packet : service.packets) made += "\n" + packet.schema;
        return made;
    }

    void on_described(const std::string& path, const component_info& about) {
        for (const auto& service : about.services) take_inlet(path, service);
        if (!options.has(path)) return;
        auto& of = components[path];
        std::map<std::string, std::string> now;
        for (const auto& service : about.services)
            if (options.has(service)) now[service.name] = text_of(service);
        for (const auto& [name, types] : std::map(of.services))
            if (auto still = now.find(name); still == now.end() || still->second != types) hide(of, name);
        for (const auto& service : about.services) {
            if (!options.has(service) || !of.services.emplace(service.name, now[service.name]).second) continue;
            auto contract = contract_of(service);
            std::string why = contract ? "" : contract.error().message();
            try {
                if (contract) show(of, path, *contract);
            } catch (const error& refused) { // a type that protobuf cannot have
                why = refused.what();
            }
            if (!why.empty()) note(fmt::format("'{}/{}' is not sent: {}", path, service.name, why));
        }
    }

    void on_gone(const std::string& path) {
        auto found = components.find(path);
        if (found == components.end()) return;
        for (const auto& [name, types] : std::map(found->second.services)) hide(found->second, name);
        components.erase(found);
    }

    // The types of its packets are those of a component that uses the service.
    void take_inlet(const std::string& path, const service_info& service) {
        if (!is_one_of(options.publish, service.name) ||
            service.kind != static_cast<std::uint8_t>(service_kind::subscription))
            return;
        auto contract = contract_of(service);
        if (!contract || is_action(*contract->types())) return;
        const auto type = contract->packet(role::published).fingerprint();
        if (auto found = inlets.find(service.name); found != inlets.end()) {
            if (found->second.type != type)
                note(fmt::format("'{}' uses other packets of '{}' than the bridge learnt from another component: it "
                                 "gets what can be adapted",
                                 path, service.name));
            return;
        }
        try {
            auto out = publish_dynamic(self, *contract);
            auto& made =
                inlets.try_emplace(service.name, contract->packet(role::published), options.protobuf).first->second;
            made.out = std::move(out);
            made.type = type;
            self.log().info("MQTT clients may publish", {{"service", service.name}, {"as_used_by", path}});
        } catch (const error& refused) {
            note(fmt::format("'{}' is not provided: {}", service.name, refused.what()));
        }
    }

    static task<> feed(std::shared_ptr<state> me, std::shared_ptr<source> from) {
        auto who = me->self.at(from->path);
        auto terms = from->queued ? subscribe_options::lossless(subscription_depth) : subscribe_options::latest();
        terms.last_value = !from->queued; // an earlier life may have sent it
        duration pause = first_pause;
        bool before = false;
        while (!from->withdrawn) {
            auto request = default_packet(from->contract.packet(role::subscribe_request));
            auto made = co_await subscribe_dynamic(who, from->contract, std::move(request), terms);
            if (from->withdrawn) break;
            std::string problem;
            if (made) {
                pause = first_pause;
                before = true;
                me->settle(*from, {});
                // Held here, so that it is not destroyed while it is awaited.
                auto held = std::make_shared<dynamic_stream>(std::move(*made));
                from->leave = [held] { held->leave(); };
                struct ending {
                    source& mine;
                    ~ending() { mine.leave = nullptr; }
                } guard{*from};
                for (;;) {
                    auto packet = co_await held->next();
                    if (!packet || from->withdrawn) break;
                    if (from->queued && packet.lost_before() != 0) me->gap(*from, packet.lost_before());
                    me->take(*from, *packet, packet.published_at().value_or(me->self.wall()));
                }
                if (held->ended()) problem = held->cause().message();
            } else {
                problem = made.error().message();
            }
            if (from->withdrawn) break;
            if (from->queued && before) me->gap(*from, std::nullopt);
            me->settle(*from, problem);
            co_await me->self.sleep(pause);
            pause = std::min(2 * pause, most_pause);
        }
    }
    void gap(const source& of, std::optional<std::uint64_t> lost) {
        counts.gaps += lost.value_or(1);
        note(fmt::format("{} packets of '{}/{}' did not reach the bridge", lost ? std::to_string(*lost) : "some",
                         of.path, of.contract.name()));
    }
    void settle(source& of, const std::string& problem) {
        if (of.problem == problem) return;
        of.problem = problem;
        if (!problem.empty())
            note(fmt::format("'{}/{}' cannot be subscribed to: {}", of.path, of.contract.name(), problem));
    }

    void take(const source& from, const dynamic_packet& packet, wall_time at) {
        auto payload = from.codec.encode(packet);
        if (!payload || payload->size() > max_message_bytes) {
            ++counts.dropped;
            note(fmt::format("a packet of '{}/{}' is not sent: {}", from.path, from.contract.name(),
                             payload ? fmt::format("it has {} bytes, {} at most (max_message_bytes)", payload->size(),
                                                   max_message_bytes)
                                     : payload.error().message()));
            return;
        }
        queued_message made;
        made.topic = from.topic;
        made.payload = std::move(*payload);
        made.retain = options.retain;
        made.published = at;
        if (from.queued) {
            queue->push(std::move(made), self.now(), self.wall());
        } else {
            made.number = queue->take_number(self.wall());
            newest_message one;
            one.what = std::move(made);
            put(std::move(one));
        }
        pump();
    }

    // --- to the broker -----------------------------------------------------------------------------------------------

    void put(newest_message one) {
        one.came = self.now();
        auto& here = newest[one.what.topic];
        if (here.waiting && !here.plain) ++counts.replaced;
        one.waiting = true;
        one.in_flight = here.in_flight;
        if (!here.waiting) waiting.push_back(one.what.topic);
        here = std::move(one);
    }

    // Metadata of a packet: user properties, or an envelope in MQTT 3.1.1, which has none.
    message packet_message(const queued_message& what, time_point came, bool sent_before, bool from_disk) {
        message made;
        made.topic = what.topic;
        made.retain = what.retain;
        const bool old = from_disk || came < connected_at;
        counts.history += old;
        counts.resent += sent_before;
        if (what.payload.empty() && what.retain && !options.protobuf) return made; // the end of a retained message
        if (!options.broker.version_5) {
            made.payload = fmt::format(R"({{"published":"{}","number":{},"history":{},"resent":{},"packet":{}}})",
                                       utc_text(what.published), what.number, old, sent_before, what.payload);
            return made;
        }
        made.payload = what.payload;
        made.content_type = options.protobuf ? "application/protobuf" : "application/json";
        made.user.emplace_back("published", utc_text(what.published));
        made.user.emplace_back("number", std::to_string(what.number));
        if (old) made.user.emplace_back("history", "true");
        if (sent_before) made.user.emplace_back("resent", "true");
        return made;
    }

    /// Sends; what cannot be sent at all is given up. Whether to go on.
    bool send(const message& what, sent_message as) {
        auto token = session->publish(what);
        if (token) {
            sent.emplace(*token, std::move(as));
            return true;
        }
        if (token.error().code() == errc::peer_lost) return false;
        refuse(std::move(as), token.error());
        return true;
    }

    void pump() {
        while (session && !closed && !answers.empty() && sent.size() < max_unconfirmed) {
            auto one = std::move(answers.front());
            answers.pop_front();
            if (!send(one, one)) {
                answers.push_front(std::move(one));
                return;
            }
        }
        for (auto left = waiting.size(); session && !closed && left > 0; --left) {
            auto topic = std::move(waiting.front());
            waiting.pop_front();
            auto& one = newest[topic];
            if (one.in_flight) { // the newest then
                waiting.push_back(std::move(topic));
                continue;
            }
            message made;
            if (one.plain) {
                made.topic = topic;
                made.payload = one.what.payload;
                made.retain = true;
                made.content_type = one.content_type;
                made.user = one.user;
            } else {
                made = packet_message(one.what, one.came, false, false);
            }
            one.waiting = false;
            one.in_flight = true;
            if (!send(made, topic)) {
                one.waiting = true;
                one.in_flight = false;
                waiting.push_back(std::move(topic));
                return;
            }
        }
        while (session && !closed && self.now() >= not_before) {
            const auto* one = queue->next();
            if (!one) break;
            const auto number = one->what.number;
            auto made = packet_message(one->what, one->came, one->sent_before, one->from_disk);
            queue->sent(number);
            if (!send(made, number)) return;
        }
    }

    // Confirmed, or given up.
    void settle(const sent_message& what) {
        if (const auto* number = std::get_if<std::uint64_t>(&what)) queue->done(*number);
        if (const auto* topic = std::get_if<std::string>(&what)) {
            auto found = newest.find(*topic);
            if (found == newest.end()) return;
            found->second.in_flight = false;
            if (!found->second.waiting && found->second.what.payload.empty()) newest.erase(found);
        }
    }
    void refuse(sent_message what, const failure& why) {
        ++counts.refused;
        auto of = std::holds_alternative<std::string>(what) ? std::get<std::string>(what) : std::string("a message");
        counts.trouble = fmt::format("{} is refused: {}", of, why.message());
        note(counts.trouble);
        settle(what);
    }

    void on_confirmed(int token, const std::optional<failure>& why, bool later) {
        auto found = sent.find(token);
        if (found == sent.end()) return;
        auto what = std::move(found->second);
        sent.erase(found);
        if (!why) {
            ++counts.messages;
            settle(what);
        } else if (later && std::holds_alternative<std::uint64_t>(what)) {
            counts.trouble = why->message();
            note(fmt::format("the broker does not want a message now, it is sent again: {}", why->message()));
            queue->again(std::get<std::uint64_t>(what));
            not_before = saturating_add(self.now(), refused_pause);
        } else {
            refuse(std::move(what), *why);
        }
        pump();
    }

    session_events events() {
        session_events made;
        made.received = [this](message what) { take(std::move(what)); };
        made.confirmed = [this](int token, const std::optional<failure>& why, bool later) {
            on_confirmed(token, why, later);
        };
        made.not_subscribed = [this](const std::string&, const failure& why) {
            counts.trouble = why.message();
            note(why.message());
        };
        made.closed = [this](const failure& why) {
            closed = why;
            wake.resume({});
        };
        return made;
    }

    void begin(std::unique_ptr<broker_session> made) {
        session = std::move(made);
        connected_at = self.now();
        not_before = {};
        ++counts.connections;
        counts.trouble.clear();
        self.log().info("connected to the broker", {{"broker", options.broker.url}});
        message online = broker.will;
        online.payload = "online";
        send(online, none{});
        if (options.allow_calls) listen_to(topic_below("call/#"));
        if (!options.publish.empty()) listen_to(topic_below("in/+"));
        for (auto& [topic, one] : newest) { // the broker may have forgotten what it retained
            if (one.waiting || (!one.plain && !options.retain)) continue;
            one.waiting = true;
            waiting.push_back(topic);
        }
        pump();
        if (options.on_connected) options.on_connected(options.broker.url);
    }
    void listen_to(const std::string& filter) {
        if (auto done = session->subscribe(filter); !done) {
            counts.trouble = done.error().message();
            note(counts.trouble);
        }
    }

    void end() {
        session.reset();
        queue->lost();
        std::deque<message> back;
        for (auto& [token, what] : sent) {
            if (auto* topic = std::get_if<std::string>(&what)) {
                auto found = newest.find(*topic);
                if (found == newest.end()) continue;
                found->second.in_flight = false;
                if (!std::exchange(found->second.waiting, true)) waiting.push_back(*topic);
            }
            if (auto* answer = std::get_if<message>(&what)) back.push_back(std::move(*answer));
        }
        for (auto& one : answers) back.push_back(std::move(one));
        answers = std::move(back);
        sent.clear();
    }

    static task<> stay_connected(std::shared_ptr<state> me) {
        duration pause = first_pause;
        bool usable = false; // the options
        for (;;) {
            me->closed.reset();
            auto broker = me->broker;
            auto events = me->events();
            auto made = co_await me->options.connect(me->self, std::move(broker), std::move(events));
            if (made) {
                usable = true;
                me->begin(std::move(*made));
                while (!me->closed) co_await me->wake.wait(); // throws what it is resumed with
                if (me->self.now() - me->connected_at >= steady) pause = first_pause;
                me->end();
                me->counts.trouble = me->closed->message();
            } else {
                if (made.error().code() == errc::invalid_argument && !usable) throw error(made.error());
                usable = true;
                me->counts.trouble = made.error().message();
            }
            me->note(fmt::format("no connection to the broker, it is tried again: {}", me->counts.trouble));
            co_await me->self.sleep(pause);
            pause = std::min(2 * pause, most_pause);
        }
    }

    // --- from the broker ---------------------------------------------------------------------------------------------

    void take(message what) {
        if (what.retain) { // nobody knows how old it is
            ++counts.not_published;
            note(fmt::format("a retained message of {} is not heeded: send without retain", readable(what.topic)));
            return;
        }
        if (what.topic.starts_with(topic_below("call/"))) return take_call(std::move(what));
        take_published(what);
    }

    void take_published(const message& what) {
        auto fail = [&](const std::string& why) {
            ++counts.not_published;
            note(fmt::format("a message of {} is not published: {}", readable(what.topic.substr(0, 200)), why));
        };
        auto begin = topic_below("in/");
        if (!what.topic.starts_with(begin)) return fail("it belongs to no service");
        auto service = unescape(std::string_view(what.topic).substr(begin.size()));
        if (!service) return fail(service.error().message());
        if (!is_one_of(options.publish, *service)) return fail("nobody may publish there (--publish)");
        auto found = inlets.find(*service);
        if (found == inlets.end())
            return fail(fmt::format("no component uses '{}' yet, so that its packets are unknown", *service));
        auto packet = found->second.codec.decode(what.payload);
        if (!packet) return fail(packet.error().message());
        ++counts.published;
        found->second.out(*packet);
    }

    void answer(const message& asked, const call_outcome& outcome) {
        message made;
        made.topic = asked.response_topic;
        made.correlation = asked.correlation;
        made.payload = outcome.payload;
        made.content_type = outcome.code == "ok" && options.protobuf ? "application/protobuf" : "application/json";
        made.user.emplace_back("code", outcome.code);
        if (!outcome.execution.empty()) made.user.emplace_back("execution", outcome.execution);
        if (answers.size() >= max_answers) {
            ++counts.dropped;
            answers.pop_front();
        }
        answers.push_back(std::move(made));
        pump();
    }
    static call_outcome outcome_of(const failure& why) {
        call_outcome made;
        made.code = name_of(why.code());
        made.execution = name_of(why.executed());
        nlohmann::ordered_json text;
        text["code"] = made.code;
        text["execution"] = made.execution;
        text["text"] = why.message();
        made.payload = text.dump(-1, ' ', false, nlohmann::ordered_json::error_handler_t::replace);
        return made;
    }
    void refuse_call(const message& asked, errc code, std::string why) {
        ++counts.calls_failed;
        answer(asked, outcome_of(failure(code, std::move(why))));
    }

    void take_call(message asked) {
        if (asked.response_topic.empty()) {
            ++counts.not_published;
            note(fmt::format("a request of {} is not executed: it has no response topic (MQTT 5)",
                             readable(asked.topic.substr(0, 200))));
            return;
        }
        if (asked.correlation.size() < min_correlation || asked.correlation.size() > max_correlation)
            return refuse_call(asked, errc::invalid_argument,
                               fmt::format("a request needs correlation data of {} to {} bytes that no other request "
                                           "has, such as a UUID: by it a request that is delivered twice is executed "
                                           "once",
                                           min_correlation, max_correlation));
        auto place = read_topic(options.prefix, "call", asked.topic);
        if (!place) return refuse_call(asked, place.error().code(), place.error().message());
        auto component = components.find(place->path);
        if (component == components.end())
            return refuse_call(asked, errc::no_such_name, fmt::format("the bridge shows no '{}'", place->path));
        auto found = component->second.callables.find(place->service);
        if (found == component->second.callables.end())
            return refuse_call(
                asked, errc::no_such_service,
                fmt::format("the bridge shows no request-response service '{}' of '{}'", place->service, place->path));
        auto request = found->second->request.decode(asked.payload);
        if (!request) return refuse_call(asked, request.error().code(), request.error().message());
        if (calls >= max_calls_at_once)
            return refuse_call(asked, errc::overloaded,
                               fmt::format("{} calls are being made (max_calls_at_once)", calls));
        const auto key = asked.response_topic + '\0' + asked.correlation;
        auto noted = journal.begin(key, asked.topic, asked.payload, self.wall());
        if (!noted)
            return refuse_call(
                asked, errc::io_failed,
                fmt::format("the request cannot be noted, and is not executed: {}", noted.error().message()));
        switch (noted->is) {
            case call_journal::state::fresh: break;
            case call_journal::state::running: ++counts.calls_again; return; // it is answered when it is done
            case call_journal::state::answered: ++counts.calls_again; return answer(asked, noted->outcome);
            case call_journal::state::interrupted:
                ++counts.calls_again;
                return answer(asked, outcome_of(failure(errc::peer_lost,
                                                        "the bridge ended while this request was executed; it is not "
                                                        "executed again",
                                                        execution::unknown)));
            case call_journal::state::other:
                return refuse_call(asked, errc::invalid_argument,
                                   "another request had the same correlation data: each needs its own, such as a UUID");
        }
        ++counts.calls;
        ++calls;
        self.spawn("call " + asked.topic.substr(0, 200),
                   call(shared_from_this(), found->second, std::move(*request), std::move(asked)));
    }

    static task<> call(std::shared_ptr<state> me, std::shared_ptr<callable> service, dynamic_packet request,
                       message asked) {
        struct ending {
            state& of;
            ~ending() { --of.calls; }
        } guard{*me};
        auto deadline = me->options.call_deadline;
        if (asked.expiry_s)
            deadline = std::min<duration>(deadline, std::chrono::seconds(std::max(*asked.expiry_s, 1u)));
        auto provider = me->self.at(service->path);
        auto got = co_await call_dynamic(provider, service->contract, std::move(request), deadline);
        call_outcome outcome;
        if (got) {
            auto payload = service->response.encode(*got);
            if (payload && payload->size() <= max_message_bytes) {
                outcome.code = "ok";
                outcome.payload = std::move(*payload);
            } else {
                outcome = outcome_of(failure(payload ? errc::too_large : payload.error().code(),
                                             payload ? "it was executed, but the response is too large for MQTT "
                                                       "(max_message_bytes)"
                                                     : payload.error().message(),
                                             execution::unknown));
            }
        } else {
            outcome = outcome_of(got.error());
        }
        if (outcome.code != "ok") ++me->counts.calls_failed;
        auto key = asked.response_topic + '\0' + asked.correlation;
        if (auto noted = me->journal.end(key, outcome); !noted)
            me->note(fmt::format("an answer cannot be noted: {}", noted.error().message()));
        me->answer(asked, outcome);
    }

    // --- from time to time -------------------------------------------------------------------------------------------

    void store(time_point older_than) {
        auto done = queue->store(older_than);
        if (!done) {
            counts.trouble = done.error().message();
            note(fmt::format("packets wait in memory only: {}", done.error().message()));
            told_full = true;
        } else if (std::exchange(told_full, false)) {
            self.log().info("packets wait on disk again");
        }
        if (queue->dropped() == told_dropped) return;
        note(fmt::format("{} packets are lost: more wait for the broker than there is room for (--store-mb)",
                         queue->dropped() - told_dropped));
        told_dropped = queue->dropped();
    }

    static task<> look_after(std::shared_ptr<state> me) {
        auto tidied = time_point::min();
        for (;;) {
            co_await me->self.sleep(tick);
            me->store(me->self.now() - tick);
            me->pump();
            if (tidied != time_point::min() && me->self.now() - tidied < tidy_period) continue;
            tidied = me->self.now();
            if (auto done = me->journal.tidy(me->self.wall()); !done) me->note(done.error().message());
        }
    }

    bridge_status status() const {
        auto made = counts;
        made.broker = options.broker.url;
        made.connected = session != nullptr && !closed;
        made.topics = topics;
        made.queued = queue->waiting();
        made.queued_bytes = queue->disk_bytes();
        made.dropped += queue->dropped();
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
    auto db = database::open(name, bridge_schema, std::move(damaged));
    if (!db) throw error(db.error().code(), fmt::format("the store: {} (--store)", db.error().message()));
    auto held = std::make_shared<state>(*this, options_, std::move(*db));
    auto queue = outgoing_queue::open(held->db, options_.queue);
    if (!queue) throw error(queue.error().code(), fmt::format("the store: {} (--store)", queue.error().message()));
    held->queue.emplace(std::move(*queue));
    held->broker = options_.broker;
    if (held->broker.client_id.empty())
        held->broker.client_id =
            fmt::format("ise-{}-{}", escape(env().identity().host_name, false), escape(path(), false));
    held->broker.will.topic = held->topic_below("status");
    held->broker.will.payload = "offline";
    held->broker.will.retain = true;
    struct closing {
        state& mine;
        ~closing() {
            mine.session.reset();
            mine.store(time_point::max());
        }
    } guard{*held};
    provide(status_service, [raw = held.get()](const status_request&) { return raw->status(); });
    system_news news;
    news.described = [raw = held.get()](const std::string& of, component_info about) { raw->on_described(of, about); };
    news.gone = [raw = held.get()](const std::string& of) { raw->on_gone(of); };
    news.trouble = [raw = held.get()](const std::string& what) { raw->note(what); };
    system_watch watch(*this, service_selection(), options_.name_servers, std::move(news));
    spawn("store", state::look_after(held));
    co_await state::stay_connected(held);
}

} // namespace ise::mqtt
