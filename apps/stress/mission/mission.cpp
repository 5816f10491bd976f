#include "mission.hpp"

#include "serial_wire.hpp"

#include <apps/stress/wire_relay.hpp>
#include <components/gui_client/gui_client.hpp>

#include <ise/packet/json.hpp>

#include <algorithm>
#include <fstream>
#include <iterator>
#include <map>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr const char* script_path = "atirma/script";
constexpr ise::duration min_long = 20min; // what is shorter has a plan of its own

/// The view in the file of a window; with the name only where there is no file.
window_view view_of(const mission_options::window& one) {
    std::ifstream in(one.file, std::ios::binary);
    std::string text{std::istreambuf_iterator<char>(in), {}};
    if (!text.empty()) return ise::from_json<window_view>(text);
    window_view made;
    made.name = one.name;
    return made;
}

} // namespace

mission::mission(ise::environment& world, ise::node_options terms, mission_options options)
    : options_(std::move(options)), stores_(options_.stores), began_(world.now()),
      node_(std::make_unique<ise::node>(world, std::move(terms))) {
    told_.seed = options_.seed;
    told_.virtual_clock = false;
    told_.wind = options_.wind;
    told_.began = world.wall();
    told_.database = stores_.in_database();
    told_.plan =
        (options_.length < min_long ? make_short_plan : make_plan)(options_.seed, options_.length, told_.database);
    // Two processes of one machine cannot be parted.
    std::erase_if(told_.plan.faults, [](const auto& one) { return one.what == trouble::nodes_parted; });
    // Their disks are not within reach.
    for (auto& one : told_.plan.faults) {
        if (one.what == trouble::primary_set_back) one.what = trouble::primary_killed;
        if (one.what == trouble::secondary_set_back) one.what = trouble::secondary_killed;
    }
    for (std::size_t i = 0; i < operators; ++i) {
        auto& one = told_.people[i];
        one.name = i == 0 ? "ana" : "ben";
        one.index = i;
        one.may_begin = false;
        book_.expect(one.name);
        for (const auto& order : told_.plan.orders)
            if (order.by == i) one.orders.push_back(order);
    }
}

mission::~mission() = default;

ise::duration mission::elapsed() const { return node_->env().now() - began_; }

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
        node_->start<serial_wire>("atirma/wire/" + one.which, beside_script(), one.link, one.device, make);
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
        node_->start<wire_relay>("atirma/wire/gprs-tcp", beside_script(), "tcp://127.0.0.1:0", options_.carrier_tcp,
                                 make, listening);
    if (!options_.carrier_udp.empty())
        node_->start<datagram_wire>("atirma/wire/gprs-udp", beside_script(), "udp://127.0.0.1:0", options_.carrier_udp,
                                    make, listening);
}

void mission::start_operator(std::size_t which) {
    const auto& name = told_.people[which].name;
    console::gui_client_options options;
    options.name_servers = {options_.names};
    {
        std::lock_guard lock(mutex_);
        consoles_[which] = options.port;
    }
    node_->start<console::gui_client>("atirma/console/" + name, beside_script(), options);
    node_->start<operator_seat>(
        "atirma/desk/" + name, beside_script(), told_.people[which], book_, [this] { return elapsed(); }, options.port);
}

void mission::stop_operator(std::size_t which) {
    const auto& name = told_.people[which].name;
    const std::vector<std::string> paths{"atirma/desk/" + name, "atirma/console/" + name};
    for (const auto& path : paths) node_->stop(path);
    // The lock is free meanwhile; what is asked for stays in the queue.
    std::unique_lock lock(mutex_);
    while (!has_stopped(paths)) asked_.wait_for(lock, 20ms);
}

bool mission::has_stopped(const std::vector<std::string>& paths) const {
    const auto all = node_->components();
    return std::ranges::none_of(all, [&](const auto& one) {
        return std::ranges::count(paths, one.path) != 0 && one.state < ise::component_state::stopped;
    });
}

bool mission::sail() {
    bool whole = work();
    node_->stop();
    node_->wait();
    return whole;
}

bool mission::work() {
    ise::component_options alone;
    alone.listens = false;
    alone.registers = false;
    node_->start<script>(script_path, alone, *this);
    director_ = &node_->start<director>("atirma/director", beside_script());
    start_lines();
    for (std::size_t i = 0; i < operators; ++i) start_operator(i);
    for (;;) {
        std::unique_lock lock(mutex_);
        while (tasks_.empty()) {
            if (has_stopped({script_path})) { // it asks for its end, but where it failed
                trouble_ = "the script failed early; the reason is in the log";
                return false;
            }
            asked_.wait_for(lock, 200ms);
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

bool mission::judge() {
    auto disks = stores_.keys();
    if (!disks) return false;
    judged_ = (*disks)[0];
    auto memory = ise::database::open_to_read(options_.boat_memory);
    proof_ = book_.judge(*disks, told_.plan.length, keys_at_boat(memory.value()));
    return true;
}

account mission::story() {
    auto made = told_;
    for (std::size_t i = 0; i < operators; ++i) made.consoles.push_back(view_of(told_.people[i].name, *consoles_[i]));
    for (const auto& one : options_.windows) made.windows.push_back(view_of(one));
    made.sessions = book_.sessions();
    made.packets = stores_.packets();
    made.recorded = stores_.commands();
    std::erase_if(made.packets, [&](const auto& one) { return !judged_.contains(key_of(one.boot, one.sequence)); });
    return made;
}

} // namespace atirma::stress
