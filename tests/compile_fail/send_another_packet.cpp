// expect: ise: this publication publishes packets of another type
#include <ise/subscription/publication.hpp>

struct fix {
    double latitude_deg = 0;
};
struct wind {
    double speed_mps = 0;
};
inline constexpr ise::subscription<fix> position{"position"};

void use(const ise::publication<decltype(position)>& fixes) {
#ifdef WITHOUT_MISTAKE
    fix at{28.15};
    (void)fixes.send(at);
#else
    wind now{6};
    (void)fixes.send(now);
#endif
}
