// expect: ise: the last argument of this call could be a field of the request as well as the deadline
#include <ise/service/remote.hpp>

struct set_period {
    ise::duration period{};
};
struct period_set {};
inline constexpr ise::request_response<set_period, period_set> pace{"pace"};

ise::task<> use(ise::remote boat) {
#ifdef WITHOUT_MISTAKE
    set_period fast{std::chrono::seconds(1)};
    co_await boat.call(pace, fast, std::chrono::seconds(2));
#else
    co_await boat.call(pace, std::chrono::seconds(1));
#endif
}
