#include <components/boat/telemetry_keeper.hpp>

#include <ise/core/sleep.hpp>
#include <ise/core/task_scope.hpp>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration min_keep_pause = 250ms, max_keep_pause = 10s;
} // namespace

ise::task<> telemetry_keeper::keep(std::vector<telemetry_packet> packets) {
    for (auto pause = min_keep_pause;; pause = std::min(2 * pause, max_keep_pause)) {
        std::string trouble;
        try {
            auto keeping = store_->keep(packets);
            co_await std::move(keeping);
        } catch (...) {
            auto thrown = std::current_exception();
            if (ise::is_cancellation(thrown)) throw;
            trouble = "telemetry cannot be kept, " + meanwhile_ + ": " + ise::describe(thrown);
        }
        if (trouble != trouble_ && !trouble.empty()) of_.log().error(trouble); // once, not with every attempt
        trouble_ = trouble;
        if (trouble.empty()) co_return;
        co_await ise::sleep_for(of_.on(), pause);
    }
}

} // namespace atirma
