#include "mission.hpp"

#include "processes.hpp"
#include "serial_wire.hpp"

#include <apps/stress/wire_relay.hpp>
#include <components/boat_simulator/services.hpp>
#include <components/gui_client/gui_client.hpp>
#include <components/http/stream_http_client.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <algorithm>
#include <map>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr const char* script_path = "atirma/script";
constexpr int samples_wanted = 40;
constexpr ise::duration shortest_long = 20min; // what is shorter has a plan of its own
// A modem's bytes wait in the pseudo-terminal of a proxy that is dead already, or open no port yet.
constexpr ise::duration before_death = 1s, after_birth = 2s;

struct event {
    ise::duration at{};
    std::function<void()> what;
};

} // namespace

/// Does what the plan says, when it says it.
class mission::script final : public ise::component {
public:
    explicit script(mission& of) : of_(of) {}

private:
    ise::task<> run() override;
    ise::task<bool> see_the_boat();
    ise::task<> learn();
    void begin(const fault& what);
    void end(const fault& what);
    void take_sample();
    bool nothing_owed();
    std::vector<event> timetable();

    mission& of_;
    std::map<trouble, std::size_t> open_;
};

ise::task<> mission::script::run() {
    bool there = co_await see_the_boat();
    if (!there) {
        of_.trouble_ = "no telemetry reached the operators: the deployment did not come up";
        of_.ask(task::over);
        co_return;
    }
    // The plan begins now, and its times are told from the beginning of everything.
    auto first = of_.elapsed();
    auto& plan = of_.told_.plan;
    for (auto& one : plan.faults) one.at += first;
    for (auto& person : of_.told_.people)
        for (auto& one : person.orders) one.at += first;
    plan.length += first;
    for (std::size_t i = 0; i < operators; ++i) of_.told_.people[i].may_begin = true;
    for (auto& next : timetable()) {
        co_await sleep_till(of_.began_ + next.at);
        next.what();
    }
    co_await sleep_till(of_.began_ + plan.length);
    auto ended = of_.elapsed();
    for (bool calm = nothing_owed(); !calm && of_.elapsed() - ended < of_.options_.longest_calm; calm = nothing_owed())
        co_await sleep(1s);
    of_.told_.calm = of_.elapsed() - ended;
    co_await learn();
    of_.ask(task::over);
}

ise::task<bool> mission::script::see_the_boat() {
    auto nodes = at(std::string(communication_role));
    auto until = now() + of_.options_.longest_start;
    while (now() < until) {
        track_request any;
        any.max_packets = 1;
        auto page = co_await nodes.try_call(services::track, any, 5s);
        if (page && !page->packets.empty()) co_return true;
        co_await sleep(500ms);
    }
    co_return false;
}

/// What only others know in the end: the boat how far it sailed, the page what it has shown.
ise::task<> mission::script::learn() {
    try {
        auto truths = co_await at("atirma/boat").subscribe(services::truth, ise::subscribe_options::latest());
        auto truth = co_await truths.next();
        if (truth) of_.told_.sailed_m = static_cast<double>(truth->distance_sailed_m);
    } catch (const ise::error& problem) {
        if (problem.code() == ise::errc::cancelled) throw;
    }
    if (of_.options_.page.empty()) co_return;
    stream_http_client client(on());
    http_exchange ask;
    ask.url = "http://" + of_.options_.page + "/api/status";
    auto answer = co_await client.exchange(ask, 20s);
    auto told = nlohmann::json::parse(answer ? answer->body : std::string(), nullptr, false);
    if (told.is_discarded() || !told.contains("packets")) {
        of_.trouble_ = "the page does not tell what it has shown";
        co_return;
    }
    const auto& packets = told["packets"];
    of_.told_.page.received = packets.value("received", std::uint64_t{0});
    of_.told_.page.duplicates = packets.value("duplicates", std::uint64_t{0});
    of_.told_.page.malformed = packets.value("malformed", std::uint64_t{0});
}

