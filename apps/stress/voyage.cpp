#include "voyage.hpp"

#include <ise/bag/recorder.hpp>
#include <ise/component/served_calls.hpp>
#include <ise/core/error.hpp>
#include <ise/service/service_host.hpp>

#include <components/xbee_link/services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <optional>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

double metres_between(const waypoint& a, const location& b) {
    constexpr double metres_a_degree = 111'195, radians = 3.14159265358979323846 / 180;
    double north = (b.latitude_deg - a.latitude_deg) * metres_a_degree;
    double east = (b.longitude_deg - a.longitude_deg) * metres_a_degree * std::cos(a.latitude_deg * radians);
    return std::sqrt(north * north + east * east);
}

/// Whose disk a backup is put back to.
std::optional<std::size_t> set_back_by(trouble what) {
    if (what == trouble::primary_set_back) return 0;
    if (what == trouble::secondary_set_back) return 1;
    return std::nullopt;
}

std::set<std::string> texts_on(ise::database& disk, const char* sql) {
    std::set<std::string> made;
    auto rows = disk.query(sql);
    for (const auto& row : rows.value()) made.insert(row.text(0));
    return made;
}

} // namespace

voyage::voyage(voyage_options options) : options_(std::move(options)), world_(options_.seed) {
    told_.seed = options_.seed;
    told_.plan = make_plan(options_.seed, options_.length);
    told_.wind = options_.wind_csv.empty() ? fmt::format("{:.1f} m/s from {:.0f}°, gusts by the seed",
                                                         told_.plan.wind_speed_mps, told_.plan.wind_from_deg)
                                           : std::string("a recorded series");
    told_.xbee_range_m = options_.xbee_range_m;
    told_.began = world_.wall_start;
    static int number = 0; // several in one process have a disk each
    disk_prefix_ = fmt::format("memory:stress{}-", ++number);
    for (const auto* name : {"node-1", "node-2", "iridium", "boat"})
        disks_.push_back(ise::database::open(disk_prefix_ + name, {}).value());
    world_.bounds().events_in_one_run = 20'000'000'000;
    for (std::size_t i = 0; i < operators; ++i) {
        told_.people[i].name = i == 0 ? "ana" : "ben";
        told_.people[i].index = i;
        book_.expect(told_.people[i].name);
        for (const auto& one : told_.plan.orders)
            if (one.by == i) told_.people[i].orders.push_back(one);
    }
    start_names();
    if (!options_.record.empty()) start_recorder();
    start_sea();
    start_shore();
    start_people();
    schedule();
}

ise::node_options voyage::node_options(bool names) {
    ise::node_options made;
    made.use_names = names;
    if (names) made.name_servers = {ise::endpoint::parse("tcp://names:7400").value()};
    made.log = [this](const ise::log_record& said) { record(said); };
    return made;
}

void voyage::record(const ise::log_record& said) {
    if (said.level < ise::log_level::info) return;
    log_ += ise::format_line(said);
    if (said.level >= ise::log_level::warning)
        ++told_.complaints[fmt::format("{} · {}: {}", ise::name_of(said.level), said.component, said.message)];
}

void voyage::start(const std::string& path, const std::string& host, maker make) {
    auto& here = places_[path];
    auto name = path.substr(path.rfind('/') + 1);
    std::map<std::string, std::string> variables;
    if (!options_.record.empty()) variables[ise::record_calls_variable] = "1";
    auto run = [this, path, make = std::move(make)](ise::sim::process& env) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(env, node_options());
        ise::component_options everywhere;
        everywhere.listen = {ise::endpoint::parse("tcp://0.0.0.0:0").value()};
        places_[path].component = &make(*node, std::move(everywhere));
        return node;
    };
    here.process = &world_.host(host).start_process(name, std::move(run), std::move(variables));
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

