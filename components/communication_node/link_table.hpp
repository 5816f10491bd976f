#pragma once
#include <components/boat/enums.hpp>

#include <ise/core/time.hpp>

#include <chrono>
#include <optional>
#include <set>
#include <vector>

namespace atirma {

struct link_terms {
    link_id link = link_id::xbee;
    ise::duration alive_for{}; ///< after the boat was heard over it
    ise::duration patience{};  ///< for its acknowledgement; then another link is tried too
};

/// XBee (30 s, 20 s), GPRS (60 s, 30 s), Iridium (an hour, ten minutes): in the order of preference, which is that of
/// cost.
std::vector<link_terms> usual_links();

/// Which links are alive, and which one a telecommand takes. Without I/O.
class link_table {
public:
    explicit link_table(std::vector<link_terms> in_order) : terms_(std::move(in_order)), state_(terms_.size()) {}

    void heard(link_id link, ise::time_point when); ///< an earlier time than the last one changes nothing
    void reached(link_id link, bool is);            ///< its proxy answers, or not
    bool is_reached(link_id link) const;
    bool alive(link_id link, ise::time_point now) const;
    ise::duration patience(link_id link) const;

    /// The first in the order that is alive and whose proxy answers; where none is, the first whose proxy answers;
    /// where none does, nothing.
    std::optional<link_id> best(ise::time_point now, const std::set<link_id>& except) const;

private:
    struct state {
        bool reached = false;
        std::optional<ise::time_point> heard;
    };
    std::size_t find(link_id link) const;

    std::vector<link_terms> terms_;
    std::vector<state> state_;
};

} // namespace atirma
