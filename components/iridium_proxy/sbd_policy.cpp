#include <components/iridium_proxy/sbd_policy.hpp>

#include <algorithm>

namespace atirma {

link_policy sbd_policy() {
    link_policy made;
    made.link = link_id::iridium;
    made.answer_time.reset();
    made.min_pause = std::chrono::seconds(5);
    made.max_pause = std::chrono::minutes(15);
    made.one_at_a_time = true;
    made.waits = "waits for its turn at the gateway";
    made.is_given = "is being given to the gateway";
    return made;
}

std::uint64_t credits_of(std::size_t bytes, std::uint32_t bytes_per_credit) noexcept {
    auto each = std::max<std::uint64_t>(1, bytes_per_credit);
    return std::max<std::uint64_t>(1, (bytes + each - 1) / each);
}

std::optional<telecommand_tracker::due> next_within_budget(telecommand_tracker& of, tracker_time at,
                                                           const link_budget& budget, std::uint32_t bytes_per_credit) {
    const auto* first = of.first_due(at);
    if (!first) return std::nullopt;
    auto bytes = of.encoded(*first, at).size();
    auto end = end_of_budget(budget, credits_of(bytes, bytes_per_credit), at.wall);
    if (!end) return of.next_due(at);
    of.hold(at, ise::saturating_add(at.now, end->until - at.wall), end->text);
    return std::nullopt;
}

} // namespace atirma
