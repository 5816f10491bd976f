#include "run.hpp"

#include "actor.hpp"
#include "contender.hpp"
#include "memory.hpp"
#include "storms.hpp"

#include <ise/service/service_host.hpp>
#include <ise/service/session.hpp>

#include <algorithm>

namespace seeds {
namespace {

using namespace std::chrono_literals;
using ise::duration;

// Beyond these something grows that should not.
constexpr std::size_t max_memory = 256u << 20;
constexpr std::size_t max_sessions = 200;
// What is made once and kept (schemas, caches of freed frames) by the first runs of a process.
constexpr std::ptrdiff_t max_left = 1 << 20;

class game {
public:
    explicit game(stage& of) : stage_(of), fleet_(of), storms_(of, fleet_) {}

    void play() {
        stage_.world.bounds().events_in_one_run = 50'000'000;
        fleet_.start();
        storms_.schedule();
        run(stage_.plan.length + 1ms);
        storms_.end();
        bring_back();
        run(weather::settling + 6s);
        check_alive();
        stage_.now = phase::calm;
        run(8s);
        stage_.now = phase::quiet;
        run(8s);
        run_until([this] { return all_read(); }, 90s);
        check_readers();
        if (stage_.events.failed()) return;
        for (auto* one : stage_.readers)
            if (one->finish && !elsewhere(*one)) one->finish();
        check_subscribers();
        check_names();
        stop_all();
        stage_.calls.finish();
    }

    std::uint64_t steps() const noexcept { return steps_; }

private:
    // Runs for a time, looking at everything after each event; ends at the first violation.
    void run(duration time) {
        if (stage_.events.failed()) return;
        stage_.world.run_until([this] { return look(); }, time);
    }
    bool run_until(const std::function<bool()>& done, duration within) {
        bool reached = false;
        auto either = [&] { return look() || (reached = done()); };
        if (!stage_.events.failed()) stage_.world.run_until(either, within);
        return reached && !stage_.events.failed();
    }

    bool look() {
        ++steps_;
        storms_.look();
        look_at_contenders();
        if (steps_ % 16 == 0) look_at_actors();
        if (steps_ % 256 == 0) look_at_registry();
        if (memory_is_counted() && memory().now > max_memory + at_start_)
            stage_.events.broken("{} bytes of memory are in use", memory().now - at_start_);
        return stage_.events.failed();
    }

    void look_at_contenders() {
        std::map<std::pair<std::string, std::uint64_t>, int> confirmed;
        for (auto* one : stage_.contenders) {
            auto epoch = one->epoch();
            if (epoch == 0) continue;
            stage_.names.holds(one->path(), epoch + (stage_.planted.is(bug::epoch_twice) ? 1 - epoch : 0),
                               one->incarnation(), "its holder");
            if (one->confirmed() && ++confirmed[{one->path(), epoch}] > 1)
                stage_.events.broken("'{}' has two confirmed holders under epoch {}", one->path(), epoch);
        }
    }

    void look_at_actors() {
        for (auto* one : stage_.actors) {
            if (one->state() >= ise::component_state::stopped) continue;
            auto& services = one->services();
            if (auto epoch = services.self().epoch)
                stage_.names.holds(one->path(), epoch, services.self().incarnation, "itself");
            if (services.sessions().size() > max_sessions)
                stage_.events.broken("{} has {} sessions", one->path(), services.sessions().size());
            auto open = services.calls().open_calls();
            if (open > stage_.calls.open_calls(one->life()) + stage_.plan.components.size() +
                           2) // each link may be asking for its name
                stage_.events.broken("{} has {} calls open, and made {} that are", one->path(), open,
                                     stage_.calls.open_calls(one->life()));
            for (const auto& [raw, held] : services.sessions()) {
                auto unsent = held->wire().out().pending_bytes();
                if (unsent > 2 * stage_.plan.session_bytes + (8u << 20))
                    stage_.events.broken("{} holds {} bytes for {}", one->path(), unsent, held->peer_name());
            }
        }
    }

    void look_at_registry() {
        const auto* names = fleet_.names();
        if (!names) return;
        for (const auto& event : names->snapshot({}))
            stage_.names.holds(event.name.path, event.name.epoch, event.name.incarnation, "the name server");
    }

    // A component that lost its name for good is started again, if nobody else has it.
    void bring_back() {
        run_until([this] { return fleet_.all_launched(); }, 20s);
        if (stage_.events.failed()) return;
        if (!fleet_.all_launched()) stage_.events.broken("a process cannot be started though everything is healed");
        run(8s);
        for (std::size_t n = 0; n < stage_.plan.components.size(); ++n) {
            const auto& one = stage_.plan.components[n];
            if (holders_of(one.path) == 0 && !stage_.events.failed())
                fleet_.start_component(fleet_.at(fleet_.ship_of(n)), one);
        }
    }

