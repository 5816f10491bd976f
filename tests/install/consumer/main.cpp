// A program of its own that uses ISE: its components run on an io_context that four threads of the program run already.
#include <ise/asio.hpp>
#include <ise/ise.hpp>
#include <ise/service/service_host.hpp>

#include <asio/executor_work_guard.hpp>
#include <asio/io_context.hpp>

#include <cstdio>
#include <thread>
#include <vector>

using namespace std::chrono_literals;

struct fix {
    double latitude_deg = 0;
    std::uint32_t number = 0;
};
struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted = false;
    std::string reason;
};

inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};

namespace {

class boat : public ise::component {
    ise::task<> run() override {
        provide(helm, [](set_mode wanted) -> ise::task<mode_set> {
            co_return mode_set{wanted.mode != "fly", "boats sail"};
        });
        auto fixes = publish(position);
        for (std::uint32_t number = 0;; ++number) {
            co_await sleep(1ms);
            fixes(fix{28.15, number});
        }
    }
};

ise::task<> ask_and_listen(ise::component& self, ise::endpoint where, unsigned& good) {
    auto provider = self.at(where);
    set_mode impossible{"fly"};
    auto refused = co_await provider.call(helm, impossible, 30s);
    auto short_form = co_await provider.call(helm, "hold");
    auto fixes = co_await provider.subscribe(position);
    std::uint32_t last = 0, lost = 0;
    for (int count = 0; count < 20; ++count) {
        auto packet = co_await fixes.next();
        if (!packet) co_return;
        if (count > 0) lost += packet->number - last - 1 - static_cast<std::uint32_t>(packet.lost_before().value());
        last = packet->number;
    }
    good += !refused.accepted && refused.reason == "boats sail" && short_form.accepted && lost == 0;
}

} // namespace

int main() {
    asio::io_context program;
    auto open = asio::make_work_guard(program);
    std::vector<std::thread> threads;
    for (int n = 0; n < 4; ++n) threads.emplace_back([&program] { program.run(); });

    unsigned good = 0;
    {
        ise::real_environment env;
        ise::node_options settings;
        settings.use_names = false; // everything is reached by its endpoint
        ise::node node(env, settings);

        ise::component_options here;
        here.executor = program.get_executor();
        for (const char* listen : {"tcp://127.0.0.1:0", "inproc://boat"}) {
            here.listen = {ise::endpoint::parse(listen).value()};
            auto& provider = node.start<boat>(listen[0] == 't' ? "far" : "near", here);
            auto where = provider.services().listening().front();
            here.listens = false;
            auto& console = node.start(
                "", [](ise::component& self) -> ise::task<> { co_await self.sleep(1h); }, here);
            console.wait(ask_and_listen(console, where, good));
            here.listens = true;
        }
        node.stop();
        node.wait();
        for (const auto& report : node.reports()) good += report.still_running.empty() && report.failure.empty();
    }
    open.reset();
    for (auto& thread : threads) thread.join();
    std::printf("ISE used from outside: %u of 6\n", good);
    return good == 6 ? 0 : 1;
}
