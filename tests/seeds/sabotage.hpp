#pragma once
#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

namespace seeds {

/// A fault that is planted between the library and the model, to see that the model finds it: the library's behaviour
/// as it would look if it had that bug.
enum class bug : std::uint8_t {
    none,
    reply_lost,      ///< an answer never comes
    reply_twice,     ///< it comes twice
    reply_mixed_up,  ///< it is another call's
    late_outcome,    ///< it comes after the deadline
    run_twice,       ///< a request is executed twice
    denied_but_run,  ///< the caller is told `not_executed` of a request that ran
    packet_lost,     ///< a packet is missing and no gap tells of it
    packet_twice,    ///< a packet comes twice
    packets_swapped, ///< two packets come in the wrong order
    gap_forgotten,   ///< packets were lost, and the gap says 0
    tail_lost,       ///< the last packet never comes
    epoch_twice,     ///< two holders of a name are granted the same epoch
    coroutine_left,  ///< a coroutine lives on after its component has stopped
    memory_left,     ///< memory is not given back
};

struct named_bug {
    std::string_view name;
    bug what;
};
const std::vector<named_bug>& all_bugs();

/// Strikes once in a run, at the `nth` occasion.
class sabotage {
public:
    explicit sabotage(bug planted = bug::none, int nth = 20) : planted_(planted), left_(nth) {}
    bool strikes(bug what) noexcept { return planted_ == what && left_-- == 0; }
    bool is(bug what) const noexcept { return planted_ == what; }
    /// Strikes at the first occasion, once.
    bool strikes_once(bug what) noexcept {
        if (planted_ != what) return false;
        planted_ = bug::none;
        return true;
    }

private:
    bug planted_;
    int left_;
};

} // namespace seeds
