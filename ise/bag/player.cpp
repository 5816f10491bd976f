#include <ise/bag/player.hpp>

#include <ise/component/component.hpp>
#include <ise/component/introspection.hpp>
#include <ise/component/names_watch.hpp>
#include <ise/component/provide_dynamic.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>
#include <ise/naming/services.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/packet/json.hpp>
#include <ise/service/dynamic.hpp>

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <set>
#include <utility>

namespace ise::bag {
namespace {

constexpr duration presence_check = std::chrono::milliseconds(5);
constexpr duration subscribe_again = std::chrono::milliseconds(5);
constexpr duration call_preparation = std::chrono::seconds(30);

// A call of the recording.
struct known_call {
    timestamp at = 0; // the request
    std::shared_ptr<const topic> of;
    std::uint64_t number = 0; // on its topic
    recorded_call call;
};

// The answers that a service gave, by request.
struct answers {
    std::deque<known_call> left;
    std::optional<known_call> last;
};
using answer_book = std::map<bytes, answers>;

// Messages of some topics, from a time of the recording on.
class messages_of {
public:
    messages_of(const std::string& path, const summary& about, std::function<bool(const channel_record&)> wanted,
                timestamp from = 0)
        : file_(open_file(path).value()), messages_(*file_, about, filter(std::move(wanted), from)) {}
    result<std::optional<message_record>> next() { return messages_.next(); }

private:
    static message_filter filter(std::function<bool(const channel_record&)> wanted, timestamp from) {
        message_filter made;
        made.wanted = std::move(wanted);
        made.from = from;
        return made;
    }
    std::unique_ptr<source> file_;
    message_reader messages_;
};

// The path of who called: "atirma/console (tcp://…)"; empty: it had none.
std::string path_of(const std::string& caller) {
    auto path = caller.substr(0, caller.find(" ("));
    return naming::is_path(path) ? path : std::string();
}

errc code_named(const std::string& name) {
    for (int code = 1; code <= static_cast<int>(errc::access_denied); ++code)
        if (name_of(static_cast<errc>(code)) == name) return static_cast<errc>(code);
    return errc::handler_failed;
}

} // namespace

struct player::shared {
    shared(node& on, player_options how) : in(on), options(std::move(how)), ignored(options.ignored) {}

    node& in;
    player_options options;
    ignored_fields ignored;
    summary about;
    std::map<std::uint16_t, std::shared_ptr<const topic>> topics;
    std::vector<std::string> components; // that are played, under their recorded paths
    std::vector<std::string> paths;
    std::map<std::string, std::map<std::string, answer_book>> books; // by component and service
    std::map<std::string, std::vector<known_call>> calls; // to tested components, by the component that calls
    std::set<std::string> registered;                     // names that are there now, in the virtual world
    time_point start{};
    std::atomic<unsigned> running{0};
    std::atomic<std::uint64_t> packets{0}, answered{0}, unknown{0}, called{0}, compared{0};
    std::mutex mutex;
    std::optional<difference> first;
    std::optional<failure> trouble;

