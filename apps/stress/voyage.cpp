#include "voyage.hpp"

#include <ise/service/service_host.hpp>

#include <components/gprs_link/services.hpp>
#include <components/iridium_gateway/services.hpp>
#include <components/iridium_modem/services.hpp>
#include <components/xbee_link/services.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr waypoint beach{28.1580, -15.4408}; // of the short-range node

double distance_from_beach_m(const location& of) {
    constexpr double metres_a_degree = 111'195, radians = 3.14159265358979323846 / 180;
    double north = (of.latitude_deg - beach.latitude_deg) * metres_a_degree;
    double east = (of.longitude_deg - beach.longitude_deg) * metres_a_degree * std::cos(beach.latitude_deg * radians);
    return std::sqrt(north * north + east * east);
}

} // namespace

voyage::voyage(voyage_options options)
    : options_(std::move(options)), plan_(make_plan(options_.seed, options_.length)), world_(options_.seed) {
    static int number = 0; // several in one process have a disk each
    disk_prefix_ = fmt::format("memory:stress{}-", ++number);
    for (const auto* name : {"node-1", "node-2", "iridium"})
        disks_.push_back(database::open(disk_prefix_ + name, {}).value());
    world_.bounds().events_in_one_run = 20'000'000'000;
    for (std::size_t i = 0; i < operators; ++i) {
        operators_[i].name = i == 0 ? "ana" : "ben";
        operators_[i].index = i;
        for (const auto& one : plan_.orders)
            if (one.by == i) operators_[i].orders.push_back(one);
    }
    start_names();
    start_sea();
    start_shore();
    start_people();
    schedule();
}

ise::node_options voyage::node_options(bool names) {
    ise::node_options made;
    made.use_names = names;
    if (names) made.name_server = ise::endpoint::parse("tcp://names:7400").value();
    made.log = [this](const ise::log_record& said) { record(said); };
    return made;
}

void voyage::record(const ise::log_record& said) {
    if (said.level < ise::log_level::info) return;
    log_ += ise::format_line(said);
    if (said.level >= ise::log_level::warning)
        ++complaints_[fmt::format("{} · {}: {}", ise::name_of(said.level), said.component, said.message)];
}

void voyage::start(const std::string& path, const std::string& host, maker make) {
    auto& here = places_[path];
    auto name = path.substr(path.rfind('/') + 1);
    here.process = &world_.host(host).start_process(
        name, [this, path, make = std::move(make)](ise::sim::process& env) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(env, node_options());
            ise::component_options everywhere;
            everywhere.listen = {ise::endpoint::parse("tcp://0.0.0.0:0").value()};
            places_[path].component = &make(*node, std::move(everywhere));
            return node;
        });
}

void voyage::start_names() {
    auto& here = places_["names"];
    here.process =
        &world_.host("names").start_process("names", [this](ise::sim::process& env) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(env, node_options(false));
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7400").value()};
            where.registers = false;
            ise::name_server_options terms;
            terms.fresh = std::exchange(names_fresh_, false);
            places_["names"].component =
                &node->start<ise::name_server>(std::string(ise::naming::server_path), where, terms);
            return node;
        });
}

void voyage::schedule() {
    for (const auto& one : plan_.faults) {
        world_.at(one.at, [this, one] { begin(one); });
        if (one.length.count() > 0) world_.at(one.at + one.length, [this, one] { end(one); });
    }
    for (int i = 0; i <= samples_wanted; ++i) {
        auto at = options_.length / samples_wanted * i;
        world_.at(at, [this, at] { take_sample(at); });
    }
    world_.after(5s, [this] { watch_range(); });
}

/// The air's emulator knows distance and loss, but no headlands: beyond the range it is switched off.
void voyage::watch_range() {
    world_.after(5s, [this] { watch_range(); });
    if (!boat_->boat()) return;
    double away_m = distance_from_beach_m(boat_->boat()->location_now());
    bool out = away_m > options_.xbee_range_m * (out_of_range_ ? 0.97 : 1.0);
    if (out == out_of_range_) return;
    out_of_range_ = out;
    xbee_air_request request;
    request.up = !out;
    director_->let(director::tell("atirma/air", services::air_control, request));
    auto at = world_.elapsed();
    if (out) {
        range_episode_ = episodes_.size();
        episodes_.push_back({at, -1ns, "out of the XBee's range", link_id::xbee});
    } else {
        episodes_[range_episode_].until = at;
    }
}