std::vector<event> mission::script::timetable() {
    std::vector<event> all;
    const auto& plan = of_.told_.plan;
    for (const auto& one : plan.faults) {
        all.push_back({one.at, [this, one] { begin(one); }});
        if (one.length.count() > 0) all.push_back({one.at + one.length, [this, one] { end(one); }});
    }
    for (int i = 1; i < samples_wanted; ++i)
        all.push_back({plan.length / samples_wanted * i, [this] { take_sample(); }});
    std::erase_if(all, [&](const auto& one) { return one.at < of_.elapsed(); });
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.at < b.at; });
    return all;
}

void mission::script::begin(const fault& what) {
    auto at = of_.elapsed();
    auto& told = of_.told_;
    open_[what.what] = told.episodes.size();
    told.episodes.push_back({at, what.length.count() > 0 ? ise::duration(-1ns) : at, std::string(describe(what.what)),
                             felt_over(what.what), what.what == trouble::boat_killed});
    auto doing = deed_of(what.what);
    if (what.what == trouble::operator_away) of_.ask(task::leave);
    else if (!doing.process.empty()) of_.options_.say("kill " + doing.process);
    if (doing.begin) of_.director_->let(doing.begin);
}

void mission::script::end(const fault& what) {
    of_.told_.episodes[open_.at(what.what)].until = of_.elapsed();
    auto doing = deed_of(what.what);
    if (what.what == trouble::operator_away) of_.ask(task::come);
    else if (!doing.process.empty()) of_.options_.say("start " + doing.process);
    if (doing.end) of_.director_->let(doing.end);
}

/// Of the processes that the first console sees; this one keeps a ledger of everything, and is no part of it.
void mission::script::take_sample() {
    sample one;
    one.at = of_.elapsed();
    std::set<std::uint64_t> processes;
    auto consoles = of_.consoles();
    for (const auto& console : consoles) {
        auto shown = console->latest()->present;
        if (!shown) continue;
        for (const auto& there : *shown) processes.insert(there.process_id);
    }
    processes.erase(env().identity().process_id);
    measure(one, processes);
    of_.told_.samples.push_back(one);
}

bool mission::script::nothing_owed() {
    auto verdict = of_.judge();
    return verdict.missing.size() == verdict.excused && verdict.only_on_one == 0 &&
           std::ranges::all_of(verdict.subscribers, [](const auto& one) { return one.second.missed == 0; });
}

mission::mission(ise::node& in, mission_options options)
    : node_(in), options_(std::move(options)), began_(in.env().now()) {
    told_.seed = options_.seed;
    told_.virtual_clock = false;
    told_.wind = options_.wind;
    told_.began = in.env().wall();
    told_.plan = options_.length < shortest_long ? make_short_plan(options_.seed, options_.length)
                                                 : make_plan(options_.seed, options_.length);
    // Two processes of one machine cannot be parted.
    std::erase_if(told_.plan.faults, [](const auto& one) { return one.what == trouble::nodes_parted; });
    for (std::size_t i = 0; i < operators; ++i) {
        auto& one = told_.people[i];
        one.name = i == 0 ? "ana" : "ben";
        one.index = i;
        one.may_begin = false;
        for (const auto& order : told_.plan.orders)
            if (order.by == i) one.orders.push_back(order);
    }
}

mission::~mission() = default;

ise::duration mission::elapsed() const { return node_.env().now() - began_; }

ise::component_options mission::beside_script() const {
    ise::component_options made;
    made.together_with = script_path;
    return made;
}

std::array<std::shared_ptr<console::operator_port>, operators> mission::consoles() {
    std::lock_guard lock(mutex_);
    return consoles_;
}

void mission::ask(task what) {
    std::lock_guard lock(mutex_);
    tasks_.push(what);
    asked_.notify_one();
}

