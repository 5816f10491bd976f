#include "fleet.hpp"

#include "actor.hpp"
#include "contender.hpp"

namespace seeds {

using namespace std::chrono_literals;

fleet::fleet(stage& of) : stage_(of) {
    const auto& plan = of.plan;
    for (const auto& one : plan.processes) {
        ships_.push_back(std::make_unique<ship>());
        ships_.back()->what = one;
    }
    for (const auto& one : plan.components) ships_[one.process]->components.push_back(one);
    for (const auto& one : plan.contenders) ships_[one.process]->contends.push_back(one.path);
}

void fleet::start() {
    auto& world = stage_.world;
    for (const auto& host : stage_.plan.hosts) world.host(host);
    auto& shore = world.host("ns");
    for (const auto& [a, held] : world.hosts())
        for (const auto& [b, other] : world.hosts())
            if (a < b) world.net().between(a, b).latency = stage_.plan.latency;
    server_ = &shore.start_process("names", [this](ise::sim::process& env) {
        auto options = node_options("names");
        options.use_names = false;
        auto made = std::make_shared<ise::node>(env, std::move(options));
        ise::component_options where;
        where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7400").value()};
        where.registers = false;
        ise::name_server_options terms;
        terms.lease = stage_.plan.lease;
        terms.fresh = std::exchange(fresh_, false);
        names_ = &made->start<ise::name_server>(std::string(ise::naming::server_path), where, terms);
        return made;
    });
    for (auto& one : ships_) launch(*one);
}

ise::node_options fleet::node_options(const std::string& name) const {
    ise::node_options made;
    made.name = name;
    made.lease = stage_.plan.lease;
    made.services.linger = stage_.plan.linger;
    made.services.accepts.heartbeat_ns = stage_.plan.heartbeat_ns;
    made.services.session_bytes = stage_.plan.session_bytes;
    made.log = [events = &stage_.events](const ise::log_record& record) {
        auto line = ise::format_line(record);
        line.pop_back();
        events->note("log {}", line);
        events->tally(fmt::format("log records of level {}", ise::name_of(record.level)));
    };
    return made;
}

ise::component_options fleet::options_of(const ship& which, const component_plan& one, std::uint64_t life) const {
    ise::component_options made;
    auto unique = fmt::format("{}-{}-{}", one.port, life, which.starts);
    if (!one.role.empty()) made.roles[one.role] = one.priority;
    if (one.fails) made.policy = ise::on_failure::restart;
    if (one.over_datagrams) {
        made.listen = {ise::endpoint{ise::protocol::udp, "0.0.0.0", one.port, {}}};
        return made;
    }
    made.listen = {ise::endpoint{ise::protocol::inproc, {}, 0, unique},
                   ise::endpoint{ise::protocol::local, {}, 0, "@" + unique},
                   ise::endpoint{ise::protocol::tcp, "0.0.0.0", one.port, {}}};
    return made;
}

std::shared_ptr<fleet::hull> fleet::build(ship& which, ise::sim::process& env) {
    auto made = std::make_shared<hull>();
    made->life = ++lives_;
    stage_.coroutines[made->life];
    which.held = made.get();
    ++which.starts;
    made->node = std::make_unique<ise::node>(env, node_options(which.what.host + "/" + which.what.name));
    std::string first;
    for (const auto& one : which.components) {
        auto options = options_of(which, one, made->life);
        if (one.with_the_first && !first.empty()) options.together_with = first;
        made->node->start<actor>(one.path, std::move(options), stage_, one, which.what.host, made->life);
        if (first.empty()) first = one.path;
    }
    for (const auto& path : which.contends)
        made->contenders.push_back(std::make_unique<contender>(stage_, env, path, made->life));
    return made;
}

std::size_t fleet::add(process_plan what, std::vector<component_plan> components) {
    ships_.push_back(std::make_unique<ship>());
    ships_.back()->what = std::move(what);
    ships_.back()->components = std::move(components);
    return ships_.size() - 1;
}

void fleet::launch(ship& which) {
    auto& host = stage_.world.host(which.what.host);
    if (which.now != state::down || !host.up()) return;
    bool built = false;
    auto program = [this, &which, &built](ise::sim::process& env) -> std::shared_ptr<void> {
        try {
            auto made = build(which, env);
            built = true;
            return made;
        } catch (const ise::error& thrown) { // by a fault that was planned; it is tried again
            stage_.events.note("{}/{} does not start: {}", which.what.host, which.what.name, thrown.what());
            stage_.events.tally("processes that did not start at once");
            return {};
        }
    };
    auto server = fmt::format("tcp://{}:7400", stage_.world.host("ns").address());
    auto& process = host.start_process(which.what.name, program, {{"ISE_NAME_SERVER", server}});
    if (!built) {
        process.crash();
        which.held = nullptr;
        stage_.world.after(300ms, [this, &which] { launch(which); });
        return;
    }
    which.process = &process;
    which.now = state::up;
    which.frozen = false;
    stage_.events.note("{}/{} is up, life {}", which.what.host, which.what.name, which.held->life);
}

void fleet::check_nothing_left(std::uint64_t life, const std::string& who) {
    auto alive = stage_.coroutines.at(life).alive;
    if (stage_.planted.strikes_once(bug::coroutine_left)) ++alive;
    if (alive != 0) stage_.events.broken("{}: {} coroutines live on", who, alive);
}

void fleet::crash(ship& which) {
    if (which.now == state::down) return;
    auto life = which.held->life;
    stage_.events.note("{}/{} crashes", which.what.host, which.what.name);
    which.now = state::down;
    which.held = nullptr;
    which.frozen = false;
    which.process->crash();
    stage_.calls.life_lost(life);
    check_nothing_left(life, fmt::format("{}/{} has crashed", which.what.host, which.what.name));
}

void fleet::freeze(ship& which) {
    if (which.now != state::up || which.frozen) return;
    which.frozen = true;
    which.process->pause();
}

void fleet::thaw(ship& which) {
    if (!std::exchange(which.frozen, false)) return;
    stage_.calls.thawed(which.held->life);
    which.process->go_on();
}

void fleet::stop(ship& which, std::function<void()> next) {
    if (which.now != state::up || which.frozen) return next();
    stage_.events.note("{}/{} is stopped", which.what.host, which.what.name);
    which.now = state::stopping;
    which.held->node->stop();
    for (auto& one : which.held->contenders) one->stop();
    // Three times the grace and a little, as the node promises.
    auto limit = stage_.world.now() + 3 * which.held->node->options().grace + 200ms;
    check_stopped(which, limit, std::move(next));
}

void fleet::check_stopped(ship& which, ise::time_point limit, std::function<void()> next) {
    if (which.now != state::stopping) return next(); // it crashed meanwhile
    auto& held = *which.held;
    auto who = fmt::format("{}/{}", which.what.host, which.what.name);
    bool over = held.node->all_stopped();
    for (const auto& one : held.contenders) over = over && one->stopped();
    if (!over && stage_.world.now() <= limit) {
        auto life = held.life;
        stage_.world.after(5ms, [this, &which, limit, next = std::move(next), life] {
            if (which.held && which.held->life == life) check_stopped(which, limit, next);
            else next();
        });
        return;
    }
    if (!over) stage_.events.broken("{} has not stopped in time", who);
    for (const auto& report : held.node->reports())
        for (const auto& name : report.still_running)
            stage_.events.broken("{}: '{}' of {} still runs after the stop", who, name, report.path);
    stage_.calls.life_ended(held.life, who);
    check_nothing_left(held.life, who + " has stopped");
    stage_.events.note("{} has stopped", who);
    stage_.events.tally("processes stopped in order");
    which.now = state::down;
    which.held = nullptr;
    which.process->stop();
    next();
}

void fleet::crash_host(const std::string& host) {
    if (!stage_.world.host(host).up()) return;
    stage_.events.note("host {} crashes", host);
    std::vector<std::uint64_t> lives;
    for (auto& one : ships_) {
        if (one->what.host != host || one->now == state::down) continue;
        lives.push_back(one->held->life);
        one->now = state::down;
        one->held = nullptr;
        one->frozen = false;
    }
    stage_.world.host(host).crash();
    for (auto life : lives) {
        stage_.calls.life_lost(life);
        check_nothing_left(life, "host " + host + " has crashed");
    }
}

void fleet::boot_host(const std::string& host) {
    if (stage_.world.host(host).up()) return;
    stage_.world.host(host).boot();
    for (auto& one : ships_)
        if (one->what.host == host) launch(*one);
}

void fleet::stop_component(ship& which, const component_plan& one, std::function<void()> next) {
    if (which.now != state::up || which.frozen) return next();
    which.held->node->stop(one.path);
    stage_.events.note("component {} is stopped", one.path);
    stage_.world.after(7s, std::move(next));
}

void fleet::start_component(ship& which, const component_plan& one) {
    if (which.now != state::up || which.frozen) return;
    for (const auto& status : which.held->node->components())
        if (status.path == one.path && status.state < ise::component_state::stopped) return;
    try {
        ++which.starts;
        which.held->node->start<actor>(one.path, options_of(which, one, which.held->life), stage_, one, which.what.host,
                                       which.held->life);
        stage_.events.note("component {} is started again", one.path);
    } catch (const ise::error& thrown) {
        stage_.events.note("component {} is not started: {}", one.path, thrown.what());
        stage_.world.after(300ms, [this, &which, &one] { start_component(which, one); });
    }
}

void fleet::crash_server() {
    if (server_->running()) server_->crash();
    server_frozen_ = false;
}

void fleet::launch_server() {
    if (server_->running()) return;
    try {
        server_ = &server_->restart();
    } catch (const ise::error& thrown) { // by a fault that was planned
        stage_.events.note("the name server does not start: {}", thrown.what());
        stage_.world.after(300ms, [this] { launch_server(); });
    }
}

void fleet::freeze_server() {
    if (!server_->running() || std::exchange(server_frozen_, true)) return;
    server_->pause();
}

void fleet::thaw_server() {
    if (std::exchange(server_frozen_, false)) server_->go_on();
}

const ise::registry* fleet::names() const { return server_->running() ? names_->names() : nullptr; }

void fleet::all_up() {
    for (const auto& host : stage_.plan.hosts) boot_host(host);
    launch_server();
    thaw_server();
    for (auto& one : ships_) {
        thaw(*one);
        launch(*one);
    }
}

bool fleet::all_launched() const {
    for (const auto& one : ships_)
        if (one->now != state::up) return false;
    return server_->running();
}

} // namespace seeds
