// expect: ise: this service is a request-response, which is not subscribed to
#include <ise/service/remote.hpp>

struct fix {
    double latitude_deg = 0;
};
inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::request_response<fix, fix> nearest{"nearest"};

ise::task<> use(ise::remote boat) {
#ifdef WITHOUT_MISTAKE
    co_await boat.subscribe(position);
#else
    co_await boat.subscribe(nearest);
#endif
}
