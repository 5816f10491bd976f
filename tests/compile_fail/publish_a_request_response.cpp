// expect: ise: this service is a request-response, which is provided
#include <ise/component/component.hpp>

struct fix {
    double latitude_deg = 0;
};
inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::request_response<fix, fix> nearest{"nearest"};

void use(ise::component& boat) {
#ifdef WITHOUT_MISTAKE
    boat.publish(position);
#else
    boat.publish(nearest);
#endif
}
