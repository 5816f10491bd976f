#include <ise/replay/replay_world.hpp>

#include <ise/bag/reader.hpp>
#include <ise/bag/recorder.hpp>
#include <ise/component/node.hpp>
#include <ise/component/served_calls.hpp>
#include <ise/core/error.hpp>
#include <ise/name_server/name_server.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <limits>
#include <map>
#include <utility>

namespace ise {
namespace {

using namespace std::chrono_literals;

constexpr duration time_to_find = 2s; // each other, before the first message
constexpr duration overtime = 1min;   // of a replay, after its recording
constexpr duration slice = 10s;       // between two calls of `on_progress`
constexpr const char* outside = "outside";

endpoint any_port() { return endpoint::parse("tcp://0.0.0.0:0").value(); }

std::string host_of(const replayed_component& one) {
    if (!one.host.empty()) return one.host;
    auto made = one.path;
    std::ranges::replace(made, '/', '-');
    return made;
}

// The processes of a replay, beside those that its user has made. They end with it.
class stage {
public:
    stage(sim::world& in, const replay_options& options) : world_(in), options_(options) {}
    ~stage() {
        for (auto* one : {&recorder_, &outside_})
            if (*one) (*one)->stop();
        for (auto& [path, process] : components_) process->stop();
        if (names_) names_->stop();
    }
    stage(const stage&) = delete;
    stage& operator=(const stage&) = delete;

    void start_names() {
        auto run = [this](sim::process& env) -> std::shared_ptr<void> {
            auto terms = terms_of_nodes();
            terms.use_names = false;
            auto made = std::make_shared<node>(env, terms);
            component_options where;
            where.listen = {endpoint::parse("tcp://0.0.0.0:7400").value()};
            where.registers = false;
            name_server_options first;
            first.fresh = true;
            made->start<name_server>(std::string(naming::server_path), where, first);
            return made;
        };
        names_ = &world_.host("names").start_process("names", run);
    }

    // Whatever was outside of the components.
    void start_outside(const std::string& file) {
        bag::player_options how;
        how.file = file;
        how.only = options_.only;
        how.ignored = options_.ignored;
        how.listen = {any_port()};
        how.delay = time_to_find;
        for (const auto& one : options_.components) how.tested.push_back(one.path);
        how.on_tested = [this](const std::string& path, bool there) { come(path, there); };
        how.latency = world_.net().between(outside, host_of(options_.components.front())).latency;
        auto run = [this, how](sim::process& env) -> std::shared_ptr<void> {
            struct program {
                ise::node node;
                bag::player player;
                program(sim::process& env, node_options terms, bag::player_options how)
                    : node(env, std::move(terms)), player(node, std::move(how)) {}
            };
            auto made = std::make_shared<program>(env, terms_of_nodes(), how);
            player_ = &made->player;
            return made;
        };
        outside_ = &world_.host(outside).start_process("player", run);
    }

    void start_recorder() {
        if (options_.out.empty()) return;
        auto run = [this](sim::process& env) -> std::shared_ptr<void> {
            auto made = std::make_shared<node>(env, terms_of_nodes());
            bag::recorder_options how;
            for (const auto& one : options_.components) how.paths.push_back(one.path);
            how.files.file = options_.out;
            how.name_servers = terms_of_nodes().name_servers;
            component_options quiet;
            quiet.listens = false;
            quiet.registers = false;
            made->start<bag::recorder>("ise/recorder", quiet, how);
            recording_ = made.get();
            return made;
        };
        recorder_ = &world_.host(outside).start_process("recorder", run);
    }

    void end_recording() {
        if (!recording_) return;
        recording_->stop();
        world_.run_until([this] { return recording_->all_stopped(); });
        for (const auto& one : recording_->reports())
            if (!one.failure.empty()) throw error(errc::io_failed, one.failure);
    }

    bag::player& player() { return *player_; }

private:
    node_options terms_of_nodes() const {
        node_options made;
        made.name = "replay";
        made.name_servers = {endpoint::parse("tcp://names:7400").value()};
        made.log = options_.log ? options_.log : log_sink([](const log_record&) {});
        return made;
    }

    void come(const std::string& path, bool there) {
        auto found = components_.find(path);
        if (found != components_.end()) {
            if (there) found->second = &found->second->restart();
            else found->second->crash();
            return;
        }
        auto of = std::ranges::find(options_.components, path, &replayed_component::path);
        if (!there || of == options_.components.end()) return; // lies below one, which brings it
        auto run = [this, of](sim::process& env) -> std::shared_ptr<void> {
            auto made = std::make_shared<node>(env, terms_of_nodes());
            auto where = of->options;
            if (where.listen.empty()) where.listen = {any_port()};
            made->launch(of->path, of->make(), std::move(where));
            return made;
        };
        components_[path] = &world_.host(host_of(*of)).start_process(path, run, {{record_calls_variable, "1"}});
    }

    sim::world& world_;
    const replay_options& options_;
    sim::process *names_ = nullptr, *outside_ = nullptr, *recorder_ = nullptr;
    std::map<std::string, sim::process*> components_;
    bag::player* player_ = nullptr;
    node* recording_ = nullptr;
};

void check(const replay_options& options) {
    if (options.components.empty())
        throw error(errc::invalid_argument, "a replay needs the components that are tested (replay_options)");
    for (const auto& one : options.components) {
        if (!naming::is_path(one.path) || !one.make)
            throw error(
                errc::invalid_argument,
                fmt::format("a replayed component needs its path and a function that makes it: '{}'", one.path));
        if (std::ranges::count(options.components, one.path, &replayed_component::path) > 1)
            throw error(errc::invalid_argument, fmt::format("two replayed components are named '{}'", one.path));
    }
}

} // namespace

replay_report replay_world::play(const std::string& file, const replay_options& options) {
    check(options);
    if (std::exchange(played_, true))
        throw error(errc::invalid_argument, "a world replays one recording; make another world for the next");
    replay_report made;
    auto opened = bag::open_file(file).value();
    const auto about = bag::read_summary(*opened).value().statistics;
    made.length = duration(static_cast<std::int64_t>(about.message_end_time - about.message_start_time));
    // The player begins as soon as it is started: the clock is set so that its first message has the recorded time.
    wall_start = wall_time(std::chrono::nanoseconds(about.message_start_time)) - elapsed() - time_to_find;
    bounds().events_in_one_run = std::numeric_limits<std::uint64_t>::max();
    const auto until = now() + time_to_find + made.length + overtime;
    const auto began = now();

    stage all(*this, options);
    all.start_names();
    all.start_recorder();
    all.start_outside(file);
    while (!run_until([&] { return all.player().done(); }, slice)) {
        if (options.on_progress)
            options.on_progress(std::min(1.0, static_cast<double>((now() - began).count()) /
                                                  static_cast<double>((until - began).count())));
        if (now() > until)
            throw error(errc::timed_out,
                        fmt::format("the replay of {} did not end {} s after the end of the recording", file,
                                    std::chrono::duration_cast<std::chrono::seconds>(overtime).count()));
    }
    all.end_recording();
    if (auto trouble = all.player().trouble()) throw error(*trouble);
    made.first_difference = all.player().first_difference();
    made.counts = all.player().counts();
    made.hash = trace().hash();
    return made;
}

} // namespace ise
