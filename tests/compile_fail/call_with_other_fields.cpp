// expect: ise: behind the service, a call takes its request packet or the fields of it in their order, and last the
// deadline
#include <ise/service/remote.hpp>

#include <string>

struct set_mode {
    std::string mode;
};
struct mode_set {
    bool accepted = false;
};
inline constexpr ise::request_response<set_mode, mode_set> helm{"helm"};

ise::task<> use(ise::remote boat) {
#ifdef WITHOUT_MISTAKE
    co_await boat.call(helm, "hold", std::chrono::seconds(2));
#else
    co_await boat.call(helm, 5, std::chrono::seconds(2));
#endif
}