    int holders_of(const std::string& path) const {
        int found = 0;
        for (auto* one : stage_.actors)
            if (one->path() == path && one->state() < ise::component_state::stopping) ++found;
        return found;
    }

    // Everything was healed a while ago: it is as if nothing had been.
    void check_alive() {
        if (stage_.events.failed()) return;
        for (const auto& one : stage_.plan.components)
            if (int found = holders_of(one.path); found != 1)
                stage_.events.broken("'{}' has {} living holders after everything was healed", one.path, found);
        const auto* names = fleet_.names();
        for (const auto& one : stage_.plan.components)
            if (names->snapshot(one.path).empty())
                stage_.events.broken("'{}' is not registered, and everything was healed", one.path);
    }

    // Who holds the name may listen at another endpoint now.
    bool elsewhere(const reader& one) const { return !one.by_name && stage_.calls.rivalled.contains(one.provider); }

    bool has_read(const reader& one) const { return elsewhere(one) || (one.model && one.waiting && one.connected()); }
    bool all_read() const {
        return std::ranges::all_of(stage_.readers, [this](const reader* one) { return has_read(*one); });
    }
    void check_readers() {
        for (const auto* one : stage_.readers)
            if (!has_read(*one))
                stage_.events.broken("{} {} {}, long after everything was healed", one->who,
                                     one->model && one->connected() ? "has not read all that came from"
                                                                    : "is not subscribed to",
                                     one->provider);
    }

    void check_subscribers() {
        std::map<std::string, std::size_t> wanted;
        for (auto* one : stage_.readers) wanted[one->provider] += one->model != nullptr && one->connected();
        for (auto* one : stage_.actors)
            if (one->serves() && one->subscribers() != wanted[one->path()])
                stage_.events.broken("{} has {} subscribers, and there are {}", one->path(), one->subscribers(),
                                     wanted[one->path()]);
    }

    // One holder of a name, and the name server knows the same one.
    void check_names() {
        const auto* names = fleet_.names();
        std::map<std::string, std::string> held;
        for (auto* one : stage_.contenders) {
            if (one->epoch() == 0) continue;
            if (!held.emplace(one->path(), "").second)
                stage_.events.broken("'{}' has two holders long after everything was healed", one->path());
        }
        for (auto* one : stage_.actors) {
            if (!one->serves()) continue;
            auto known = names->snapshot(one->path());
            if (known.empty() || known.front().name.incarnation != one->services().self().incarnation)
                stage_.events.broken("'{}' serves, and the name server knows another life of it", one->path());
        }
    }

    void stop_all() {
        if (stage_.events.failed()) return;
        stage_.sky.begin_everywhere(); // what still works is interrupted now
        std::size_t over = 0;
        for (std::size_t n = 0; n < fleet_.ships(); ++n) fleet_.stop(fleet_.at(n), [&over] { ++over; });
        run_until([&] { return over == fleet_.ships(); }, 30s);
        if (stage_.events.failed()) return;
        if (over != fleet_.ships()) stage_.events.broken("not every process has stopped");
        fleet_.crash_server();
        stage_.world.run_until_idle(1h);
        if (!stage_.world.run_until_idle(1h)) stage_.events.broken("everything has stopped, and something goes on");
    }

    stage& stage_;
    fleet fleet_;
    storms storms_;
    std::uint64_t steps_ = 0;
    std::size_t at_start_ = memory().now;
};

} // namespace

outcome play(std::uint64_t seed, const run_options& options) {
    outcome result;
    count_memory();
    auto before = memory().now;
    {
        stage all(seed, sabotage(options.planted), options.verbose);
        if (options.verbose) fmt::print("{}", all.plan.text());
        game one(all);
        try {
            one.play();
        } catch (const std::exception& thrown) {
            all.events.broken("the world stops: {}", thrown.what());
        }
        result.passed = !all.events.failed();
        if (!result.passed) {
            result.violation = all.events.violation();
            result.newest = all.events.newest();
        }
        result.steps = one.steps();
        result.hash = all.events.hash();
        result.virtual_seconds = std::chrono::duration<double>(all.world.elapsed()).count();
        result.tallies = all.events.tallies();
    }
    result.max_memory = memory().most - before;
    if (options.planted == bug::memory_left) [[maybe_unused]]
        static auto* kept = new std::string(2 << 20, 'x');
    auto after = memory().now;
    auto as_large = result.tallies; // what is told is no leak
    result.memory_left =
        static_cast<std::ptrdiff_t>(after - (memory().now - after)) - static_cast<std::ptrdiff_t>(before);
    if (result.passed && result.memory_left > max_left) {
        result.passed = false;
        result.violation = fmt::format("{} bytes of memory were not given back", result.memory_left);
    }
    return result;
}

} // namespace seeds
