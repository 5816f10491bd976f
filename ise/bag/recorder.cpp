#include <ise/bag/recorder.hpp>

#include <ise/component/discover.hpp>
#include <ise/component/introspection.hpp>
#include <ise/component/names_watch.hpp>
#include <ise/component/parameter_services.hpp>
#include <ise/component/served_calls.hpp>
#include <ise/component/served_runs.hpp>
#include <ise/core/endpoint.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/log_limiter.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/core/time_text.hpp>
#include <ise/naming/services.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <deque>
#include <exception>
#include <limits>
#include <map>
#include <set>
#include <utility>

namespace ise::bag {
namespace {

constexpr duration write_period = std::chrono::milliseconds(50);
constexpr duration question_limit = std::chrono::seconds(5);
constexpr std::size_t message_overhead = 160; // of one in the queue, beside its bytes

timestamp nanoseconds(wall_time at) noexcept {
    auto count = at.time_since_epoch().count();
    return count < 0 ? 0 : static_cast<timestamp>(count);
}

bool below_any(const std::vector<std::string>& prefixes, const std::string& path) {
    return prefixes.empty() ||
           std::ranges::any_of(prefixes, [&](const auto& one) { return naming::lies_below(path, one); });
}

bool contains(const std::vector<std::string>& all, const std::string& one) {
    return std::ranges::find(all, one) != all.end();
}

} // namespace

struct recorder_core::state : std::enable_shared_from_this<state> {
    state(component& of, recorder_options how) : self(of), options(std::move(how)), file(with_numbers(options)) {
        gaps = std::make_shared<const topic>(gaps_topic, schema_of<gap_event>());
        names = std::make_shared<const topic>(names_topic, schema_of<name_event>());
        parameters = std::make_shared<const topic>(parameters_topic, schema_of<parameter_event>());
    }

    static recording_options with_numbers(const recorder_options& of) {
        auto made = of.files;
        made.numbered = made.numbered || of.ring > duration{};
        return made;
    }

    component& self;
    recorder_options options;
    recorder_counts counts;
    recording_file file; // on another thread while `writing`
    std::shared_ptr<const topic> gaps, names, parameters;
    std::map<std::string, std::shared_ptr<const topic>> topics; // by name
    std::set<std::string> present;                              // paths
    std::set<std::string> followed;                             // services, by topic
    std::map<const topic*, std::uint32_t> sequences;
    string_map reasons; // of triggers, by their times: to be written
    std::vector<recorded_message> queue;
    std::size_t queue_size = 0;
    std::size_t triggered_size = 0; // of that, the former ring: it has its own limit
    std::map<std::string, std::pair<gap_event, std::uint64_t>> unwritten; // lost here, by topic
    std::deque<recorded_message> ring;
    std::size_t ring_size = 0;
    time_point record_until = time_point::min(); // with a ring
    bool close_file = false;                     // the ring begins again
    bool finishing = false;
    bool first_names = true;
    log_limiter quiet; // of packets that are refused

    bool in_ring() const { return options.ring > duration{} && self.now() >= record_until; }

    // --- messages ---------------------------------------------------------------------------------------------------

    static std::size_t size_of(const recorded_message& one) { return one.packet.size() + message_overhead; }

    void put(recorded_message one) {
        if (finishing) return; // what comes while the last batch is written would begin another file
        if (in_ring()) {
            ring_size += size_of(one);
            auto oldest = one.log_time - std::min(one.log_time, static_cast<timestamp>(options.ring.count()));
            ring.push_back(std::move(one));
            while (!ring.empty() && (ring.front().log_time < oldest || ring_size > options.ring_bytes)) {
                ring_size -= size_of(ring.front());
                ring.pop_front();
            }
            return;
        }
        if (queue_size - triggered_size + size_of(one) > options.queue_bytes) {
            auto& [event, count] = unwritten[one.of->name()];
            event.component = one.of->component();
            event.service = one.of->service();
            event.reason = "the disk is too slow for the recording (queue_bytes)";
            ++count;
            ++counts.lost;
            return;
        }
        queue_size += size_of(one);
        queue.push_back(std::move(one));
    }

