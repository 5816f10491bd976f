#pragma once
#include <cstdint>

namespace atirma {

/// Where a telecommand is on its way over one link; `telecommand_state` tells the same in words that fit every link.
///
///     waiting → sending → at_gateway → delivered → acknowledged
///
/// The link decides what becomes of an attempt (`sending`): back to `waiting`, on to `at_gateway` or `delivered`, or
/// `failed`; `expired` instead, where an attempt before may have arrived. The clock decides `expired`, the boat
/// `acknowledged`, which also follows `failed` and `expired`. A link whose attempts may be repeated sends what was
/// delivered again, until the boat answers.
enum class link_stage : std::uint8_t {
    waiting = 0,      ///< on the shore: for its turn, the link, or tomorrow's budget
    sending = 1,      ///< it is being given to the link
    at_gateway = 2,   ///< queued there until the boat opens a session
    delivered = 3,    ///< a session took it along to the boat's modem
    acknowledged = 4, ///< the boat's word
    failed = 5,       ///< the link will not take it
    expired = 6,      ///< it is not sent any more, and may have been executed
};
constexpr bool is_final(link_stage stage) noexcept { return stage >= link_stage::acknowledged; }

} // namespace atirma
