// expect: ise: this service is a subscription, which is not called
#include <ise/service/remote.hpp>

struct fix {
    double latitude_deg = 0;
};
inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::request_response<fix, fix> nearest{"nearest"};

ise::task<> use(ise::remote boat) {
#ifdef WITHOUT_MISTAKE
    co_await boat.call(nearest, 28.0);
#else
    co_await boat.call(position);
#endif
}
