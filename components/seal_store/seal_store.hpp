#pragma once
#include <components/boat/enums.hpp>
#include <components/boat/link_seal.hpp>
#include <components/seal/boat_ring.hpp>
#include <components/seal/shore_ring.hpp>

#include <ise/component/component.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/time.hpp>
#include <ise/database/database.hpp>

#include <array>
#include <memory>
#include <optional>
#include <string>

namespace atirma::seal {

/// What to do where there is no key.
inline constexpr const char* make_a_key =
    "atirma keys new radio.key makes a key: copy it to the boat and to the shore, "
    "and give it to the boat and to its proxies with radio-key";

/// The boat's ends of all its links. Their counters are in `KEYFILE.boat.db`, on disk before a packet is handed out;
/// keys that it has changed to since in `KEYFILE.keys.db`. `KEYFILE.recovery` is the recovery key; without it there is
/// none.
/// Used on one loop; each packet that is accepted blocks for one write to the disk.
class boat_links {
public:
    /// Reads the key, which its owner alone may read. A file of counters that is missing or damaged is a lost memory:
    /// then each link begins a session of its own, and refuses what was sealed before. Errors: io_failed, refused,
    /// malformed.
    static ise::result<std::unique_ptr<boat_links>> open(ise::environment& env, const std::string& key_file,
                                                         ise::when_damaged how = ise::when_damaged());

    /// See boat_ring.
    ise::result<ise::bytes> open(link_id link, ise::bytes_view raw) {
        return ring_->open(static_cast<std::size_t>(link), raw);
    }
    ise::bytes seal(link_id link, ise::bytes_view plain) const {
        return ring_->seal(static_cast<std::size_t>(link), plain);
    }
    /// A notice to be sent over that link now, sealed: after the start where a memory was lost, and where a sealed
    /// packet was refused; once in `every` at most, for anybody can send such a packet. Else empty.
    ise::bytes take_notice(link_id link, ise::time_point now, ise::duration every);

    /// Of no link.
    const boat_keys& keys() const { return ring_->keys(); }

private:
    boat_links(ise::database disk, ise::database key_disk) : disk_(std::move(disk)), key_disk_(std::move(key_disk)) {}

    ise::database disk_, key_disk_;
    std::optional<boat_ring> ring_;
    std::array<std::optional<ise::time_point>, link_count> told_at_{};
};

/// The shore's end of one link. Its counters are in `KEYFILE.LINK.db`, that of the secondary lane in
/// `KEYFILE.LINK.secondary.db`, reserved on disk before they are used.
class shore_link {
public:
    /// Errors: io_failed, refused, malformed.
    static ise::result<std::unique_ptr<shore_link>> open(ise::environment& env, const std::string& key_file,
                                                         link_id link, bool secondary,
                                                         ise::when_damaged how = ise::when_damaged());
    /// For a proxy, whose log says whether its link is sealed. Without a key file null: everybody on the link is
    /// believed. Throws ise::error, as `open`. On the component's loop.
    static std::unique_ptr<shore_link> open_for(ise::component& proxy, const std::string& key_file, link_id link,
                                                bool secondary);

    /// See shore_ring.
    ise::result<ise::bytes> seal(ise::bytes_view plain) { return ring_->seal(plain); }
    ise::result<ise::bytes> open(ise::bytes_view raw);
    ise::result<ise::bytes> read(ise::bytes_view raw) const { return ring_->read(raw); }
    ise::bytes take_question() { return ring_->take_question(); }
    ise::bytes rekey() { return ring_->rekey(); }
    bool knows_session() const noexcept { return ring_->knows_session(); }
    const radio_key& key() const { return ring_->key(); }
    /// What a proxy tells of its link; `of` may be null: it is not sealed.
    static link_seal report(const std::unique_ptr<shore_link>& of);

private:
    shore_link(ise::environment& env, ise::database disk) : env_(env), disk_(std::move(disk)) {}

    ise::environment& env_;

    ise::database disk_;
    std::optional<shore_ring> ring_;
    std::optional<utc_time> verified_at_;
    std::uint64_t refused_ = 0;
};

} // namespace atirma::seal
