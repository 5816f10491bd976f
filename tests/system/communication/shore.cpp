#include "shore.hpp"

#include <ise/core/sleep.hpp>

#include <fmt/format.h>

namespace communication_test {
namespace {

constexpr int clock_rate = 10; // the model is of no interest

simulator::boat_options at_anchor(utc_time begin) {
    simulator::boat_options options;
    options.epoch = begin;
    options.clock_rate = clock_rate;
    options.start = waypoint{28.155, -15.45};
    return options;
}

} // namespace

boat_at_sea::boat_at_sea(utc_time at) : begin(at), boat(at_anchor(at), simulator::constant_wind({6, 40})) {}

telemetry_packet boat_at_sea::make(link_id over_link, utc_time at) {
    packet_header header;
    header.boot = 1;
    header.sequence = ++sequence;
    header.measured_at = at;
    location where;
    where.quality = fix_quality::gps;
    where.latitude_deg = 28.15 + sequence * 1e-6;
    where.longitude_deg = -15.45;
    telemetry_packet made;
    made.link = over_link;
    made.boot = header.boot;
    made.sequence = header.sequence;
    made.measured_at = at;
    made.raw = encode_telemetry(header, where);
    return made;
}

acknowledgement boat_at_sea::execute(ise::bytes_view raw, link_id from, utc_time now) {
    boat.advance((now - begin) / clock_rate);
    auto parsed = parse_telecommand(raw).value();
    ++over(from).commands;
    auto before = boat.pilot().revision();
    auto ack = boat.execute(parsed, from);
    if (boat.pilot().revision() != before) {
        ++executed[parsed.id];
        epochs.push_back(parsed.authority);
    }
    return ack;
}

ise::task<> scripted_proxy::run() {
    telemetry_ = publish(services::telemetry);
    link_policy policy;
    policy.link = link_;
    commands_.emplace(*this, policy);
    commands_->give = [this] { return give(); };
    commands_->provide();
    if (boat_.over(link_).acknowledges) spawn("acknowledge", acknowledge());
    for (;;) {
        pass();
        co_await sleep(100ms);
    }
}

void scripted_proxy::pass() {
    auto& link = boat_.over(link_);
    if (link.up) {
        for (auto& packet : link.waiting) {
            if (!told_.insert(key_of(packet)).second) continue;
            packet.received_at = clock();
            if (link.publishes) telemetry_(packet);
        }
        if (!link.acknowledges) link.waiting.clear();
    } else if (!link.acknowledges) {
        link.waiting.clear(); // sent into the air
    }
    commands_->work();
}

bool scripted_proxy::give() {
    auto& link = boat_.over(link_);
    auto& tracker = commands_->tracker();
    using kind = link_outcome::kind;
    while (auto due = tracker.next_due(commands_->now())) {
        tracker.on_outcome(commands_->now(), due->id,
                           link.up ? make_outcome(kind::delivered, "")
                                   : make_outcome(kind::later, "the boat is out of range"));
        if (!link.up) continue;
        if (link.lose > 0) --link.lose;
        else tracker.on_acknowledgement(commands_->now(), boat_.execute(due->raw, link_, clock()));
    }
    return true;
}

// As the GPRS proxy: the boat is acknowledged what is on disk.
ise::task<> scripted_proxy::acknowledge() {
    auto store = at(std::string(communication_role));
    auto& link = boat_.over(link_);
    for (;;) {
        keep_request request;
        for (const auto& packet : link.waiting)
            if (link.up && request.packets.size() < keep_request::max_packets) request.packets.push_back(packet);
        if (!request.packets.empty()) {
            auto kept = co_await store.try_call(services::telemetry_store, request, 10s);
            if (kept && link.up) {
                for (const auto& packet : request.packets) {
                    boat_.acknowledged.insert(key_of(packet));
                    std::erase_if(link.waiting, [&](const auto& sent) { return key_of(sent) == key_of(packet); });
                }
            }
        }
        co_await sleep(200ms);
    }
}

shore::shore(std::uint64_t seed, bool two_nodes) : names(true, seed), two_(two_nodes) {
    static int made = 0;
    prefix_ = fmt::format("shore{}-", ++made);
    boat.over(link_id::gprs).acknowledges = true;
    for (auto link : {link_id::xbee, link_id::gprs, link_id::iridium}) {
        terms.proxies.push_back({link, fmt::format("shore/{}", name_of(link))});
        start_proxy(link);
    }
}

void shore::start_proxy(link_id link) {
    auto name = std::string(name_of(link));
    processes_["shore/" + name] = &names.start(name, name, [this, link, name](ise::node& node) {
        node.start<scripted_proxy>("shore/" + name, names_test::everywhere(), link, boat);
    });
}

void shore::start_node(const std::string& name) {
    auto& disk = disks_[name];
    if (!disk && folder_.empty()) {
        auto opened = ise::database::open(disk_of(name), {});
        disk = std::make_unique<ise::database>(std::move(opened.value()));
    }
    auto host = name.substr(name.find('/') + 1);
    processes_[name] = &names.start(host, host, [this, name](ise::node& node) {
        auto options = terms;
        options.file = disk_of(name);
        options.secondary = name == two;
        if (two_) options.peer = name == two ? one : two;
        running_[name] = &node;
        nodes_[name] = &node.start<communication_node>(name, names_test::everywhere(), std::move(options));
    });
}

communication_state shore::state(const std::string& name) const {
    auto process = processes_.find(name);
    if (process == processes_.end() || !process->second->running()) return communication_state();
    return nodes_.at(name)->how();
}

std::string shore::disk_of(const std::string& name) const {
    if (folder_.empty()) return "memory:" + prefix_ + name;
    return folder_ + "/" + name.substr(name.find('/') + 1) + ".db";
}

std::set<packet_key> shore::on_disk(const std::string& name) {
    std::set<packet_key> made;
    auto disk = ise::database::open_to_read(disk_of(name)).value();
    auto rows = disk.query("SELECT boot, sequence FROM packets");
    for (const auto& row : rows.value())
        made.emplace(static_cast<std::uint16_t>(row.integer(0)), static_cast<std::uint32_t>(row.integer(1)));
    return made;
}

void shore::back_up(const std::string& name) {
    auto& kept = backups_[name];
    if (!kept) kept = std::make_unique<ise::database>(ise::database::open(disk_of(name) + "-backup", {}).value());
    ise::database::copy(disk_of(name), kept->file()).value();
}

void shore::restore(const std::string& name) { ise::database::copy(backups_.at(name)->file(), disk_of(name)).value(); }

std::set<std::string> shore::rows_on(const std::string& name, const std::string& sql) {
    std::set<std::string> made;
    auto disk = ise::database::open_to_read(disk_of(name)).value();
    auto rows = disk.query(sql);
    for (const auto& row : rows.value()) made.insert(row.text(0));
    return made;
}

bool shore::knows_alone(const std::string& name, const std::string& other) {
    for (const auto* sql : {"SELECT boot || ' ' || sequence FROM packets", "SELECT record FROM commands",
                            "SELECT epoch || ' ' || change FROM authority"})
        if (!std::ranges::includes(rows_on(other, sql), rows_on(name, sql))) return true;
    return false;
}

void shore::fill_disk(const std::string& name, bool full) {
    if (full) disks_.at(name)->begin().value(); // whoever else wants to write is refused
    else disks_.at(name)->rollback();
}

void shore::sends_every_second(std::vector<link_id> over) {
    auto mine = ++sending_;
    auto again = std::make_shared<std::function<void()>>();
    *again = [this, over, mine, weak = std::weak_ptr(again)] {
        if (mine != sending_) return;
        auto at = utc_time(std::chrono::floor<std::chrono::milliseconds>(world.wall_start + world.elapsed()));
        auto packet = boat.make(over.front(), at);
        for (auto link : over) {
            packet.link = link;
            boat.over(link).waiting.push_back(packet);
        }
        world.after(1s, [again = weak.lock()] { (*again)(); });
    };
    world.after(0s, [again] { (*again)(); });
}

listener& shore::listen(const std::string& whom, const std::string& from) {
    auto& into = *listeners_.emplace_back(std::make_unique<listener>());
    auto name = from + std::to_string(listeners_.size());
    names.start_body(from, name, [&into, whom](ise::component& self) -> ise::task<> {
        auto there = self.at(whom);
        self.listen(
            there, services::telecommand_state,
            [&into](const telecommand_status& status) { into.states.push_back(status); },
            ise::subscribe_options::keep_last(1024));
        self.listen(there, services::authority_changes,
                    [&into](const authority_state& state) { into.authorities.push_back(state); });
        telemetry_follower follower(self, there, [&into](const telemetry_packet& packet) {
            into.heard.push_back(key_of(packet));
            if (!into.known.insert(key_of(packet)).second) ++into.twice;
            if (packet.history) return;
            if (into.current && packet.measured_at < *into.current) ++into.backwards;
            into.current = packet.measured_at;
        });
        for (;;) {
            try {
                co_await follower.run();
            } catch (const ise::error&) { // the provider went: again
            }
            co_await self.sleep(500ms);
        }
    });
    return into;
}

void shore::let(const std::string& who, job what) {
    auto& desk = operators_[who];
    if (!desk) {
        desk = std::make_shared<operator_desk>();
        names.start_body(who, who, [mine = desk](ise::component& self) -> ise::task<> {
            for (;;) {
                for (; !mine->jobs.empty(); mine->jobs.pop_front()) self.spawn("job", mine->jobs.front()(self));
                co_await self.sleep(50ms);
            }
        });
    }
    // A coroutine that is a lambda refers to it: it is kept as long as the world.
    auto kept = std::make_shared<job>(std::move(what));
    names.server->keep(kept);
    desk->jobs.push_back([kept](ise::component& self) { return (*kept)(self); });
}

ise::result<authority_state> shore::authority(const std::string& who, authority_action action, bool confirmed,
                                              std::string to, std::string whom) {
    authority_request request;
    request.action = action;
    request.confirmed = confirmed;
    request.to = std::move(to);
    return ask(who, services::authority, std::move(request), 20s, std::move(whom));
}

} // namespace communication_test
