// Shared memory between two loops of ISE's own: with bells, and where both look for what comes.
#include <ise/core/real/environment.hpp>
#include <ise/ise.hpp>
#include <ise/service/service_host.hpp>

#include <support/boat_services.hpp>
#include <support/catch.hpp>

#include <fmt/format.h>

#include <future>

#include <unistd.h>

namespace shm_loops_test {

namespace {

using namespace boat_services;
using namespace std::chrono_literals;

class mirror final : public ise::component {
    ise::task<> run() override {
        provide(echo, [](blob given) -> blob { return given; });
        co_return;
    }
};

struct picture {
    std::uint32_t number = 0;
    std::vector<std::uint32_t> pixels;
};
inline constexpr ise::subscription<picture> camera{"camera"};

class eye final : public ise::component {
    ise::task<> run() override {
        auto out = publish(camera);
        while (out.subscribers() == 0) co_await sleep(1ms);
        for (std::uint32_t number = 0;; ++number) {
            picture next{number, std::vector<std::uint32_t>(4'000 + number % 7 * 10'000, number)};
            co_await out.send(next);
            if (number % 8 == 7) co_await sleep(10us); // the turn of the loop's others
        }
    }
};

// Runs `work` of one component against another one, each on a loop of its own. "all", or the text of an exception.
template <class Provider, class Work>
std::string run_against(ise::duration poll, Work work) {
    ise::real_environment env;
    ise::node_options how;
    how.use_names = false;
    how.log = {};
    how.poll = poll;
    ise::node node(env, how);
    ise::component_options options;
    options.listen = {ise::endpoint::parse(fmt::format("shm://@ise-unit-shm-loops-{}", ::getpid())).value()};
    const auto at = node.start<Provider>("boat", options).services().listening().front();
    std::promise<std::string> result;
    node.start("shore", [&](ise::component& self) -> ise::task<> {
        try {
            auto boat = self.at(at);
            auto working = work(self, std::move(boat));
            co_await std::move(working);
            result.set_value("all");
        } catch (const std::exception& wrong) {
            result.set_value(wrong.what());
        }
    });
    auto got = result.get_future().get();
    node.stop();
    node.wait();
    return got;
}

} // namespace

TEST_CASE("large packets are whole while their publisher goes on in the same memory", "[shm]") {
    const bool lossless = GENERATE(true, false);
    CAPTURE(lossless);
    auto work = [&](ise::component& self, ise::remote boat) -> ise::task<> {
        const auto policy = lossless ? ise::subscribe_options::lossless(20) : ise::subscribe_options::keep_latest();
        auto pictures = co_await boat.subscribe(camera, policy);
        for (int seen = 0; seen < 2000; ++seen) {
            auto got = co_await pictures.next();
            if (!got) throw ise::error(pictures.cause());
            if (got->pixels.size() != 4'000 + got->number % 7 * 10'000) throw std::runtime_error("another size");
            for (auto pixel : got->pixels)
                if (pixel != got->number) throw std::runtime_error("a pixel of another picture");
            if (seen % 500 == 0) co_await self.sleep(2ms);
        }
    };
    REQUIRE(run_against<eye>({}, work) == "all");
}

TEST_CASE("many calls, small and big, pass between two loops of ISE's own", "[shm]") {
    const bool polls = GENERATE(false, true);
    CAPTURE(polls);
    auto work = [](ise::component& self, ise::remote boat) -> ise::task<> {
        for (std::size_t round = 0; round < 3000; ++round) {
            blob sent;
            sent.content.assign(round % 500 == 499 ? 3'000'000 : round, static_cast<std::uint8_t>(round));
            auto size = sent.content.size();
            auto got = co_await boat.call(echo, std::move(sent), 30s);
            if (got.content.size() != size) throw std::runtime_error("another size");
            // Both sleep in between, and wake each other.
            if (round % 300 == 0) co_await self.sleep(2ms);
        }
    };
    REQUIRE(run_against<mirror>(polls ? ise::duration(200us) : ise::duration(), work) == "all");
}

} // namespace shm_loops_test
