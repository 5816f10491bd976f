#include <ise/sim/host.hpp>

#include <ise/sim/datagram_end.hpp>
#include <ise/sim/serial_line.hpp>
#include <ise/sim/tcp_acceptor.hpp>

#include <asio/any_io_executor.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::sim {
namespace {

class sim_alarm final : public alarm {
public:
    sim_alarm(scheduler& engine, std::shared_ptr<flow> where, loop& owner, const duration& ahead)
        : engine_(engine), where_(std::move(where)), loop_(owner), ahead_(ahead) {}
    ~sim_alarm() override { engine_.cancel(armed_); }

    void arm(time_point at) override {
        engine_.cancel(armed_);
        armed_ = engine_.at(at - ahead_, where_, [this] {
            armed_ = {};
            loop_.on_alarm();
        });
    }

private:
    scheduler& engine_;
    std::shared_ptr<flow> where_;
    loop& loop_;
    const duration& ahead_;
    scheduler::ticket armed_;
};

} // namespace

// A loop of a process, and its end.
class sim_loop final : public loop_host {
public:
    sim_loop(process& owner, std::shared_ptr<flow> where)
        : owner_(owner), engine_(owner.world().engine()), where_(std::move(where)),
          loop_(owner, flow_executor(where_), [engine = &engine_] { return engine->running_here(); }) {
        loop_.use_alarm(std::make_unique<sim_alarm>(engine_, where_, loop_, owner.clock_offset_));
        owner_.loops_.push_back(this);
    }

    ~sim_loop() override {
        end();
        std::erase(owner_.loops_, this);
    }

    // What is suspended is destroyed here, while everything that it refers to still stands.
    void end() override {
        ended_ = true;
        where_->alive = false;
        loop_.abandon();
        engine_.kill(*where_);
    }

    bool ended() const noexcept { return ended_; }
    ise::loop& loop() noexcept override { return loop_; }
    const std::shared_ptr<flow>& where() const noexcept { return where_; }

private:
    process& owner_;
    scheduler& engine_;
    std::shared_ptr<flow> where_;
    ise::loop loop_;
    bool ended_ = false;
};

process::process(sim::host& on, network& net, std::string name, unsigned life, std::uint64_t id, program run,
                 std::map<std::string, std::string> variables)
    : socket_owner(on.world(), net, on), host_(on), name_(std::move(name)),
      random_(on.world().seed(), fmt::format("process {}/{}#{}", on.name(), name_, life)), program_(std::move(run)),
      variables_(std::move(variables)) {
    identity_.host_name = on.name();
    identity_.host_key = fmt::format("sim:{}#{}", on.name(), on.boots());
    identity_.process_key = fmt::format("sim:{}/{}#{}", on.name(), name_, life);
    identity_.process_id = id;
}

process::~process() { tear_down(); }

void process::start() {
    if (program_) keep(program_(*this));
}

process& process::restart() {
    if (running_) crash();
    return host_.start_process(name_, program_, variables_);
}

void process::pause() {
    paused_ = true;
    for (auto* each : loops_) world().engine().pause(*each->where());
}

void process::go_on() {
    paused_ = false;
    for (auto* each : loops_) world().engine().go_on(each->where());
}

void process::finish(ending how) {
    if (!std::exchange(running_, false)) return;
    auto& engine = world().engine();
    world().note(how == ending::stop ? "stop" : "crash", host_.name() + "/" + name_);
    bool inside = false;
    for (auto* each : loops_) {
        inside = inside || engine.current() == each->where().get();
        each->where()->alive = false;
    }
    for (auto& each : std::exchange(resources_, {}))
        if (auto open = each.lock()) open->end(how);
    if (inside) engine.when_outside([this] { tear_down(); });
    else tear_down();
}

void process::tear_down() {
    running_ = false;
    // First what is suspended, then what it refers to.
    for (;;) { // what ends may own another loop
        auto next = std::find_if(loops_.begin(), loops_.end(), [](auto* each) { return !each->ended(); });
        if (next == loops_.end()) break;
        (*next)->end();
    }
    while (!kept_.empty()) {
        auto last = std::move(kept_.back());
        kept_.pop_back();
    }
    world().engine().bury();
}

time_point process::now() const { return world().now() + clock_offset_; }

wall_time process::wall() const { return world().wall_start + world().elapsed() + wall_offset_; }

std::optional<std::string> process::variable(const std::string& name) const {
    auto found = variables_.find(name);
    if (found == variables_.end()) return {};
    return found->second;
}

std::unique_ptr<loop_host> process::new_loop(std::string name) {
    if (!running_) throw std::logic_error(fmt::format("process '{}' has ended: it makes no loops", name_));
    auto where = world().engine().make_flow(fmt::format("{}/{}/{}", host_.name(), name_, name));
    where->paused = paused_;
    return std::make_unique<sim_loop>(*this, std::move(where));
}

std::unique_ptr<loop_host> process::make_loop(const std::string& name) { return new_loop(name); }

std::unique_ptr<loop_host> process::adopt(asio::any_io_executor executor, bool) {
    const auto* its = executor ? &asio::query(executor, asio::execution::context) : nullptr;
    if (its != &static_cast<asio::execution_context&>(world().context()))
        throw std::logic_error(fmt::format("process '{}' of the virtual world can adopt only executors of that world: "
                                           "world.context(), or a loop's",
                                           name_));
    return new_loop("adopted");
}

