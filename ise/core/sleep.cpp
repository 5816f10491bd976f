#include <ise/core/sleep.hpp>

#include <ise/core/waiter.hpp>

namespace ise {

task<> sleep_until(loop& on, time_point at) {
    waiter<std::error_code> wake(on);
    timer alarm(on, [&wake] { wake.resume({}); });
    alarm.arm(at);
    co_await wake.wait(); // throws what it was resumed with
}

task<> sleep_for(loop& on, duration length) { return sleep_until(on, saturating_add(on.now(), length)); }

} // namespace ise
