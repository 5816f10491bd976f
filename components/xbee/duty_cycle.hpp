#pragma once
#include <components/xbee/radio.hpp>

#include <deque>

namespace atirma::xbee {

/// 10 % of a rolling hour; when the module is hot, of a rolling second as well.
class duty_cycle {
public:
    static constexpr instant window = std::chrono::hours(1);
    static constexpr instant budget = std::chrono::seconds(360);
    static constexpr instant hot_window = std::chrono::seconds(1);
    static constexpr instant hot_budget = std::chrono::milliseconds(100);

    void add(instant now, instant airtime);
    /// The earliest time, not before `now`, at which so much may be sent. `never` if it is more than the budget.
    instant available_at(instant now, instant airtime, bool hot);
    instant used(instant now);

private:
    struct entry {
        instant start;
        instant airtime;
    };
    std::deque<entry> entries_;
    instant used_{0};
};

} // namespace atirma::xbee
