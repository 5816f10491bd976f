// expect: ise: this service is a subscription, which is published
#include <ise/component/component.hpp>

struct fix {
    double latitude_deg = 0;
};
inline constexpr ise::subscription<fix> position{"position"};
inline constexpr ise::request_response<fix, fix> nearest{"nearest"};

void use(ise::component& boat) {
#ifdef WITHOUT_MISTAKE
    boat.provide(nearest, [](fix at) { return at; });
#else
    boat.provide(position, [](fix at) { return at; });
#endif
}
