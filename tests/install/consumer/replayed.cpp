// A test of a user's own: a voyage is recorded on the virtual world, and replayed into the navigator as it was and into
// one that steers otherwise. usage: replayed FOLDER
#include <ise/bag/recorder.hpp>
#include <ise/ise.hpp>
#include <ise/name_server/name_server.hpp>
#include <ise/replay/replay_world.hpp>

#include <cstdint>
#include <cstdio>
#include <functional>
#include <memory>
#include <string>
#include <utility>

using namespace std::chrono_literals;

struct fix {
    std::int64_t number = 0;
};
struct rudder {
    double angle_deg = 0;
};
inline constexpr ise::subscription<fix> fixes{"fixes"};
inline constexpr ise::subscription<rudder> steering{"steering"};

namespace {

class boat final : public ise::component {
    ise::task<> run() override {
        auto out = publish(fixes);
        for (fix next;; ++next.number) {
            co_await sleep(100ms);
            out(next);
        }
    }
};

class navigator final : public ise::component {
public:
    explicit navigator(double bias) : bias_(bias) {}

private:
    ise::task<> run() override {
        auto out = publish(steering);
        auto sea = co_await find("sea/boat");
        auto some = co_await sea.subscribe(fixes);
        for (;;) {
            auto packet = co_await some.next();
            if (!packet) co_return;
            out(rudder{static_cast<double>(packet->number % 7) + (packet->number == 20 ? bias_ : 0)});
        }
    }

    double bias_;
};

struct program {
    program(ise::environment& env, ise::node_options options) : node(env, std::move(options)) {}
    ise::node node;
};

ise::component_options listening(const std::string& at) {
    ise::component_options made;
    made.listen = {ise::endpoint::parse(at).value()};
    return made;
}

bool record(const std::string& file) {
    ise::sim::world world;
    auto start = [&](const std::string& host, const std::function<void(ise::node&)>& begin, bool use_names = true) {
        ise::node* made = nullptr;
        auto run = [&](ise::sim::process& env) {
            ise::node_options options;
            options.use_names = use_names;
            auto one = std::make_shared<program>(env, options);
            made = &one->node;
            begin(one->node);
            return one;
        };
        const auto names = "tcp://" + world.host("names").address() + ":7400";
        world.host(host).start_process("one", run, {{"ISE_NAME_SERVER", names}});
        return made;
    };
    start(
        "names",
        [](ise::node& on) {
            auto where = listening("tcp://0.0.0.0:7400");
            where.registers = false;
            ise::name_server_options fresh;
            fresh.fresh = true;
            on.start<ise::name_server>(std::string(ise::naming::server_path), where, fresh);
        },
        false);
    auto* recording = start("log", [&](ise::node& on) {
        ise::bag::recorder_options options;
        options.files.file = file;
        on.start<ise::bag::recorder>("log/recorder", listening("tcp://0.0.0.0:0"), options);
    });
    world.run_for(1s);
    start("shore", [](ise::node& on) { on.start<navigator>("sea/navigator", listening("tcp://0.0.0.0:0"), 0.0); });
    world.run_for(1s);
    start("sea", [](ise::node& on) { on.start<boat>("sea/boat", listening("tcp://0.0.0.0:0")); });
    world.run_for(5s);
    recording->stop();
    return world.run_until([&] { return recording->all_stopped(); });
}

ise::replay_report replay(const std::string& file, double bias) {
    ise::replay_world world;
    ise::replay_options options;
    ise::replayed_component one;
    one.path = "sea/navigator";
    one.make = [bias] { return std::make_unique<navigator>(bias); };
    options.components.push_back(std::move(one));
    return world.play(file, options);
}

} // namespace

int main(int count, char** arguments) {
    if (count != 2) return 2;
    const auto file = std::string(arguments[1]) + "/voyage.mcap";
    if (!record(file)) return 1;
    const auto same = replay(file, 0), other = replay(file, 0.5);
    const auto found = other.first_difference ? other.first_difference->text() : std::string("none");
    std::printf("%s: %llu packets compared; with another navigator the first difference is %s\n", file.c_str(),
                static_cast<unsigned long long>(same.counts.compared), found.c_str());
    const bool named = found.find("steering") != std::string::npos;
    return !same.first_difference && same.counts.compared > 20 && named ? 0 : 1;
}
