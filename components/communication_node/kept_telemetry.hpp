#pragma once
#include <components/boat/newest_by_kind.hpp>
#include <components/communication_node/boat_links.hpp>
#include <components/communication_node/other_node.hpp>
#include <components/communication_node/store_keeper.hpp>

#include <deque>
#include <functional>
#include <optional>
#include <vector>

namespace atirma {

/// The telemetry of the boat: puts each packet to disk once, and publishes it when it counts as kept. While the disk
/// fails, packets of subscriptions wait in memory.
class kept_telemetry {
public:
    /// `kept` is called when packets of a link were put to disk.
    kept_telemetry(node_context& here, store_keeper& store, other_node& peer, boat_links& links,
                   const opened_store& opened, std::function<void()> kept);

    /// From a proxy's subscription.
    void receive(std::vector<telemetry_packet> packets);
    /// Tries the disk again if it failed: also if nothing is held, so that its recovery is noticed.
    void take_held();
    /// Publishes what counts as kept by now, in the order of the store.
    void show();
    /// Of the packets that the other node sends: those that are older than the newest known ones become history.
    void mark_history(telemetry_packet& packet) { packet.history = newest_.is_history(packet); }
    /// To disk, all of them or none, without counting them as heard: false while the disk fails.
    bool restore(const std::vector<telemetry_packet>& packets);
    /// The store has another life, in which packets that were published may be missing.
    void went_back();
    void begin_anew() noexcept { shown_ = 0; } ///< the store is a new one

    std::size_t held() const noexcept { return held_.size() + under_way_.size(); }
    void report(communication_state& into) const;

    // Services.
    ise::task<keep_reply> keep(keep_request request);
    ise::task<track_page> track(track_request request);

private:
    void take(std::vector<telemetry_packet> packets, node_store::then<node_store::kept> done);
    void take_next();
    void show_page(const std::vector<telemetry_packet>& packets, std::uint64_t limit);
    void note_fix(const telemetry_packet& packet);

    node_context& here_;
    store_keeper& store_;
    other_node& peer_;
    boat_links& links_;
    std::function<void()> kept_;
    ise::publication<ise::subscription<telemetry_packet>> telemetry_;
    newest_by_kind newest_;
    std::deque<telemetry_packet> held_;
    std::vector<telemetry_packet> under_way_; // to the store
    bool taking_ = false, showing_ = false;   // the store was asked, and has not called back
    bool take_loop_ = false, show_loop_ = false;
    std::uint64_t shown_;
    std::uint64_t duplicates_ = 0, refused_ = 0, dropped_ = 0;
    std::optional<current_fix> fix_;
};

} // namespace atirma
