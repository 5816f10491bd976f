#include <ise/ise.hpp>

#include <fmt/core.h>

#include <string>

using namespace std::chrono_literals;

struct fix {
    double latitude_deg = 0;
    double longitude_deg = 0;
    float speed_kn = 0;
};

inline constexpr ise::subscription<fix> position{"position"};

class boat : public ise::component {
    ise::task<> run() override {
        publish_every(position, 100ms, [this] {
            at_.latitude_deg += 0.01;
            return at_;
        });
        co_return;
    }
    fix at_{28.10, -15.45, 2.1f};
};

class shore : public ise::component {
    ise::task<> run() override {
        auto boat = co_await find("tutorial/boat");
        ise::subscribe_options wanted;
        wanted.last_value = false; // only what is published from now on
        auto fixes = co_await boat.subscribe(position, wanted);
        double before = 0;
        for (int seen = 0; seen < 3; ++seen) {
            auto packet = co_await fixes.next();
            if (!packet) { // the boat has withdrawn the service, say
                fmt::print("it ended: {}\n", fixes.cause().message());
                break;
            }
            auto lost = packet.lost_before(); // empty where nobody knows: the boat restarted
            if (before != 0)
                fmt::print("{:.2f} degrees north, {} lost\n", packet->latitude_deg - before,
                           lost ? std::to_string(*lost) : "unknown");
            before = packet->latitude_deg;
        }
        fmt::print("received {}\n", fixes.counts().received);
        stop(); // leaving the scope unsubscribes
    }
};

int main() {
    ise::real_environment env;
    ise::node boats(env), people(env);
    boats.start<boat>("tutorial/boat");
    people.start<shore>("tutorial/shore");
    return ise::run_until_signal(people);
}