    void put(const std::shared_ptr<const topic>& of, bytes packet, timestamp published, std::uint64_t lost_before = 0) {
        recorded_message one;
        auto& sequence = sequences[of.get()];
        sequence += static_cast<std::uint32_t>(lost_before);
        one.sequence = sequence++;
        one.log_time = nanoseconds(self.wall());
        one.publish_time = published ? published : one.log_time;
        one.of = of;
        one.packet = std::move(packet);
        put(std::move(one));
    }

    template <class Event>
    void note(const std::shared_ptr<const topic>& of, const Event& event) {
        put(of, encode(event), 0);
    }

    void note_gap(const topic& of, std::optional<std::uint64_t> lost, std::string reason) {
        ++counts.gaps;
        gap_event event;
        event.component = of.component();
        event.service = of.service();
        event.lost = lost;
        event.reason = std::move(reason);
        note(gaps, event);
    }

    // What did not find room is counted as soon as there is some.
    void note_unwritten() {
        auto all = std::exchange(unwritten, {});
        for (auto& [name, what] : all) {
            what.first.lost = what.second;
            ++counts.gaps;
            recorded_message one;
            one.of = gaps;
            one.sequence = sequences[gaps.get()]++;
            one.log_time = one.publish_time = nanoseconds(self.wall());
            one.packet = encode(what.first);
            queue_size += size_of(one);
            queue.push_back(std::move(one)); // beyond the limit: there is one for each service
        }
    }

    bool trigger(const std::string& reason) {
        if (options.ring == duration{}) return false;
        self.log().info(fmt::format("the recording of the last {} s is written: {}",
                                    std::chrono::duration<double>(options.ring).count(), reason));
        if (in_ring()) {
            ++counts.triggered;
            reasons[iso_8601(self.wall(), 3)] = reason;
            for (auto& one : ring) queue.push_back(std::move(one));
            ring.clear();
            queue_size += ring_size;
            triggered_size += std::exchange(ring_size, 0);
        }
        record_until = saturating_add(self.now(), options.after);
        return true;
    }

    void look_for_trigger(const std::string& what) {
        if (options.triggers.empty() || !contains(options.triggers, what)) return;
        trigger(what);
    }

    // --- writing ----------------------------------------------------------------------------------------------------

    // Packets that no file can have, or the present one has no room for: they are lost, and the others are not.
    struct refused_packets {
        std::uint64_t count = 0;
        std::string first;
    };

    // Outside of the loop. The first failure that is not one of a single packet.
    result<void> write(std::vector<recorded_message>& batch, const string_map& why, timestamp now, bool flush,
                       bool close, refused_packets& refused) {
        for (const auto& one : batch) {
            auto done = file.write(one);
            if (done) continue;
            const auto& problem = done.error();
            if (problem.code() != errc::malformed && problem.code() != errc::too_large) return done;
            if (refused.count++ == 0) refused.first = problem.message();
        }
        if (!why.empty())
            if (auto done = file.note("ise.trigger", why, now); !done) return done;
        if (close) return file.close();
        return flush ? file.flush() : result<void>();
    }

    void note_refused(const refused_packets& what) {
        if (auto left_out = quiet.admit(self.now()))
            self.log().warning(fmt::format("{} packet{} not recorded: {}", what.count,
                                           what.count == 1 ? " was" : "s were", what.first),
                               {{"left_out", std::to_string(*left_out)}});
    }

