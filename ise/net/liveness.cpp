#include <ise/net/liveness.hpp>

#include <algorithm>

namespace ise::net {
namespace {

// A peer that is not heard for this many of its heartbeats is lost.
constexpr int missed_heartbeats = 3;
// A peer is sent a ping at least once in so many heartbeats, however much else it is sent: its clock is read by that.
constexpr int heartbeats_a_ping = 4;

} // namespace

liveness::verdict liveness::look(time_point now, duration theirs) noexcept {
    verdict found;
    auto lost_at = heard_ + ours_ * missed_heartbeats;
    // Where it is this side that did not come round for a while, what the peer sent meanwhile is still unread.
    const bool slept = due_ != time_point{} && now - due_ > ours_ / 2;
    if (now >= lost_at && slept) {
        heard_ = now - ours_ * (missed_heartbeats - 1);
        lost_at = now + ours_;
    } else if (now >= lost_at) {
        found.lost = true;
        return found;
    }
    found.ping = now - sent_ >= theirs || round_trip_ == duration{} || now - pinged_ >= theirs * heartbeats_a_ping;
    if (found.ping) sent_ = pinged_ = now;
    due_ = std::min(lost_at, sent_ + theirs);
    found.look_again = due_;
    return found;
}

} // namespace ise::net