void voyage::start_recorder() {
    world_.host("recorder").start_process("recorder", [this](ise::sim::process& env) -> std::shared_ptr<void> {
        auto node = std::make_shared<ise::node>(env, node_options());
        ise::bag::recorder_options options;
        options.files.file = options_.record;
        options.name_servers = node->options().name_servers;
        ise::component_options quiet;
        quiet.listens = false;
        quiet.registers = false;
        node->start<ise::bag::recorder>("recorder", quiet, options);
        recording_ = node.get();
        return node;
    });
}

/// What the script has still to do waits in the world too, and is counted.
void voyage::later(ise::duration at, std::function<void()> what) {
    ++still_to_come_;
    world_.at(at, [this, what = std::move(what)] {
        --still_to_come_;
        what();
    });
}

void voyage::schedule() {
    for (const auto& one : told_.plan.faults) {
        if (auto node = set_back_by(one.what)) {
            auto before = std::min<ise::duration>(one.at, options_.length / 20);
            later(one.at - before, [this, node] { back_up(*node); });
        }
        later(one.at, [this, one] { begin(one); });
        if (one.length.count() > 0) later(one.at + one.length, [this, one] { end(one); });
    }
    for (int i = 0; i <= samples_wanted; ++i) {
        auto at = options_.length / samples_wanted * i;
        later(at, [this, at] { take_sample(at); });
    }
    world_.after(5s, [this] { watch_range(); });
}

/// The air's emulator knows distance and loss, but no headlands: beyond the range it is switched off.
void voyage::watch_range() {
    world_.after(5s, [this] { watch_range(); });
    const auto* here = at<boat_simulator>("atirma/boat");
    if (!here || !here->boat()) return;
    double away_m = metres_between(short_range_node(), here->boat()->location_now());
    bool out = away_m > options_.xbee_range_m * (out_of_range_ ? 0.97 : 1.0);
    if (out == out_of_range_) return;
    out_of_range_ = out;
    xbee_air_request request;
    request.up = !out;
    director_->let(director::tell("atirma/air", services::air_control, request));
    auto at = world_.elapsed();
    if (out) {
        range_episode_ = told_.episodes.size();
        told_.episodes.push_back({at, -1ns, "out of range of the XBee", link_id::xbee});
    } else {
        told_.episodes[range_episode_].until = at;
    }
}

void voyage::down(const std::string& path) {
    auto& here = places_.at(path);
    here.component = nullptr;
    if (path == "atirma/console/ana") here.process->stop();
    else here.process->crash();
}

void voyage::up(const std::string& path) { places_.at(path).process = &places_.at(path).process->restart(); }

void voyage::back_up(std::size_t node) {
    auto name = disk(node).file() + "-backup";
    if (!backups_.contains(node)) backups_.emplace(node, ise::database::open(name, {}).value());
    ise::database::copy(disk(node).file(), name).value();
}

/// As long as the other node has all that is lost by it: what only one disk had is gone with that disk.
void voyage::set_back(std::size_t node) {
    auto& here = disk(node);
    auto& other = disk(1 - node);
    for (const auto* sql : {"SELECT boot || ' ' || sequence FROM packets", "SELECT id || '' FROM commands",
                            "SELECT max(epoch) || '' FROM authority"}) {
        if (std::ranges::includes(texts_on(other, sql), texts_on(here, sql))) continue;
        log_ += fmt::format("node {} keeps its disk: it has packets that the other one does not have yet\n", node + 1);
        return;
    }
    ise::database::copy(backups_.at(node).file(), here.file()).value();
    ++told_.set_back;
}

void voyage::begin(const fault& what) {
    auto at = world_.elapsed();
    open_[what.what] = told_.episodes.size();
    told_.episodes.push_back({at, what.length.count() > 0 ? ise::duration(-1ns) : at, std::string(describe(what.what)),
                              felt_over(what.what), what.what == trouble::boat_killed});
    auto doing = deed_of(what.what);
    if (!doing.process.empty()) down(doing.process);
    if (auto node = set_back_by(what.what)) set_back(*node);
    if (doing.begin) director_->let(doing.begin);
    if (what.what == trouble::nodes_parted) world_.net().partition("shore", "backup");
}

