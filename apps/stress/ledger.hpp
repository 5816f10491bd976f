#pragma once
#include "memory_apart.hpp"
#include "packet_key.hpp"

#include <components/boat/enums.hpp>

#include <ise/core/time.hpp>

#include <array>
#include <map>
#include <set>
#include <span>
#include <string>
#include <vector>

namespace atirma::stress {

/// What was seen on the boat's own wires, and what subscribers were shown. Kept apart from the components that it
/// judges: it knows only bytes that crossed a line, rows of the nodes' disks, and packets that reached somebody.
/// Without I/O.
class ledger {
public:
    struct entry {
        link_id link = link_id::xbee;
        ise::duration sent{-1};         ///< first given to the link
        ise::duration acknowledged{-1}; ///< the link's word at the boat: MAC, receipt, or the gateway's
        ise::duration arrived{-1};      ///< XBee only: read by the proxy
        ise::duration receipted{-1};    ///< XBee only: the shore's receipt came to the boat's modem
        /// Whether the shore has taken it over: from then on it may not be lost.
        bool owed() const noexcept { return owed_since().count() >= 0; }
        ise::duration owed_since() const noexcept { return link == link_id::xbee ? receipted : acknowledged; }
        /// Whether it came ashore, whatever became of it there.
        bool heard() const noexcept { return (link == link_id::xbee ? arrived : acknowledged).count() >= 0; }
    };

    void sent(link_id over, packet_key which, ise::duration at);
    void acknowledged(link_id over, packet_key which, ise::duration at);
    void arrived(packet_key which, ise::duration at);   ///< over XBee
    void receipted(packet_key which, ise::duration at); ///< over XBee

    /// One session with Iridium's gateway, as the boat's modem reported it.
    struct iridium_session {
        ise::duration from{}, until{};
        bool arrived = false; ///< else it broke off, or no satellite was found
    };
    void session(iridium_session of) { sessions_.push_back(of); }
    const std::vector<iridium_session>& sessions() const noexcept { return sessions_; }

    /// One subscriber of the role, who is judged also if nothing was ever shown to him.
    void expect(const std::string& who) { subscribers_[who]; }
    /// Call it for every packet that a subscriber is shown.
    void shown(const std::string& who, packet_key which);

    struct missing_packet {
        packet_key which = 0;
        entry what;
    };
    struct audience {
        std::uint64_t shown = 0, twice = 0, missed = 0, unknown = 0; ///< missed, unknown: against the disk
    };
    struct per_link {
        std::uint64_t sent = 0, acknowledged = 0, heard = 0, owed = 0, kept = 0;
        std::uint64_t waiting = 0; ///< not kept, and still at the boat, which will send it again
    };
    struct verdict {
        std::array<per_link, link_count> links;
        std::vector<missing_packet> missing; ///< although the shore had taken it over
        std::vector<entry> lost;             ///< sent, on no disk, and no longer at the boat; `missing` included
        std::uint64_t only_on_one = 0;       ///< on one disk and not on the other
        std::uint64_t unheard = 0;           ///< on a disk, and never seen on a wire: who read along missed it
        std::map<std::string, audience> subscribers;
        bool holds = false;
    };
    /// `disks`: what each communication node's store holds; `at_boat`: what the boat keeps and will send again. Packets
    /// that were owed after `until` are not judged.
    verdict judge(std::span<const std::set<packet_key>> disks, ise::duration until,
                  const std::set<packet_key>& at_boat = {}) const;

    const std::pmr::map<packet_key, entry>& entries() const noexcept { return entries_; }

private:
    entry& at(link_id over, packet_key which);

    std::pmr::map<packet_key, entry> entries_{memory_apart()};
    struct subscriber {
        std::pmr::set<packet_key> known{memory_apart()};
        std::uint64_t twice = 0;
    };
    std::map<std::string, subscriber> subscribers_;
    std::vector<iridium_session> sessions_;
};

} // namespace atirma::stress