std::shared_ptr<flow> process::flow_of(const loop& on) const {
    for (auto* each : loops_)
        if (&each->loop() == &on) return each->where();
    throw std::logic_error(fmt::format("this loop belongs to another process than '{}'", name_));
}

result<void> process::usable(const char* what) const {
    if (!running_) return failure(errc::io_failed, fmt::format("{}: process '{}' has ended", what, name_));
    return {};
}

task<result<std::unique_ptr<stream>>> process::connect(loop& on, endpoint to) {
    auto can = usable("connect");
    if (!can) co_return can.error();
    if (auto fault = begin_operation())
        co_return failure(errc::unreachable, fmt::format("cannot connect to {}: {}", to.text(), fault.message()));
    if (to.kind == protocol::inproc) co_return inproc_.connect(on, to.path);
    if (to.kind != protocol::tcp && to.kind != protocol::local)
        co_return failure(errc::invalid_argument, fmt::format("{} is not an endpoint of a plain stream", to.text()));
    auto made = co_await connect_tcp(*this, on, to);
    co_return made;
}

result<std::unique_ptr<listener>> process::listen(loop& on, const endpoint& at) {
    auto can = usable("listen");
    if (!can) return can.error();
    if (auto fault = begin_operation()) return io_failure(fmt::format("cannot listen on {}", at.text()), fault);
    if (at.kind == protocol::inproc) return inproc_.listen(on, at.path);
    if (at.kind != protocol::tcp && at.kind != protocol::local)
        return failure(errc::invalid_argument,
                       fmt::format("{} is not an endpoint that accepts plain streams", at.text()));
    return listen_tcp(*this, on, at);
}

result<std::unique_ptr<datagram_socket>> process::open_datagram(loop& on, const endpoint& at) {
    auto can = usable("open_datagram");
    if (!can) return can.error();
    if (auto fault = begin_operation()) return io_failure(fmt::format("cannot open {}", at.text()), fault);
    if (at.kind != protocol::udp)
        return failure(errc::invalid_argument, fmt::format("{} is not a datagram endpoint: udp://...", at.text()));
    return open_udp(*this, on, at);
}

result<std::unique_ptr<stream>> process::open_serial(loop& on, const serial_options& options) {
    auto can = usable("open_serial");
    if (!can) return can.error();
    if (auto fault = begin_operation()) return io_failure(fmt::format("cannot open {}", options.device), fault);
    if (options.baud == 0)
        return failure(errc::invalid_argument, fmt::format("cannot open {} at 0 baud", options.device));
    auto found = host_.serial_lines.find(options.device);
    if (found == host_.serial_lines.end())
        return failure(errc::io_failed,
                       fmt::format("cannot open {}: host '{}' has no such device", options.device, host_.name()));
    return found->second->open_device(*this, on, options.device, options.baud);
}

result<pseudo_terminal> process::open_pseudo_terminal(loop& on, const std::string& link) {
    auto can = usable("open_pseudo_terminal");
    if (!can) return can.error();
    if (auto fault = begin_operation()) return io_failure(fmt::format("cannot make {}", link), fault);
    auto name = link.substr(link.rfind('/') + 1);
    if (name.empty()) name = fmt::format("pts{}", host_.serial_lines.size());
    auto far = serial_line::into(world(), host_, name).open_far_end(*this, on);
    if (!far) return far.error();
    return pseudo_terminal{std::move(*far), "/dev/" + name};
}

result<std::string> process::read_file(const std::string& path, std::size_t max_bytes) {
    auto can = usable("read_file");
    if (!can) return can.error();
    if (auto fault = begin_operation()) return io_failure(fmt::format("cannot read {}", path), fault);
    auto found = host_.files().find(path);
    if (found == host_.files().end())
        return failure(errc::io_failed, fmt::format("cannot read {}: no such file on host '{}'", path, host_.name()));
    if (found->second.size() > max_bytes)
        return failure(errc::too_large,
                       fmt::format("{} has {} bytes, more than {}", path, found->second.size(), max_bytes));
    return found->second;
}

host::host(world_core& world, network& net, std::string name, std::string address)
    : machine(std::move(name), std::move(address)), world_(world), net_(net) {}
host::~host() = default;

process& host::start_process(std::string name, program run, std::map<std::string, std::string> variables) {
    if (!up_) throw std::logic_error(fmt::format("host '{}' is down: boot() it first", this->name()));
    const auto life = ++lives_[name];
    world_.note("start", this->name() + "/" + name, life);
    processes_.push_back(std::make_unique<process>(*this, net_, std::move(name), life, next_process_id_++,
                                                   std::move(run), std::move(variables)));
    auto& made = *processes_.back();
    made.start();
    return made;
}

void host::end_processes(bool quietly) {
    for (std::size_t i = 0; i < processes_.size(); ++i) // ending one may not start another, but who knows
        if (processes_[i]->running()) processes_[i]->finish(quietly ? ending::host_lost : ending::crash);
}

void host::crash() {
    if (!up_) return;
    world_.note("host_lost", name());
    up_ = false;
    end_processes(true);
}

void host::boot() {
    if (up_) return;
    up_ = true;
    ++boots_;
    world_.note("boot", name(), boots_);
    net_.look_again();
}

} // namespace ise::sim