    task<> write_all() {
        auto flushed = self.now();
        if (options.ring == duration{}) { // a path that cannot be written is reported at once
            result<void> begun;
            auto begin = [this, now = nanoseconds(self.wall())] { return file.begin(now); };
            begun = co_await self.offload(std::move(begin));
            if (!begun) throw error(begun.error());
            counts.files = file.counts().files;
        }
        for (;;) {
            const bool last = finishing;
            if (queue.empty() || last) note_unwritten();
            auto batch = std::exchange(queue, {});
            const auto why = std::exchange(reasons, {});
            const auto batch_bytes = queue_size, triggered_bytes = triggered_size;
            const bool close = last || (close_file && in_ring());
            const bool flush = self.now() - flushed >= options.flush;
            if (!batch.empty() || !why.empty() || flush || close) {
                if (flush) flushed = self.now();
                if (close) close_file = false;
                refused_packets refused;
                result<void> done;
                auto work = [this, &batch, &why, now = nanoseconds(self.wall()), flush, close, &refused] {
                    return write(batch, why, now, flush, close, refused);
                };
                done = co_await self.offload(std::move(work));
                if ((!batch.empty() || !why.empty()) && !close && options.ring > duration{}) close_file = true;
                queue_size -= batch_bytes;
                triggered_size -= triggered_bytes;
                counts.lost += refused.count;
                if (refused.count > 0) note_refused(refused);
                counts.messages = file.counts().messages;
                counts.bytes = file.counts().bytes;
                counts.files = file.counts().files;
                if (!done) throw error(done.error());
            }
            if (last) co_return;
            co_await self.sleep(write_period);
        }
    }

    // The component stops, where nothing can be awaited any more: what has come is written while its loop waits.
    void write_rest() {
        note_unwritten();
        refused_packets refused;
        if (auto done = write(queue, std::exchange(reasons, {}), nanoseconds(self.wall()), true, true, refused); !done)
            self.log().warning(fmt::format("the end of the recording was not written: {}", done.error().message()));
        queue.clear();
    }

    // --- what there is ----------------------------------------------------------------------------------------------

    bool wanted(const service_info& service) const {
        if (!service.provided || service.kind != static_cast<std::uint8_t>(service_kind::subscription)) return false;
        if (contains(options.except, service.name)) return false;
        if (!options.services.empty()) return contains(options.services, service.name);
        return options.own_services || !service.name.starts_with("ise.");
    }

    void on_names(const naming::name_events& news) {
        for (const auto& one : news.events) {
            const auto& name = one.name;
            if (!below_any(options.paths, name.path)) continue;
            name_event event;
            event.change = one.what == naming::name_change::removed ? "removed"
                           : first_names                            ? "present"
                           : one.what == naming::name_change::added ? "added"
                                                                    : "changed";
            event.path = name.path;
            event.type = name.type;
            event.state = name.state;
            event.host = name.host_name;
            event.process_id = name.process_id;
            event.incarnation = name.incarnation;
            event.endpoints = name.endpoints;
            note(names, event);
            if (one.what == naming::name_change::removed) {
                present.erase(name.path);
                look_for_trigger("gone:" + name.path);
                continue;
            }
            present.insert(name.path);
            if (name.path == self.path()) continue; // not itself
            self.spawn("follow " + name.path, follow(shared_from_this(), name.path));
        }
        first_names = false;
    }

    // Asks a component for its services, and records each that is not recorded yet.
    static task<> follow(std::shared_ptr<state> me, std::string path) {
        auto& self = me->self;
        auto who = self.at(path);
        describe_request question;
        auto reply = co_await who.try_call(describe_service, question, question_limit);
        if (!reply) {
            self.log().warning(fmt::format("'{}' is not recorded yet: {}", path, reply.error().message()));
            co_return;
        }
        for (const auto& service : reply->services) {
            auto name = fmt::format("{}/{}", path, service.name);
            const bool calls = service.provided && service.name == served_calls_service.name() && me->options.calls;
            const bool runs = service.provided && service.name == served_runs_service.name() && me->options.calls;
            if ((!calls && !runs && !me->wanted(service)) || !me->followed.insert(name).second) continue;
            auto contract = contract_of(service);
            if (!contract) {
                self.log().warning(fmt::format("'{}' is not recorded: {}", name, contract.error().message()));
                continue;
            }
            if (is_action(*contract->types())) { // to subscribe would start a run
                if (!has_runs(*reply))
                    self.log().info(fmt::format("'{}' is not recorded: it is an action, and its component shows no "
                                                "runs ({}=1)",
                                                name, record_calls_variable));
                continue;
            }
            if (calls) self.spawn("calls of " + path, record_calls(me, path, *reply));
            else if (runs) self.spawn("runs of " + path, record_runs(me, path, *reply));
            else self.spawn("record " + name, record(me, path, *contract));
        }
        const bool has_parameters = std::ranges::any_of(reply->services, [](const auto& service) {
            return service.provided && service.name == parameters_service.name();
        });
        if (has_parameters && me->options.parameters && me->followed.insert(parameters_key(path)).second)
            self.spawn("parameters of " + path, follow_parameters(me, path));
    }

