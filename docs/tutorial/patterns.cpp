#include <ise/asio.hpp>
#include <ise/core/loop.hpp>
#include <ise/ise.hpp>

#include <asio/experimental/awaitable_operators.hpp>
#include <asio/use_awaitable.hpp>

#include <functional>
#include <stop_token>
#include <thread>

using namespace std::chrono_literals;

struct fix {
    double latitude_deg = 0;
    double longitude_deg = 0;
    float speed_kn = 0;
};

inline constexpr ise::subscription<fix> position{"position"};

// The library of a receiver: calls back on a thread of its own until it is destroyed.
class driver {
public:
    explicit driver(std::function<void(fix)> on_fix)
        : thread_([on_fix = std::move(on_fix)](const std::stop_token& stop) {
              while (!stop.stop_requested()) {
                  on_fix(fix{28.10, -15.45, 2.1f});
                  std::this_thread::sleep_for(100ms);
              }
          }) {}

private:
    std::jthread thread_;
};

class receiver : public ise::component {
    ise::task<> run() override {
        auto out = publish(position);
        auto gate = on().gate();
        driver gps([gate, out](fix sample) {            // on the driver's thread
            gate->post([out, sample] { out(sample); }); // on the component's loop
        });
        for (;;) co_await sleep(1h); // until the component stops; then ~driver ends the callbacks
    }
};

class shore : public ise::component {
    ise::task<> run() override {
        auto boat = co_await find("tutorial/boat");
        heard_at_ = now();
        listen(boat, position, [this](const fix&) { heard_at_ = now(); });
        spawn("watchdog", watch());
    }

    ise::task<> watch() {
        for (;;) {
            co_await sleep(1s);
            if (now() - heard_at_ > 3s) log().warning("no position for 3 s");
        }
    }

    ise::time_point heard_at_{};
};

class slow_shore : public ise::component {
    ise::task<> run() override {
        auto boat = co_await find("tutorial/boat");
        auto wanted = ise::subscribe_options::disconnect(16); // ends at the first packet that would be lost
        wanted.min_interval = 500ms; // at most two packets per second; the others are skipped, not lost
        auto fixes = co_await boat.subscribe(position, wanted);
        for (;;) {
            auto packet = co_await fixes.next();
            if (!packet) break;
            log().info(std::to_string(packet->latitude_deg));
        }
        log().warning(fixes.cause().message());
    }
};

class fleet : public ise::component {
    ise::task<fix> newest(std::string path) {
        auto boat = at(path);
        auto fixes = co_await boat.subscribe(position);
        auto packet = co_await fixes.next();
        if (!packet) throw ise::error(fixes.cause());
        co_return *packet;
    }

    ise::task<> run() override {
        using namespace asio::experimental::awaitable_operators;
        auto first = ise::async_run(get_executor(), newest("tutorial/boat"), asio::use_awaitable);
        auto second = ise::async_run(get_executor(), newest("tutorial/other"), asio::use_awaitable);
        auto both = std::move(first) && std::move(second); // if one fails, the other is cancelled
        auto [one, other] = co_await std::move(both);
        log().info(std::to_string(one.latitude_deg - other.latitude_deg));
    }
};

int main() {
    ise::real_environment env;
    ise::node node(env);
    node.start<receiver>("tutorial/boat");
    node.start<receiver>("tutorial/other");
    node.start<shore>("tutorial/shore");
    node.start<slow_shore>("tutorial/slow_shore");
    node.start<fleet>("tutorial/fleet");
    return ise::run_until_signal(node);
}