void voyage::end(const fault& what) {
    told_.episodes[open_.at(what.what)].until = world_.elapsed();
    auto doing = deed_of(what.what);
    if (!doing.process.empty()) up(doing.process);
    if (doing.end) director_->let(doing.end);
    if (what.what == trouble::nodes_parted) world_.net().heal("shore", "backup");
}

void voyage::take_sample(ise::duration when) {
    sample one;
    one.at = when;
    one.waiting = world_.engine().waiting() - still_to_come_;
    for (const auto& [path, here] : places_) {
        if (here.component) one.sessions += here.component->services().sessions().size();
        else one.whole = false;
    }
    for (std::size_t i = 0; i < 2; ++i) {
        auto* here = at<communication_node>(fmt::format("atirma/shore/node-{}", i + 1));
        if (!here) continue;
        auto result = here->how();
        one.packets[i] = result.packets;
        one.unseen[i] = result.packets - result.shown;
        one.held[i] = result.held;
        one.open[i] = result.telecommands_open;
    }
    if (const auto* sails = at<boat_simulator>("atirma/boat"); sails && sails->boat()) {
        one.xbee_queued = sails->boat()->queued(link_id::xbee);
        one.xbee_waiting = sails->radio_waiting();
    }
    one.gprs_waiting = numbers_.size();
    told_.samples.push_back(one);
    std::size_t tracks = 0;
    for (const auto& console : consoles_)
        if (auto shown = console ? console->latest() : nullptr) tracks += shown->track_bytes;
    if (options_.on_sample) options_.on_sample(told_.samples.back(), tracks);
}

void voyage::sail() {
    auto tell = [&](double part) {
        if (options_.on_progress) options_.on_progress(part);
    };
    while (world_.elapsed() < options_.length) {
        world_.run_for(std::min<ise::duration>(10s, options_.length - world_.elapsed()));
        tell(static_cast<double>(world_.elapsed().count()) / static_cast<double>(options_.length.count()));
    }
    auto ended = world_.elapsed();
    auto settle = [&] {
        for (int i = 0; i < 180 && !nothing_owed(); ++i) {
            world_.run_for(10s);
            tell(1);
        }
    };
    settle();
    told_.calm = world_.elapsed() - ended;
    if (!recording_) return;
    recording_->stop();
    world_.run_until([this] { return recording_->all_stopped(); });
    for (const auto& one : recording_->reports())
        if (!one.failure.empty()) throw ise::error(ise::errc::io_failed, one.failure);
    settle(); // the world went on meanwhile, and the verdict is one of this instant
}

/// What was owed at the end has come, and everybody knows of it. What comes meanwhile is new, and so the answer is one
/// of an instant.
bool voyage::nothing_owed() {
    auto verdict = judge();
    const auto* page = at<web_server>("atirma/page");
    return verdict.missing.empty() && verdict.only_on_one == 0 && page &&
           page->statistics().received >= keys_on(disk(0)).size() &&
           std::ranges::all_of(verdict.subscribers, [](const auto& one) { return one.second.missed == 0; });
}

ledger::verdict voyage::judge() {
    std::array<std::set<packet_key>, 2> disks{keys_on(disk(0)), keys_on(disk(1))};
    return book_.judge(disks, options_.length, keys_at_boat(disks_.back()));
}

account voyage::story() {
    auto made = told_;
    if (const auto* page = at<web_server>("atirma/page")) {
        const auto& result = page->statistics();
        made.page.received = result.received;
        made.page.duplicates = result.duplicates;
        made.page.malformed = result.malformed;
    }
    if (const auto* sails = at<boat_simulator>("atirma/boat"); sails && sails->boat())
        made.sailed_m = static_cast<double>(sails->boat()->location_now().distance_sailed_m);
    for (std::size_t i = 0; i < operators; ++i) made.consoles.push_back(view_of(told_.people[i].name, *consoles_[i]));
    made.sessions = book_.sessions();
    made.packets = packets_on(disk(0));
    made.recorded = commands_on(disk(0));
    return made;
}

} // namespace atirma::stress