std::string voyage::path_of(trouble what) {
    switch (what) {
        case trouble::primary_killed: return "atirma/shore/node-1";
        case trouble::secondary_killed: return "atirma/shore/node-2";
        case trouble::names_restarted: return "names";
        case trouble::xbee_proxy_crashed: return "atirma/shore/xbee";
        case trouble::gprs_proxy_crashed: return "atirma/shore/gprs";
        case trouble::iridium_proxy_crashed: return "atirma/shore/iridium";
        case trouble::operator_away: return "atirma/console/ana";
        default: return {};
    }
}

void voyage::down(const std::string& path) {
    auto& here = places_.at(path);
    here.component = nullptr;
    if (path == "atirma/console/ana") here.process->stop();
    else here.process->crash();
}

void voyage::up(const std::string& path) { places_.at(path).process = &places_.at(path).process->restart(); }

void voyage::begin(const fault& what) {
    auto at = world_.elapsed();
    open_[what.what] = episodes_.size();
    episodes_.push_back({at, what.length.count() > 0 ? ise::duration(-1ns) : at, std::string(describe(what.what)),
                         felt_over(what.what)});
    if (auto path = path_of(what.what); !path.empty()) return down(path);
    auto carrier = [this](const carrier_request& request) {
        director_->let(director::tell("atirma/carrier", services::carrier_control, request));
    };
    auto sky = [this](const iridium_sky_request& request) {
        director_->let(director::tell("atirma/iridium/modem", services::iridium_sky_control, request));
    };
    carrier_request over_carrier;
    iridium_sky_request over_sky;
    switch (what.what) {
        case trouble::carrier_down: over_carrier.up = false; return carrier(over_carrier);
        case trouble::carrier_drops: over_carrier.drop = true; return carrier(over_carrier);
        case trouble::carrier_half_open: over_carrier.half_open = true; return carrier(over_carrier);
        case trouble::carrier_moves: over_carrier.change_address = true; return carrier(over_carrier);
        case trouble::carrier_slow:
            over_carrier.delay_s = 4;
            over_carrier.jitter_s = 5;
            return carrier(over_carrier);
        case trouble::sky_closed: over_sky.free = false; return sky(over_sky);
        case trouble::sky_fails: over_sky.failures = 0.7; return sky(over_sky);
        case trouble::air_noise: {
            xbee_air_request request;
            request.extra_loss = 0.5;
            return director_->let(director::tell("atirma/air", services::air_control, request));
        }
        case trouble::gateway_down: {
            iridium_gateway_request request;
            request.up = false;
            return director_->let(director::tell("atirma/iridium/gateway", services::iridium_gateway_control, request));
        }
        default: return;
    }
}

void voyage::end(const fault& what) {
    episodes_[open_.at(what.what)].until = world_.elapsed();
    if (auto path = path_of(what.what); !path.empty()) return up(path);
    auto carrier = [this](const carrier_request& request) {
        director_->let(director::tell("atirma/carrier", services::carrier_control, request));
    };
    auto sky = [this](const iridium_sky_request& request) {
        director_->let(director::tell("atirma/iridium/modem", services::iridium_sky_control, request));
    };
    carrier_request over_carrier;
    iridium_sky_request over_sky;
    switch (what.what) {
        case trouble::carrier_down: over_carrier.up = true; return carrier(over_carrier);
        case trouble::carrier_slow:
            over_carrier.delay_s = 0.3;
            over_carrier.jitter_s = 0.2;
            return carrier(over_carrier);
        case trouble::sky_closed: over_sky.free = true; return sky(over_sky);
        case trouble::sky_fails: over_sky.failures = 0.1; return sky(over_sky);
        case trouble::air_noise: {
            xbee_air_request request;
            request.extra_loss = 0;
            return director_->let(director::tell("atirma/air", services::air_control, request));
        }
        case trouble::gateway_down: {
            iridium_gateway_request request;
            request.up = true;
            return director_->let(director::tell("atirma/iridium/gateway", services::iridium_gateway_control, request));
        }
        default: return;
    }
}

