// expect: ise: publish_every takes a function without arguments that returns a packet of the service
#include <ise/component/component.hpp>

#include <chrono>

struct fix {
    double latitude_deg = 0;
};
struct wind {
    double speed_mps = 0;
};
inline constexpr ise::subscription<fix> position{"position"};

void use(ise::component& boat) {
#ifdef WITHOUT_MISTAKE
    boat.publish_every(position, std::chrono::seconds(1), [] { return fix{28.15}; });
#else
    boat.publish_every(position, std::chrono::seconds(1), [] { return wind{6}; });
#endif
}