    void note_parameters(const std::string& path, const parameters_response& now) {
        for (const auto& one : now.parameters) {
            parameter_event event;
            event.component = path;
            event.name = one.about.name;
            event.values = one.values;
            event.unit = one.about.unit;
            note(parameters, event);
        }
    }

    // Its parameters as they are, and then each change.
    static task<> follow_parameters(std::shared_ptr<state> me, std::string path) {
        auto who = me->self.at(path);
        auto terms = subscribe_options::keep_last(1024);
        terms.last_value = false;
        subscriber<std::remove_const_t<decltype(parameter_changes_service)>> changes;
        bool follows = true;
        try {
            changes = co_await who.subscribe(parameter_changes_service, terms);
        } catch (const error&) { // of an earlier version
            follows = false;
        }
        parameters_request question;
        auto reply = co_await who.try_call(parameters_service, question, question_limit);
        if (reply) me->note_parameters(path, *reply);
        while (follows) {
            auto changed = co_await changes.next();
            if (!changed) break;
            me->note_parameters(path, *changed);
        }
        me->end(parameters_key(path));
    }
    static std::string parameters_key(const std::string& path) {
        return fmt::format("{}/{}", path, parameters_service.name());
    }

    std::shared_ptr<const topic> topic_of(const std::string& path, const dynamic_contract& service) {
        auto& known = topics[fmt::format("{}/{}", path, service.name())];
        if (!known || known->contract()->types()->fingerprints != service.types()->fingerprints) {
            known = std::make_shared<const topic>(path, service);
            ++counts.topics;
        }
        return known;
    }

    static task<> record(std::shared_ptr<state> me, std::string path, dynamic_contract service) {
        auto& self = me->self;
        auto of = me->topic_of(path, service);
        auto who = self.at(path);
        subscribe_options terms;
        terms.policy = me->options.policy;
        terms.depth = me->options.depth;
        std::optional<failure> why;
        auto stream = co_await subscribe_dynamic(who, service, terms);
        if (!stream) {
            me->note_gap(*of, std::nullopt, "no subscription: " + stream.error().message());
            me->end(of->name());
            co_return;
        }
        for (;;) {
            auto packet = co_await stream->next();
            if (!packet) break;
            auto lost = packet.lost_before();
            if (lost != 0)
                me->note_gap(*of, lost,
                             lost ? "lost on the way, or the recorder was too slow for the subscription (depth)"
                                  : "the provider restarted, or the connection was lost");
            const auto& raw = packet->encoded();
            const auto at = packet.published_at();
            me->put(of, bytes(raw.begin(), raw.end()), at ? nanoseconds(*at) : 0, lost.value_or(0));
            me->look_for_trigger(of->name());
        }
        me->note_gap(*of, std::nullopt, "the subscription ended: " + stream->cause().message());
        me->end(of->name());
    }

    // It is followed anew at the next news of its name.
    void end(const std::string& name) { followed.erase(name); }

    static bool has_runs(const component_info& about) {
        return std::ranges::any_of(about.services, [](const auto& service) {
            return service.provided && service.name == served_runs_service.name();
        });
    }

    // The topics of those services of a component that `is` is true of, by name.
    template <class Is>
    std::map<std::string, std::shared_ptr<const topic>> topics_of(const std::string& path, const component_info& about,
                                                                  Is is) {
        std::map<std::string, std::shared_ptr<const topic>> made;
        for (const auto& service : about.services) {
            if (!service.provided || service.name.starts_with("ise.") || contains(options.except, service.name) ||
                (!options.services.empty() && !contains(options.services, service.name)))
                continue;
            auto contract = contract_of(service);
            if (contract && is(*contract)) made[service.name] = topic_of(path, *contract);
        }
        return made;
    }