communication_node* voyage::node(std::size_t which) {
    auto& here = places_.at(fmt::format("atirma/shore/node-{}", which + 1));
    return static_cast<communication_node*>(here.component);
}

void voyage::take_sample(ise::duration at) {
    sample one;
    one.at = at;
    one.waiting = world_.engine().waiting();
    for (const auto& [path, here] : places_) {
        if (here.component) one.sessions += here.component->services().sessions().size();
        else one.whole = false;
    }
    for (std::size_t i = 0; i < 2; ++i) {
        auto* here = node(i);
        if (!here) continue;
        auto told = here->how();
        one.packets[i] = told.packets;
        one.unseen[i] = told.packets - told.shown;
        one.held[i] = told.held;
        one.open[i] = told.telecommands_open;
    }
    if (const auto* sails = boat_->boat()) one.xbee_queued = sails->queued(link_id::xbee);
    one.gprs_waiting = numbers_.size();
    samples_.push_back(one);
    if (options_.on_sample) options_.on_sample(at, book_.blocks());
}

void voyage::sail() {
    world_.run_for(options_.length - world_.elapsed());
    auto ended = world_.elapsed();
    for (int i = 0; i < 180 && !nothing_owed(); ++i) world_.run_for(10s);
    calm_ = world_.elapsed() - ended;
}

std::set<packet_key> voyage::on_disk(std::size_t which) {
    auto rows = disks_.at(which).query("SELECT boot, sequence FROM packets");
    std::set<packet_key> made;
    for (const auto& row : rows.value())
        made.insert(key_of(static_cast<std::uint16_t>(row.integer(0)), static_cast<std::uint32_t>(row.integer(1))));
    return made;
}

std::vector<telemetry_packet> voyage::packets(std::size_t which) {
    auto rows = disks_.at(which).query(
        "SELECT boot, sequence, measured, link, received, history, raw FROM packets ORDER BY measured, boot, sequence");
    std::vector<telemetry_packet> made;
    for (const auto& row : rows.value()) {
        auto& one = made.emplace_back();
        one.boot = static_cast<std::uint16_t>(row.integer(0));
        one.sequence = static_cast<std::uint32_t>(row.integer(1));
        one.measured_at = utc_time(std::chrono::milliseconds(row.integer(2)));
        one.link = static_cast<link_id>(row.integer(3));
        one.received_at = utc_time(std::chrono::milliseconds(row.integer(4)));
        one.history = row.integer(5) != 0;
        one.raw = row.bytes(6);
    }
    return made;
}

/// What was owed at the end has come, and everybody knows of it. What comes meanwhile is new, and so the answer is one
/// of an instant.
bool voyage::nothing_owed() {
    auto verdict = judge();
    return verdict.missing.size() == verdict.excused && verdict.only_on_one == 0 &&
           std::ranges::all_of(verdict.subscribers, [](const auto& one) { return one.second.missed == 0; });
}

ledger::verdict voyage::judge() {
    std::array<std::set<packet_key>, 2> disks{on_disk(0), on_disk(1)};
    // What the XBee's proxy had read when it was killed may not have left it, and the modem talks before a new life has
    // opened the port: no link acknowledges behind the modem.
    auto excuse = [this](const ledger::entry& lost) -> std::string {
        if (lost.link != link_id::xbee) return {};
        for (const auto& one : episodes_)
            if (one.what == describe(trouble::xbee_proxy_crashed) && lost.arrived > one.from - 200ms &&
                lost.arrived < one.until + 500ms)
                return "the XBee proxy was killed 0.2 s after it, or had not opened its port 0.5 s before it";
        return {};
    };
    return book_.judge(disks, options_.length, excuse);
}

voyage::shown_page voyage::page() const {
    const auto& here = places_.at("atirma/page");
    shown_page made;
    if (!here.component) return made;
    const auto& told = static_cast<const web_server*>(here.component)->statistics();
    made.received = told.received;
    made.duplicates = told.duplicates;
    made.malformed = told.malformed;
    return made;
}

} // namespace atirma::stress