    bool as_recorded() const noexcept { return options.on_tested != nullptr; }
    void differs(difference what) {
        std::lock_guard lock(mutex);
        if (!first || what.at < first->at) first = std::move(what);
    }
    void broken(failure why) {
        std::lock_guard lock(mutex);
        if (!trouble) trouble = std::move(why);
    }
    bool tested(const std::string& component) const {
        return std::ranges::any_of(options.tested, [&](const auto& one) { return naming::lies_below(component, one); });
    }
    bool compares(const topic& one) const { return !ignored.has(one.service(), "*"); }
    bool chosen(const topic& one) const {
        return options.only.empty() || std::ranges::any_of(options.only, [&](const auto& prefix) {
                   return naming::lies_below(one.name(), prefix);
               });
    }
    std::string renamed(const std::string& path) const {
        for (const auto& [from, to] : options.as)
            if (naming::lies_below(path, from)) return to + path.substr(from.size());
        return path;
    }
    duration scaled(double nanoseconds) const {
        constexpr double most = 9e18; // 292 years
        return duration(static_cast<std::int64_t>(std::min(nanoseconds / options.speed, most)));
    }
    // When a message is due; in the n-th round of a loop.
    time_point due(timestamp at, std::uint64_t round = 0) const {
        const auto begin = about.statistics.message_start_time, end = about.statistics.message_end_time;
        auto after = static_cast<double>(at - std::min(begin, at));
        if (round > 0) after += static_cast<double>(round) * static_cast<double>(end - begin + 1);
        if (options.speed == 1 && round == 0) // exactly
            return saturating_add(start, duration(static_cast<std::int64_t>(at - std::min(begin, at))));
        return saturating_add(start, scaled(after));
    }
    time_point to_be_sent(timestamp at, std::uint64_t round = 0) const { return due(at, round) - options.latency; }
    // The time of the recording that is played now.
    timestamp recorded_now() const {
        const auto passed = static_cast<double>((in.env().now() - start).count()) * options.speed;
        return about.statistics.message_start_time + (passed > 0 ? static_cast<timestamp>(passed) : 0);
    }
};

namespace {

// Counts something that runs, which may be cancelled.
template <class Shared>
class running_part {
public:
    explicit running_part(std::shared_ptr<Shared> of) : of_(std::move(of)) { ++of_->running; }
    ~running_part() { --of_->running; }
    running_part(const running_part&) = delete;
    running_part& operator=(const running_part&) = delete;

private:
    std::shared_ptr<Shared> of_;
};

// Reads the calls of the recording: the answers of played components, and what is asked of tested ones.
template <class Shared>
result<void> read_calls(Shared& of) {
    messages_of in(of.options.file, of.about, [&](const channel_record& channel) {
        auto found = of.topics.find(channel.id);
        return found != of.topics.end() && found->second->what() == content::calls;
    });
    std::vector<known_call> all;
    for (;;) {
        auto next = in.next();
        if (!next) return next.error();
        if (!*next) break;
        const auto& topic = of.topics.at((*next)->channel_id);
        auto raw = topic->packet().decode((*next)->data);
        if (!raw) return raw.error();
        auto call = decode_call(*topic->contract(), *raw);
        if (!call) return call.error();
        known_call one;
        one.at = (*next)->publish_time;
        one.of = topic;
        one.number = all.size();
        one.call = std::move(*call);
        all.push_back(std::move(one));
    }
    // A call is in the file by the time of its answer.
    std::ranges::sort(all, {}, [](const known_call& one) { return std::pair(one.at, one.number); });
    std::map<std::string, std::uint64_t> numbers;
    for (auto& one : all) {
        one.number = numbers[one.of->name()]++;
        const auto caller = path_of(one.call.caller);
        const bool from_tested = !caller.empty() && of.tested(caller);
        if (!of.tested(one.of->component())) {
            if (of.as_recorded() && !from_tested) continue; // nobody makes it
            auto& book = of.books[one.of->component()][one.of->service()];
            book[one.call.request].left.push_back(std::move(one));
            continue;
        }
        if (from_tested) continue; // they make it themselves
        of.calls[of.as_recorded() ? caller : std::string()].push_back(std::move(one));
    }
    return {};
}

template <class Shared>
task<dynamic_packet> answer(component& self, std::shared_ptr<Shared> of, answer_book& book,
                            std::shared_ptr<const topic> which, dynamic_packet request) {
    auto found = book.find(bytes(request.encoded().begin(), request.encoded().end()));
    const bool more = found != book.end() && (!found->second.left.empty() || !of->as_recorded());
    if (!more) {
        ++of->unknown;
        if (of->as_recorded() && of->compares(*which)) {
            difference made;
            made.at = of->recorded_now();
            made.component = which->component();
            made.service = which->service();
            made.what = "request";
            made.number = of->answered;
            made.now = request.to_json();
            of->differs(std::move(made));
        }
    }
    if (found == book.end())
        throw error(errc::refused,
                    fmt::format("the recording has no call of '{}' with this request", which->service()));
    auto& all = found->second;
    if (!all.left.empty()) {
        all.last = std::move(all.left.front());
        all.left.pop_front();
    }
    ++of->answered;
    const auto call = all.last->call; // the next request may change it meanwhile
    co_await self.sleep(of->scaled(static_cast<double>(call.took.count())));
    if (!call.response) throw error(code_named(call.outcome), call.message);
    co_return dynamic_packet(all.last->of->contract()->packet(role::response), *call.response);
}

template <class Shared>
task<> make_call(component& self, std::shared_ptr<Shared> of, known_call what) {
    running_part<Shared> counted(of);
    const auto& which = *what.of;
    auto who = self.at(of->renamed(which.component()));
    const auto& contract = *which.contract();
    dynamic_packet request(contract.packet(role::request), what.call.request);
    auto deadline = of->scaled(static_cast<double>(what.call.deadline.count()));
    auto answered = co_await call_dynamic(who, contract, std::move(request), deadline);
    ++of->called;
    ++of->compared;
    if (!of->compares(which)) co_return;
    difference made;
    made.at = what.at;
    made.component = which.component();
    made.service = which.service();
    made.what = "call";
    made.number = what.number;
    const auto& type = contract.packet(role::response);
    if (answered && what.call.response) {
        auto found = compare_packets(type, *what.call.response, answered->encoded(), which.service(), of->ignored);
        if (!found) co_return;
        made.field = std::move(found->field);
        made.recorded = std::move(found->recorded);
        made.now = std::move(found->now);
    } else {
        if (!answered && !what.call.response && what.call.outcome == name_of(answered.error().code())) co_return;
        made.recorded = what.call.response ? to_json(type, *what.call.response)
                                           : fmt::format("{}: {}", what.call.outcome, what.call.message);
        made.now = answered ? answered->to_json()
                            : fmt::format("{}: {}", name_of(answered.error().code()), answered.error().message());
    }
    of->differs(std::move(made));
}

// Connects, so that the first call does not come later by that.
task<> meet(remote who) {
    describe_request question;
    co_await who.try_call(describe_service, question, call_preparation);
}

// Makes the recorded calls of one component to the tested ones.
template <class Shared>
task<> make_calls(component& self, std::shared_ptr<Shared> of, std::string caller) {
    auto found = of->calls.find(caller);
    if (found == of->calls.end()) co_return;
    std::map<std::string, remote> met; // held, with their sessions
    for (const auto& one : found->second) {
        if (one.at < of->recorded_now()) continue; // before it came
        auto [who, fresh] = met.try_emplace(one.of->component(), self.at(of->renamed(one.of->component())));
        if (fresh) self.spawn("meet " + one.of->component(), meet(who->second));
        co_await self.sleep_till(of->to_be_sent(one.at));
        self.spawn("call", make_call(self, of, one));
    }
}

// A service as it is offered at present. It has several channels where its packets changed during the recording.
struct offer {
    std::shared_ptr<const topic> as;
    dynamic_publication out; // of a subscription
};
using offers = std::map<std::string, offer>; // by service

bool alike(const topic& a, const topic& b) {
    return &a == &b || a.contract()->types()->fingerprints == b.contract()->types()->fingerprints;
}

// When a service changes its contract between two uses: what went before has been sent, and its users come back in
// time.
time_point halfway(time_point now, time_point next) { return next > now ? now + (next - now) / 2 : now; }

// Reads from the recording what a component publishes.
template <class Shared>
messages_of packets_of(const Shared& of, const std::string& component, timestamp from) {
    return messages_of(
        of.options.file, of.about,
        [&](const channel_record& channel) {
            auto found = of.topics.find(channel.id);
            return found != of.topics.end() && found->second->what() == content::packets &&
                   found->second->component() == component;
        },
        from);
}

// The subscriptions of a component, each as its next packet has it.
template <class Shared>
result<offers> subscriptions_of(const Shared& of, const std::string& component, timestamp from) {
    offers made;
    for (const auto& [id, topic] : of.topics) // channels have their numbers in the order of their first packets
        if (topic->component() == component && topic->what() == content::packets)
            made.try_emplace(topic->service(), offer{topic, {}});
    if (from == 0) return made;
    auto in = packets_of(of, component, from);
    for (std::set<std::string> seen; seen.size() < made.size();) {
        auto next = in.next();
        if (!next) return next.error();
        if (!*next) break;
        const auto& topic = of.topics.at((*next)->channel_id);
        if (seen.insert(topic->service()).second) made.at(topic->service()).as = topic;
    }
    return made;
}

// The time of the recording from which a component is played on.
template <class Shared>
timestamp beginning(component& self, const Shared& of) {
    return of.as_recorded() && self.now() > of.start ? of.recorded_now() : 0;
}

// Publishes the packets of a component.
template <class Shared>
task<> publish_packets(component& self, std::shared_ptr<Shared> of, const std::string& path, offers& all) {
    for (std::uint64_t round = 0; round == 0 || of->options.loop; ++round) {
        auto in = packets_of(*of, path, beginning(self, *of));
        bool any = false;
        for (;;) {
            auto next = in.next();
            if (!next) {
                of->broken(next.error());
                co_return;
            }
            if (!*next) break;
            any = true;
            auto message = **next;
            const auto& topic = of->topics.at(message.channel_id);
            auto raw = topic->packet().decode(message.data);
            if (!raw) {
                of->broken(raw.error());
                co_return;
            }
            const auto when = of->to_be_sent(message.log_time, round);
            auto& [as, out] = all.at(topic->service());
            if (!alike(*as, *topic)) {
                co_await self.sleep_till(halfway(self.now(), when));
                out.end(failure(errc::peer_lost,
                                fmt::format("'{}' was updated in the recording: subscribe again", topic->service())));
                self.withdraw(*as->contract());
                out = publish_dynamic(self, *topic->contract());
            }
            as = topic;
            co_await self.sleep_till(when);
            dynamic_packet packet(topic->contract()->packet(role::published), std::move(*raw));
            out(packet);
            ++of->packets;
        }
        if (!any) break;
    }
}

template <class Shared>
void provide_recorded(component& self, std::shared_ptr<Shared> of, answer_book& book,
                      std::shared_ptr<const topic> which) {
    provide_dynamic(self, *which->contract(), [&self, of, &book, which](dynamic_packet request) {
        return answer(self, of, book, which, std::move(request));
    });
}

// Provides a service under the contracts that its calls have.
template <class Shared>
task<> change_contracts(component& self, std::shared_ptr<Shared> of, answer_book& book,
                        std::shared_ptr<const topic> as) {
    std::vector<std::pair<timestamp, std::shared_ptr<const topic>>> calls;
    for (const auto& [request, all] : book)
        for (const auto& call : all.left) calls.emplace_back(call.at, call.of);
    std::ranges::sort(calls, {}, [](const auto& call) { return call.first; });
    if (std::ranges::all_of(calls, [&](const auto& call) { return alike(*call.second, *as); })) co_return;
    for (std::uint64_t round = 0; round == 0 || of->options.loop; ++round) {
        time_point before = self.now();
        for (const auto& [at, next] : calls) {
            const auto when = of->to_be_sent(at, round);
            if (!alike(*as, *next)) {
                co_await self.sleep_till(halfway(before, when));
                self.withdraw(*as->contract());
                as = next;
                provide_recorded(self, of, book, as);
            }
            before = when;
        }
    }
}

// What one played component does.
template <class Shared>
task<> play_component(component& self, std::shared_ptr<Shared> of, std::string recorded_path) {
    auto& books = of->books.at(recorded_path);
    auto out = subscriptions_of(*of, recorded_path, beginning(self, *of)).value();
    for (auto& [service, one] : out) one.out = publish_dynamic(self, *one.as->contract());
    std::set<std::string> provided;
    for (const auto& [id, topic] : of->topics) {
        if (topic->component() != recorded_path || topic->what() != content::calls) continue;
        if (!provided.insert(topic->service()).second) continue; // another channel of it came before
        auto& book = books[topic->service()];
        provide_recorded(self, of, book, topic);
        self.spawn("contracts of " + topic->service(), change_contracts(self, of, book, topic));
    }
    if (of->as_recorded()) self.spawn("calls", make_calls(self, of, recorded_path));
    co_await publish_packets(self, of, recorded_path, out);
    // Calls are answered until everything was played.
    if (!of->as_recorded()) --of->running;
    for (;;) co_await self.sleep(std::chrono::hours(1));
}

// Compares what a tested component publishes with the recording, packet by packet. Where the packets of the service
// changed in the recording, they change in the comparison.
template <class Shared>
task<> compare(component& self, std::shared_ptr<Shared> of, std::shared_ptr<const topic> which) {
    running_part<Shared> counted(of);
    messages_of in(of->options.file, of->about, [&](const channel_record& one) {
        auto found = of->topics.find(one.id);
        return found != of->topics.end() && found->second->what() == content::packets &&
               found->second->name() == which->name();
    });
    auto who = self.at(of->renamed(which->component()));
    auto terms = subscribe_options::lossless(4096);
    const auto end = saturating_add(of->due(of->about.statistics.message_end_time), of->options.settle);
    result<dynamic_stream> stream = failure(errc::no_such_name, "it was not there");
    bool over = false;
    timer late(self.on(), [&] {
        over = true;
        if (stream) stream->unsubscribe();
    });
    late.arm(end);
    for (std::uint64_t number = 0;; ++number) {
        auto next = in.next();
        if (!next) {
            of->broken(next.error());
            co_return;
        }
        if (!*next) co_return; // it may publish more than was recorded
        const auto before = std::exchange(which, of->topics.at((*next)->channel_id));
        const auto& contract = *which->contract();
        const auto& type = contract.packet(role::published);
        const bool changed = !alike(*before, *which);
        terms.last_value = !changed; // else it was compared already
        if (changed) stream = failure(errc::peer_lost, "its packets changed in the recording");
        auto raw = which->packet().decode((*next)->data);
        if (!raw) {
            of->broken(raw.error());
            co_return;
        }
        difference made;
        made.at = (*next)->publish_time;
        made.component = which->component();
        made.service = which->service();
        made.what = "packet";
        made.number = number;
        received<dynamic_packet> packet;
        while (!packet) {
            // A subscription that waits for a name tries again after longer and longer times.
            while (!stream && !over && of->as_recorded() && !of->registered.contains(of->renamed(which->component())))
                co_await self.sleep(presence_check);
            if (!stream && !over) stream = co_await subscribe_dynamic(who, contract, terms);
            if (stream) packet = co_await stream->next();
            if (packet) break;
            auto why = stream ? stream->cause() : stream.error();
            if (over || !(of->as_recorded() || changed)) {
                made.recorded = to_json(type, *raw);
                if (!over || changed) made.now = why.message();
                of->differs(std::move(made));
                co_return;
            }
            stream = why; // it went as it did in the recording: it comes again
            terms.last_value = true;
            co_await self.sleep(subscribe_again);
        }
        ++of->compared;
        auto found = compare_packets(type, *raw, packet->encoded(), which->service(), of->ignored);
        if (!found) continue;
        made.field = std::move(found->field);
        made.recorded = std::move(found->recorded);
        made.now = std::move(found->now);
        of->differs(std::move(made));
        co_return;
    }
}

// --- who comes and goes ---------------------------------------------------------------------------------------------

struct coming {
    timestamp at = 0;
    std::string path;
    bool there = false;
};

// From the names in the recording. A component that they do not tell of was there all the time.
template <class Shared>
result<std::vector<coming>> comings_of(Shared& of) {
    std::vector<coming> made;
    std::map<std::string, std::uint64_t> incarnations; // of those that are there
    messages_of in(of.options.file, of.about,
                   [](const channel_record& channel) { return channel.topic == std::string("ise/") + names_topic; });
    std::map<std::uint16_t, topic> known;
    for (;;) {
        auto next = in.next();
        if (!next) return next.error();
        if (!*next) return made;
        auto id = (*next)->channel_id;
        if (!known.contains(id)) {
            auto parsed = topic::of(of.about.channels.at(id));
            if (!parsed) return parsed.error();
            known.emplace(id, std::move(*parsed));
        }
        const auto& names = known.at(id);
        auto raw = names.packet().decode((*next)->data);
        if (!raw) return raw.error();
        name_event event;
        try {
            event = dynamic_packet(names.packet().of(), std::move(*raw)).template as<name_event>();
        } catch (const error& thrown) {
            return thrown.why();
        }
        const auto at = event.change == "present" ? 0 : (*next)->log_time;
        auto was = incarnations.find(event.path);
        const bool gone = event.change == "removed";
        if (was != incarnations.end() && (gone || was->second != event.incarnation)) {
            made.push_back({at, event.path, false});
            incarnations.erase(was);
        }
        if (!gone && incarnations.emplace(event.path, event.incarnation).second) made.push_back({at, event.path, true});
    }
}

template <class Shared>
void begin_component(std::shared_ptr<Shared> of, const std::string& path) {
    component_options where;
    where.listen = of->options.listen;
    of->in.start(
        of->renamed(path), [of, path](component& on) { return play_component(on, of, path); }, where);
}

template <class Shared>
bool runs(Shared& of, const std::string& path) {
    const auto all = of.in.components();
    return std::ranges::any_of(
        all, [&](const auto& one) { return one.path == path && one.state < component_state::stopped; });
}

template <class Shared>
task<> bring(component& self, std::shared_ptr<Shared> of, std::string path) {
    while (runs(*of, of->renamed(path))) co_await self.sleep(presence_check);
    begin_component(of, path);
}

// Everything outside of the tested components comes and goes as it did.
template <class Shared>
task<> follow_names(component& self, std::shared_ptr<Shared> of, std::vector<coming> events) {
    for (const auto& one : events) {
        if (one.at != 0) co_await self.sleep_till(of->to_be_sent(one.at));
        if (of->tested(one.path)) {
            of->options.on_tested(one.path, one.there);
        } else if (std::ranges::binary_search(of->components, one.path)) {
            if (one.there) self.spawn("bring " + one.path, bring(self, of, one.path));
            else of->in.stop(of->renamed(one.path));
        }
    }
}

// What the recording has and tested components did not ask for.
template <class Shared>
void note_missing_calls(Shared& of) {
    const auto settle = static_cast<timestamp>(of.options.settle.count());
    for (const auto& [component, services] : of.books)
        for (const auto& [service, book] : services)
            for (const auto& [request, all] : book) {
                if (all.left.empty()) continue;
                const auto& one = all.left.front();
                if (!of.compares(*one.of) || one.at + settle > of.about.statistics.message_end_time) continue;
                difference made;
                made.at = one.at;
                made.component = component;
                made.service = service;
                made.what = "request";
                made.number = one.number;
                made.recorded = to_json(one.of->contract()->packet(role::request), one.call.request);
                of.differs(std::move(made));
            }
}

template <class Shared>
task<> watch_registered(component& self, std::shared_ptr<Shared> of) {
    auto on_names = [of](const naming::name_events& news) {
        for (const auto& one : news.events) {
            if (one.what == naming::name_change::removed) of->registered.erase(one.name.path);
            else of->registered.insert(one.name.path);
        }
    };
    return watch_names(self, of->in.options().name_servers, on_names, {});
}

template <class Shared>
task<> test_components(component& self, std::shared_ptr<Shared> of, std::vector<coming> events) {
    {
        running_part<Shared> counted(of);
        --of->running; // that of the constructor
        std::set<std::string> compared;
        for (const auto& [id, topic] : of->topics)
            if (topic->what() == content::packets && of->tested(topic->component()) && of->compares(*topic) &&
                compared.insert(topic->name()).second)
                self.spawn("compare " + topic->name(), compare(self, of, topic));
        if (of->as_recorded()) {
            self.spawn("registered names", watch_registered(self, of));
            self.spawn("names", follow_names(self, of, std::move(events)));
        }
        co_await make_calls(self, of, std::string());
        if (of->as_recorded()) {
            const auto end = of->due(of->about.statistics.message_end_time);
            co_await self.sleep_till(saturating_add(end, of->options.settle));
            note_missing_calls(*of);
        }
    }
    for (;;) co_await self.sleep(std::chrono::hours(1));
}

} // namespace

player::player(node& in, player_options options) : shared_(std::make_shared<shared>(in, std::move(options))) {
    auto& self = *shared_;
    if (!(self.options.speed > 0 && self.options.speed <= 1e9))
        throw error(errc::invalid_argument, "a recording is played at a speed above 0");
    auto file = open_file(self.options.file).value();
    self.about = read_summary(*file).value();
    if (self.about.damage)
        throw error(errc::malformed,
                    fmt::format("{}; ise bag recover makes a whole file of it", self.about.damage->message()));
    bool tests = false, any = false;
    for (const auto& [id, channel] : self.about.channels) {
        auto made = topic::of(channel);
        if (!made) {
            if (channel.metadata.contains("ise.content")) throw error(made.error());
            continue; // another program's
        }
        if (made->what() == content::events || made->what() == content::runs || !self.chosen(*made)) continue;
        any = true;
        tests = tests || self.tested(made->component());
        if (!self.tested(made->component())) self.books[made->component()];
        self.topics.emplace(id, std::make_shared<const topic>(std::move(*made)));
    }
    if (!any)
        throw error(
            errc::invalid_argument,
            fmt::format("{} has no packets or calls of ISE that are to be played; ise bag info lists its topics",
                        self.options.file));
    if ((self.as_recorded() || !self.options.tested.empty()) && !tests)
        throw error(errc::invalid_argument, fmt::format("{} has nothing of {}; ise bag info lists its topics",
                                                        self.options.file, fmt::join(self.options.tested, ", ")));
    if (auto read = read_calls(self); !read) throw error(read.error());
    for (const auto& [caller, calls] : self.calls)
        if (!caller.empty()) self.books[caller]; // it is there to call, whether it provides anything or not
    for (const auto& [path, book] : self.books) {
        self.components.push_back(path); // in order
        self.paths.push_back(self.renamed(path));
    }
    std::vector<coming> events;
    if (self.as_recorded()) {
        auto read = comings_of(self);
        if (!read) throw error(read.error());
        events = std::move(*read);
        for (const auto* all : {&self.components, &self.options.tested})
            for (const auto& path : *all)
                if (std::ranges::none_of(events, [&](const auto& one) { return one.path == path; }))
                    events.insert(events.begin(), {0, path, true});
    }
    self.start = saturating_add(in.env().now(), self.options.delay);
    self.running = static_cast<unsigned>(self.as_recorded() ? 0 : self.components.size()) + (tests ? 1 : 0);
    if (!self.as_recorded())
        for (const auto& path : self.components) begin_component(shared_, path);
    if (!tests) return;
    component_options quiet;
    quiet.listens = false;
    quiet.registers = false;
    in.start(
        "ise/player", [of = shared_, events](component& on) { return test_components(on, of, events); }, quiet);
}
player::~player() = default;

bool player::done() const noexcept { return shared_->running == 0; }
std::optional<failure> player::trouble() const {
    std::lock_guard lock(shared_->mutex);
    return shared_->trouble;
}
std::optional<difference> player::first_difference() const {
    std::lock_guard lock(shared_->mutex);
    return shared_->first;
}
player_counts player::counts() const noexcept {
    player_counts made;
    made.packets = shared_->packets;
    made.answered = shared_->answered;
    made.unknown = shared_->unknown;
    made.called = shared_->called;
    made.compared = shared_->compared;
    return made;
}
const std::vector<std::string>& player::paths() const noexcept { return shared_->paths; }

} // namespace ise::bag
