// Names that programs use themselves: what a component is made of does not stand in their way.
#include "sea.hpp"

namespace users_names_test {

using namespace sea;

namespace {

int add(int one, int other) { return one + other; }
int tick() { return 1; }
int each(std::string_view) { return 2; }
int fulfil() { return 3; }
int runtime() { return 4; }
int withdraw_service(int what) { return what; }
int check_period(int what) { return what; }
int post_spawn() { return 5; }

class gull final : public ise::component {
public:
    explicit gull(int& sum) : sum_(sum) {}

private:
    task<> run() override {
        sum_ = add(1, 2) + tick() + each("fish") + fulfil() + runtime() + withdraw_service(6) + check_period(7) +
               post_spawn();
        provide(echo, [](question asked) { return reply{asked.text}; });
        state = 8; // its own
        sum_ += state;
        co_return;
    }

    int& sum_;
    int state = 0;
};

} // namespace

TEST_CASE("a component's code calls functions of its program by names that components use inside") {
    fleet all;
    int sum = 0;
    all.node("shore").start<gull>("gull", all.listening("shore"), sum);
    REQUIRE(all.world.run_until([&] { return sum > 0; }, 1s));
    CHECK(sum == 3 + 1 + 2 + 3 + 4 + 6 + 7 + 5 + 8);
}

} // namespace users_names_test
