// Components for the bridge to show: one that counts up when it is asked to, and a winch.
#include <ise/component/component_type.hpp>
#include <ise/ise.hpp>

#include <cstdint>
#include <memory>
#include <string>
#include <vector>

namespace {

using namespace std::chrono_literals;

struct amount {
    std::uint32_t packets = 0;
};
struct counted {
    std::uint32_t last = 0;
};
struct tally {
    std::uint32_t n = 0;
    std::string text;
};
inline constexpr ise::request_response<amount, counted> count_up{"count_up"};
inline constexpr ise::subscription<tally> marks{"marks"};  // each counts
inline constexpr ise::subscription<tally> newest{"state"}; // the latest counts
inline constexpr ise::subscription<tally> secret{"secret"};

struct turns {
    std::int32_t number = 0;
    bool slow = false;
};
struct pulled {
    std::uint32_t times = 0;
};
struct ask {};
struct gust {
    double speed = 0;
};
inline constexpr ise::request_response<turns, pulled> pull{"pull"};
inline constexpr ise::request_response<ask, pulled> pulls{"pulls"};
inline constexpr ise::request_response<ask, gust> heard{"heard"};
inline constexpr ise::subscription<gust> weather{"weather"};

struct no_options {};

class counter final : public ise::component {
public:
    explicit counter(const no_options&) {}

private:
    ise::task<> run() override {
        auto each = publish(marks);
        auto latest = publish(newest);
        auto hidden = publish(secret);
        provide(count_up, [this, each, latest, hidden](amount rq) {
            for (std::uint32_t i = 0; i < rq.packets; ++i) {
                tally made;
                made.n = ++last_;
                made.text = "packet";
                each(made);
                latest(made);
                if (i + 1 == rq.packets) hidden(made);
            }
            counted answer{last_};
            return answer;
        });
        co_return;
    }
    std::uint32_t last_ = 0;
};

class winch final : public ise::component {
public:
    explicit winch(const no_options&) {}

private:
    ise::task<> run() override {
        require(weather);
        provide(pull, [this](turns rq) { return turn(rq); });
        provide(pulls, [this](ask) {
            pulled answer{times_};
            return answer;
        });
        provide(heard, [this](ask) {
            gust answer{speed_};
            return answer;
        });
        auto bridge = at("ise/mqtt");
        for (;;) {
            ise::subscriber<std::remove_const_t<decltype(weather)>> gusts;
            bool there = false;
            try {
                gusts = co_await bridge.subscribe(weather);
                there = true;
            } catch (const ise::error&) {}
            while (there) {
                auto one = co_await gusts.next();
                if (!one) break;
                speed_ = one->speed;
            }
            co_await sleep(100ms);
        }
    }
    ise::task<pulled> turn(turns rq) {
        if (rq.number < 0) throw ise::error(ise::errc::refused, "the winch turns forward only");
        ++times_;
        if (rq.slow) co_await sleep(5s);
        pulled answer{times_};
        co_return answer;
    }
    std::uint32_t times_ = 0;
    double speed_ = 0;
};

} // namespace

int main(int count, char** arguments) {
    auto options = std::make_shared<no_options>();
    std::vector<ise::component_type> types;
    types.emplace_back("counter", "counts up", "crew/counter").makes<counter>(options);
    types.emplace_back("winch", "turns", "crew/winch").makes<winch>(options);
    return ise::main(count, arguments, std::move(types), "1.0");
}
