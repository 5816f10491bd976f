// The boat's memory over a loss of power.
#include <components/boat_simulator/boat_simulator.hpp>

#include <utility>
#include <vector>

namespace atirma {
namespace {
constexpr ise::duration remember_period = std::chrono::seconds(10);
}

/// A memory that cannot be opened is an error: without it the boat would start its mission from the beginning. From a
/// damaged one the boat uses the readable part.
void boat_simulator::open_memory(simulator::boat_options& made) {
    memory_.reset();
    ise::when_damaged how(log(), [this] { return std::chrono::floor<std::chrono::system_clock::duration>(wall()); });
    how.begun = [this](ise::database&, const std::string&) { memory_is_new_ = true; };
    memory_.emplace(boat_memory::open(options_.memory_file, std::move(how)).value());
    made.resumed = memory_->last().value();
    made.executed = memory_->executed().value();
    not_acknowledged_ = memory_->take_unacknowledged().value();
    not_receipted_ = memory_->not_receipted().value();
    commands_kept_ = 0;
    forgotten_ = 0;
    remember_at_ = {};
    memory_trouble_.clear();
    if (made.resumed)
        log().info("the boat goes on where it was", {{"boot", std::to_string(made.resumed->boot + 1)},
                                                     {"not acknowledged", std::to_string(not_acknowledged_.size())}});
}

/// Called before the boat's answers go: what the shore knows as done is done aboard after a loss of power, too.
void boat_simulator::remember() {
    if (std::exchange(memory_is_new_, false)) { // store the complete state
        commands_kept_.reset();
        remember_at_ = {};
    }
    if (uplink_ && uplink_->link().acknowledged() != forgotten_) {
        forgotten_ = uplink_->link().acknowledged();
        kept(memory_->forget(forgotten_));
    }
    auto executed = boat_->executed_count();
    if (executed == executed_told_ && now() < remember_at_) return;
    remember_at_ = ise::saturating_add(now(), remember_period);
    const auto& all = boat_->executed();
    auto count = commands_kept_ ? std::min<std::uint64_t>(executed - *commands_kept_, all.size()) : all.size();
    std::vector<acknowledgement> fresh(all.end() - static_cast<std::ptrdiff_t>(count), all.end());
    auto outcome = memory_->keep(boat_->remember(), fresh);
    kept(outcome);
    if (outcome) commands_kept_ = executed; // else they are kept with the next state
}

/// The boat continues to sail if its memory fails.
void boat_simulator::kept(const ise::result<void>& outcome) {
    auto trouble = outcome ? std::string() : outcome.error().message();
    if (trouble != memory_trouble_ && !trouble.empty())
        log().error("the boat's memory cannot be written", {{"cause", trouble}});
    memory_trouble_ = trouble;
}

} // namespace atirma