void mission::start_lines() {
    auto time = [this] { return elapsed(); };
    for (const auto& one : options_.lines) {
        auto make = [this, time, which = one.which]() -> std::unique_ptr<tap> {
            if (which == "boat") return tap_boat_xbee(book_, time);
            if (which == "shore") return tap_shore_xbee(book_, time);
            return tap_iridium(book_, time);
        };
        node_.start<serial_wire>("atirma/wire/" + one.which, beside_script(), one.link, one.device, make);
    }
    // Both ends of both: `ready` is said when all of them are there.
    auto where = std::make_shared<std::map<std::string, std::string>>();
    std::size_t wanted = (options_.carrier_tcp.empty() ? 0u : 1u) + (options_.carrier_udp.empty() ? 0u : 1u);
    auto listening = [this, where, wanted](const ise::endpoint& at) {
        (*where)[std::string(ise::name_of(at.kind))] = at.text();
        if (where->size() < wanted) return;
        std::string line = "ready";
        for (const auto& [kind, text] : *where) line += " " + text;
        options_.say(line);
    };
    auto make = [this, time] { return tap_gprs(book_, time, numbers_); };
    if (!options_.carrier_tcp.empty())
        node_.start<wire_relay>("atirma/wire/gprs-tcp", beside_script(), "tcp://127.0.0.1:0", options_.carrier_tcp, make,
                                listening);
    if (!options_.carrier_udp.empty())
        node_.start<datagram_wire>("atirma/wire/gprs-udp", beside_script(), "udp://127.0.0.1:0", options_.carrier_udp,
                                   make, listening);
}

void mission::start_operator(std::size_t which) {
    const auto& name = told_.people[which].name;
    console::gui_client_options options;
    options.name_server = options_.names;
    {
        std::lock_guard lock(mutex_);
        consoles_[which] = options.port;
    }
    node_.start<console::gui_client>("atirma/console/" + name, beside_script(), options);
    node_.start<operator_seat>("atirma/desk/" + name, beside_script(), told_.people[which], book_,
                               [this] { return elapsed(); }, options.port);
}

void mission::stop_operator(std::size_t which) {
    const auto& name = told_.people[which].name;
    std::array paths{"atirma/desk/" + name, "atirma/console/" + name};
    for (const auto& path : paths) node_.stop(path);
    auto gone = [&] {
        return std::ranges::none_of(node_.components(), [&](const auto& one) {
            return std::ranges::count(paths, one.path) != 0 && one.state < ise::component_state::stopped;
        });
    };
    // The lock is free meanwhile; what is asked for stays in the queue.
    std::unique_lock lock(mutex_);
    while (!gone()) asked_.wait_for(lock, 20ms);
}

bool mission::sail() {
    ise::component_options alone;
    alone.listens = false;
    alone.registers = false;
    node_.start<script>(script_path, alone, *this);
    director_ = &node_.start<director>("atirma/director", beside_script());
    start_lines();
    for (std::size_t i = 0; i < operators; ++i) start_operator(i);
    for (;;) {
        std::unique_lock lock(mutex_);
        asked_.wait(lock, [this] { return !tasks_.empty() || node_.all_stopped(); });
        if (tasks_.empty()) {
            trouble_ = "it was ended before its time";
            return false;
        }
        auto next = tasks_.front();
        tasks_.pop();
        lock.unlock();
        if (next == task::leave) stop_operator(0);
        else if (next == task::come) start_operator(0);
        else break;
    }
    return trouble_.empty();
}

ledger::verdict mission::judge() {
    std::array<std::set<packet_key>, 2> disks;
    for (std::size_t i = 0; i < disks.size(); ++i) {
        auto disk = database::open_to_read(options_.stores.at(i));
        disks[i] = keys_on(disk.value());
    }
    return book_.judge(disks, told_.plan.length, excuse_for_xbee(told_.episodes, before_death, after_birth));
}

account mission::story() {
    auto made = told_;
    for (std::size_t i = 0; i < operators; ++i) made.consoles.push_back(view_of(told_.people[i].name, *consoles_[i]));
    auto disk = database::open_to_read(options_.stores.at(0));
    made.packets = packets_on(disk.value());
    return made;
}

} // namespace atirma::stress
