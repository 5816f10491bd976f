#include "sabotage.hpp"

namespace seeds {

const std::vector<named_bug>& all_bugs() {
    static const std::vector<named_bug> all{
        {"reply_lost", bug::reply_lost},
        {"reply_twice", bug::reply_twice},
        {"reply_mixed_up", bug::reply_mixed_up},
        {"late_outcome", bug::late_outcome},
        {"run_twice", bug::run_twice},
        {"denied_but_run", bug::denied_but_run},
        {"packet_lost", bug::packet_lost},
        {"packet_twice", bug::packet_twice},
        {"packets_swapped", bug::packets_swapped},
        {"gap_forgotten", bug::gap_forgotten},
        {"tail_lost", bug::tail_lost},
        {"epoch_twice", bug::epoch_twice},
        {"coroutine_left", bug::coroutine_left},
        {"memory_left", bug::memory_left},
    };
    return all;
}

} // namespace seeds