    // What a component shows of what it does for others.
    template <class Packet>
    static task<> record_shown(std::shared_ptr<state> me, std::string path, subscription<Packet> from,
                               std::string missed, std::function<void(const Packet&, std::optional<wall_time>)> take) {
        auto terms = subscribe_options::keep_last(4096);
        terms.last_value = false;
        subscriber<subscription<Packet>> shown;
        bool shows = true;
        try {
            auto who = me->self.at(path);
            shown = co_await who.subscribe(from, terms);
        } catch (const error&) { // it has gone meanwhile, or refuses it
            shows = false;
        }
        while (shows) {
            auto packet = co_await shown.next();
            if (!packet) break;
            if (packet.lost_before() != 0) {
                gap_event event;
                event.component = path;
                event.service = std::string(from.name());
                event.lost = packet.lost_before();
                event.reason = missed;
                ++me->counts.gaps;
                me->note(me->gaps, event);
            }
            take(*packet, packet.published_at());
        }
        me->end(fmt::format("{}/{}", path, from.name()));
    }

    static task<> record_calls(std::shared_ptr<state> me, std::string path, component_info about) {
        auto of = me->topics_of(path, about,
                                [](const auto& service) { return service.kind() == service_kind::request_response; });
        auto take = [me, of](const served_call& served, std::optional<wall_time>) {
            auto found = of.find(served.service);
            if (found == of.end()) return;
            recorded_call call;
            call.caller = served.caller;
            call.outcome = served.outcome;
            call.message = served.message;
            call.took = served.took;
            call.deadline = served.deadline;
            call.request = served.request;
            if (served.outcome == "ok") call.response = served.response;
            me->put(found->second, encode_call(call), nanoseconds(served.asked_at));
            me->look_for_trigger(found->second->name());
        };
        return record_shown<served_call>(me, path, served_calls_service, "calls were lost on the way", take);
    }

    static task<> record_runs(std::shared_ptr<state> me, std::string path, component_info about) {
        auto of = me->topics_of(path, about, [](const auto& service) { return is_action(*service.types()); });
        auto take = [me, of](const served_run& served, std::optional<wall_time> at) {
            auto found = of.find(served.action);
            if (found == of.end()) return;
            me->put(found->second, encode_run(served), at ? nanoseconds(*at) : 0);
            me->look_for_trigger(found->second->name());
        };
        return record_shown<served_run>(me, path, served_runs_service, "events of runs were lost on the way", take);
    }
};

recorder_core::recorder_core(component& self, recorder_options options)
    : state_(std::make_shared<state>(self, std::move(options))) {}
recorder_core::~recorder_core() { state_->finishing = true; }

task<> recorder_core::run() {
    auto held = state_;
    auto on_names = [held](const naming::name_events& result) {
        if (!held->finishing) held->on_names(result);
    };
    held->self.spawn("names", watch_names(held->self, held->options.name_servers, on_names, {}));
    std::exception_ptr thrown;
    try {
        co_await held->write_all();
    } catch (...) {
        thrown = std::current_exception();
    }
    if (thrown && is_cancellation(thrown)) held->write_rest();
    if (thrown) std::rethrow_exception(thrown);
}

void recorder_core::finish() { state_->finishing = true; }
bool recorder_core::trigger(const std::string& reason) { return state_->trigger(reason); }
const recorder_counts& recorder_core::counts() const noexcept { return state_->counts; }

task<> recorder::run() {
    recorder_core core(*this, options_);
    provide(trigger_service, [&core](const trigger_request& request) {
        if (!core.trigger(request.reason))
            throw error(errc::refused, "this recorder has no ring: it records all the time (--ring)");
        trigger_response made;
        made.triggered = core.counts().triggered;
        return made;
    });
    provide(recorder_status_service, [&core](const recorder_status_request&) { return core.counts(); });
    co_await core.run();
}

} // namespace ise::bag
