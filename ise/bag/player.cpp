#include <ise/bag/player.hpp>

#include <ise/component/component.hpp>
#include <ise/component/provide_dynamic.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>
#include <ise/naming/services.hpp>
#include <ise/packet/dynamic.hpp>
#include <ise/packet/json.hpp>
#include <ise/service/dynamic.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <atomic>
#include <deque>
#include <functional>
#include <mutex>
#include <utility>

namespace ise::bag {

struct player::shared {
    player_options options;
    summary about;
    std::map<std::uint16_t, std::shared_ptr<const topic>> topics;
    std::vector<std::string> paths;
    time_point start{};
    std::atomic<unsigned> running{0};
    std::atomic<std::uint64_t> packets{0}, answered{0}, unknown{0}, called{0}, compared{0};
    std::mutex mutex;
    std::optional<difference> first;
    std::optional<failure> trouble;

    void differs(difference what) {
        std::lock_guard lock(mutex);
        if (!first) first = std::move(what);
    }
    void broken(failure why) {
        std::lock_guard lock(mutex);
        if (!trouble) trouble = std::move(why);
    }
    bool tested(const std::string& component) const {
        return std::ranges::any_of(options.tested, [&](const auto& one) { return naming::lies_below(component, one); });
    }
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
    // When a message is due; in the n-th round of a loop.
    time_point due(timestamp at, std::uint64_t round) const {
        const auto begin = about.statistics.message_start_time, end = about.statistics.message_end_time;
        auto after = static_cast<double>(at - std::min(begin, at)) +
                     static_cast<double>(round) * static_cast<double>(end - begin + 1);
        auto scaled = after / options.speed;
        constexpr double most = 9e18; // 292 years
        return saturating_add(start, duration(static_cast<std::int64_t>(std::min(scaled, most))));
    }
};

namespace {

// The messages of some topics, as packets.
class packets_of {
public:
    packets_of(const std::string& path, const summary& about, std::function<bool(const channel_record&)> wanted)
        : file_(open_file(path).value()), messages_(*file_, about, filter(std::move(wanted))) {}
    result<std::optional<message_record>> next() { return messages_.next(); }

private:
    static message_filter filter(std::function<bool(const channel_record&)> wanted) {
        message_filter made;
        made.wanted = std::move(wanted);
        return made;
    }
    std::unique_ptr<source> file_;
    message_reader messages_;
};

// The answers that a service gave, by request.
struct answers {
    std::deque<recorded_call> left;
    std::optional<recorded_call> last;
};
using answer_book = std::map<bytes, answers>;

template <class Shared>
result<std::map<std::string, std::shared_ptr<answer_book>>> read_answers(Shared& of, const std::string& component) {
    std::map<std::string, std::shared_ptr<answer_book>> made;
    packets_of in(of.options.file, of.about, [&](const channel_record& channel) {
        auto found = of.topics.find(channel.id);
        return found != of.topics.end() && found->second->component() == component &&
               found->second->what() == content::calls;
    });
    for (;;) {
        auto got = in.next();
        if (!got) return got.error();
        if (!*got) return made;
        const auto& topic = of.topics.at((*got)->channel_id);
        auto raw = topic->packet().decode((*got)->data);
        if (!raw) return raw.error();
        auto call = decode_call(*topic->contract(), *raw);
        if (!call) return call.error();
        auto& book = made[topic->service()];
        if (!book) book = std::make_shared<answer_book>();
        (*book)[call->request].left.push_back(std::move(*call));
    }
}

errc code_named(const std::string& name) {
    for (int code = 1; code <= static_cast<int>(errc::access_denied); ++code)
        if (name_of(static_cast<errc>(code)) == name) return static_cast<errc>(code);
    return errc::handler_failed;
}

// What one played component does.
template <class Shared>
task<> play_component(component& self, std::shared_ptr<Shared> of, std::string recorded_path) {
    std::map<std::string, std::shared_ptr<answer_book>> books;
    {
        auto read = read_answers(*of, recorded_path);
        if (!read) {
            of->broken(read.error());
            --of->running;
            co_return;
        }
        books = std::move(*read);
    }
    std::map<std::uint16_t, dynamic_publication> out;
    std::map<std::string, dynamic_publication> by_service; // a service may have several channels
    for (const auto& [id, topic] : of->topics) {
        if (topic->component() != recorded_path) continue;
        if (topic->what() == content::packets) {
            auto& made = by_service[topic->service()];
            if (!made) made = publish_dynamic(self, *topic->contract());
            out[id] = made;
            continue;
        }
        auto book = books[topic->service()];
        if (!book) continue; // it was never called, or another channel of it came before
        books[topic->service()] = nullptr;
        auto contract = *topic->contract();
        provide_dynamic(self, contract, [of, book, contract](dynamic_packet request) -> result<dynamic_packet> {
            auto found = book->find(bytes(request.encoded().begin(), request.encoded().end()));
            if (found == book->end()) {
                ++of->unknown;
                return failure(errc::refused,
                               fmt::format("the recording has no call of '{}' with this request", contract.name()));
            }
            auto& all = found->second;
            if (!all.left.empty()) {
                all.last = std::move(all.left.front());
                all.left.pop_front();
            }
            ++of->answered;
            if (!all.last->response) return failure(code_named(all.last->outcome), all.last->message);
            return dynamic_packet(contract.packet(role::response), *all.last->response);
        });
    }
    for (std::uint64_t round = 0; round == 0 || of->options.loop; ++round) {
        packets_of in(of->options.file, of->about,
                      [&](const channel_record& channel) { return out.contains(channel.id); });
        bool any = false;
        for (;;) {
            auto got = in.next();
            if (!got) {
                of->broken(got.error());
                break;
            }
            if (!*got) break;
            any = true;
            auto message = **got;
            const auto& topic = of->topics.at(message.channel_id);
            auto raw = topic->packet().decode(message.data);
            if (!raw) {
                of->broken(raw.error());
                break;
            }
            co_await self.sleep_till(of->due(message.log_time, round));
            dynamic_packet packet(topic->contract()->packet(role::published), std::move(*raw));
            out.at(message.channel_id)(packet);
            ++of->packets;
        }
        if (!any) break;
    }
    // Calls are answered until everything was played.
    --of->running;
    for (;;) co_await self.sleep(std::chrono::hours(1));
}

template <class Shared>
task<> make_call(component& self, std::shared_ptr<Shared> of, std::shared_ptr<const topic> which, recorded_call call,
                 std::uint64_t number) {
    auto who = self.at(of->renamed(which->component()));
    const auto& contract = *which->contract();
    dynamic_packet request(contract.packet(role::request), call.request);
    auto got = co_await call_dynamic(who, contract, std::move(request));
    ++of->called;
    difference made;
    made.topic = which->name();
    made.number = number;
    made.recorded = call.response ? to_json(contract.packet(role::response), *call.response)
                                  : fmt::format("{}: {}", call.outcome, call.message);
    made.now = got ? got->to_json() : fmt::format("{}: {}", name_of(got.error().code()), got.error().message());
    ++of->compared;
    bool same = got ? call.response && std::ranges::equal(got->encoded(), *call.response)
                    : call.outcome == name_of(got.error().code());
    if (!same) of->differs(std::move(made));
    --of->running;
}

// Makes the recorded calls to the tested components.
template <class Shared>
task<> make_calls(component& self, std::shared_ptr<Shared> of) {
    packets_of in(of->options.file, of->about, [&](const channel_record& channel) {
        auto found = of->topics.find(channel.id);
        return found != of->topics.end() && found->second->what() == content::calls &&
               of->tested(found->second->component());
    });
    // A call is in the recording when it ended: by the time of its request.
    struct waiting {
        timestamp at;
        std::shared_ptr<const topic> of;
        recorded_call call;
    };
    std::vector<waiting> all;
    for (;;) {
        auto got = in.next();
        if (!got) {
            of->broken(got.error());
            break;
        }
        if (!*got) break;
        const auto& topic = of->topics.at((*got)->channel_id);
        auto raw = topic->packet().decode((*got)->data);
        if (!raw) {
            of->broken(raw.error());
            break;
        }
        auto call = decode_call(*topic->contract(), *raw);
        if (!call) {
            of->broken(call.error());
            break;
        }
        waiting one{(*got)->publish_time, topic, std::move(*call)};
        all.push_back(std::move(one));
    }
    std::ranges::sort(all, {}, [](const auto& one) { return one.at; });
    std::map<const topic*, std::uint64_t> numbers;
    for (auto& one : all) {
        co_await self.sleep_till(of->due(one.at, 0));
        ++of->running;
        auto number = numbers[one.of.get()]++;
        self.spawn("call", make_call(self, of, one.of, std::move(one.call), number));
    }
    --of->running;
}

// Compares what a tested component publishes with the recording, packet by packet.
template <class Shared>
task<> compare(component& self, std::shared_ptr<Shared> of, std::shared_ptr<const topic> which, std::uint16_t channel) {
    const auto& contract = *which->contract();
    const auto& type = contract.packet(role::published);
    packets_of in(of->options.file, of->about, [&](const channel_record& one) { return one.id == channel; });
    auto who = self.at(of->renamed(which->component()));
    auto terms = subscribe_options::lossless(4096);
    auto request = default_packet(contract.packet(role::subscribe_request));
    auto stream = co_await subscribe_dynamic(who, contract, std::move(request), terms);
    const auto end = saturating_add(of->due(of->about.statistics.message_end_time, 0), of->options.settle);
    bool over = false;
    timer late(self.on(), [&] {
        over = true;
        if (stream) stream->leave();
    });
    late.arm(end);
    for (std::uint64_t number = 0;; ++number) {
        auto got = in.next();
        if (!got) {
            of->broken(got.error());
            break;
        }
        if (!*got) break; // it may publish more than was recorded
        auto raw = which->packet().decode((*got)->data);
        if (!raw) {
            of->broken(raw.error());
            break;
        }
        difference made;
        made.topic = which->name();
        made.number = number;
        made.recorded = to_json(type, *raw);
        if (!stream) {
            made.now = stream.error().message();
            of->differs(std::move(made));
            break;
        }
        auto packet = co_await stream->next();
        if (!packet) {
            if (!over) made.now = stream->cause().message();
            of->differs(std::move(made));
            break;
        }
        ++of->compared;
        if (std::ranges::equal(packet->encoded(), *raw)) continue;
        made.now = packet->to_json();
        of->differs(std::move(made));
        break;
    }
    --of->running;
}

template <class Shared>
task<> test_components(component& self, std::shared_ptr<Shared> of) {
    for (const auto& [id, topic] : of->topics) {
        if (topic->what() != content::packets || !of->tested(topic->component())) continue;
        ++of->running;
        self.spawn("compare " + topic->name(), compare(self, of, topic, id));
    }
    co_await make_calls(self, of);
    for (;;) co_await self.sleep(std::chrono::hours(1));
}

} // namespace

std::string difference::text() const {
    auto shown = [](const std::string& what) { return what.empty() ? std::string("nothing") : what; };
    return fmt::format("{}, number {}: {} in the recording, {} now", topic, number, shown(recorded), shown(now));
}

player::player(node& in, player_options options) : shared_(std::make_shared<shared>()) {
    auto& self = *shared_;
    self.options = std::move(options);
    if (!(self.options.speed > 0 && self.options.speed <= 1e9))
        throw error(errc::invalid_argument, "a recording is played at a speed above 0");
    auto file = open_file(self.options.file).value();
    self.about = read_summary(*file).value();
    if (self.about.damage)
        throw error(errc::malformed,
                    fmt::format("{}; ise bag recover makes a whole file of it", self.about.damage->message()));
    std::vector<std::string> components;
    bool tests = false, any = false;
    for (const auto& [id, channel] : self.about.channels) {
        auto made = topic::of(channel);
        if (!made) {
            if (channel.metadata.contains("ise.content")) throw error(made.error());
            continue; // another program's
        }
        if (made->what() == content::events || !self.chosen(*made)) continue;
        any = true;
        tests = tests || self.tested(made->component());
        if (!self.tested(made->component())) components.push_back(made->component());
        self.topics.emplace(id, std::make_shared<const topic>(std::move(*made)));
    }
    if (!any)
        throw error(
            errc::invalid_argument,
            fmt::format("{} has no packets or calls of ISE that are to be played; ise bag info lists its topics",
                        self.options.file));
    std::ranges::sort(components);
    components.erase(std::unique(components.begin(), components.end()), components.end());
    self.start = saturating_add(in.env().now(), self.options.delay);
    self.running = static_cast<unsigned>(components.size()) + (tests ? 1 : 0);
    for (const auto& path : components) {
        auto under = self.renamed(path);
        self.paths.push_back(under);
        component_options where;
        where.listen = self.options.listen;
        in.start(
            under, [of = shared_, path](component& on) { return play_component(on, of, path); }, where);
    }
    if (tests) {
        component_options quiet;
        quiet.listens = false;
        quiet.registers = false;
        in.start(
            "ise/player", [of = shared_](component& on) { return test_components(on, of); }, quiet);
    }
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
