#pragma once
#include <components/boat/enums.hpp>
#include <components/seal/boat_seal.hpp>
#include <components/seal/shore_seal.hpp>
#include <components/storage/database.hpp>

#include <ise/component/component.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/time.hpp>

#include <array>
#include <memory>
#include <optional>
#include <string>

namespace atirma::seal {

/// The boat's ends of all its links. Their counters are in `KEYFILE.boat.db`, on disk before a packet is handed out.
/// Used on one loop; each packet that is accepted blocks for one write to the disk.
class boat_links {
public:
    /// Reads the key, which its owner alone may read. A file of counters that is missing or damaged is a lost memory:
    /// then each link begins a session of its own, and refuses what was sealed before. Errors: io_failed, refused,
    /// malformed.
    static ise::result<std::unique_ptr<boat_links>> open(ise::environment& env, const std::string& key_file,
                                                         when_damaged how = when_damaged());

    /// See boat_seal.
    ise::result<ise::bytes> open(link_id link, ise::bytes_view raw) { return of(link).open(raw); }
    ise::bytes seal(link_id link, ise::bytes_view plain) const {
        return seals_[static_cast<std::size_t>(link)]->seal(plain);
    }
    /// A notice to be sent over that link now, sealed: after the start where a memory was lost, and where a sealed
    /// packet was refused; once in `every` at most, for anybody can send such a packet. Else empty.
    ise::bytes take_notice(link_id link, ise::time_point now, ise::duration every);

    const radio_key& key() const { return seals_[0]->key(); }

private:
    explicit boat_links(database disk) : disk_(std::move(disk)) {}
    boat_seal& of(link_id link) { return *seals_[static_cast<std::size_t>(link)]; }

    database disk_;
    std::array<std::optional<boat_seal>, link_count> seals_;
    std::array<bool, link_count> due_{};
    std::array<std::optional<ise::time_point>, link_count> told_at_{};
};

/// The shore's end of one link. Its counters are in `KEYFILE.LINK.db`, that of the secondary lane in
/// `KEYFILE.LINK.secondary.db`, reserved on disk before they are used.
class shore_link {
public:
    /// Errors: io_failed, refused, malformed.
    static ise::result<std::unique_ptr<shore_link>> open(ise::environment& env, const std::string& key_file,
                                                         link_id link, bool secondary,
                                                         when_damaged how = when_damaged());
    /// For a proxy, whose log says whether its link is sealed. Without a key file null: everybody on the link is
    /// believed. Throws ise::error, as `open`. On the component's loop.
    static std::unique_ptr<shore_link> open_for(ise::component& proxy, const std::string& key_file, link_id link,
                                                bool secondary);

    /// See shore_seal.
    ise::result<ise::bytes> seal(ise::bytes_view plain) { return end_->seal(plain); }
    ise::result<shore_seal::opened> open(ise::bytes_view raw) { return end_->open(raw); }
    ise::result<ise::bytes> read(ise::bytes_view raw) const { return end_->read(raw); }
    const radio_key& key() const { return end_->key(); }

private:
    explicit shore_link(database disk) : disk_(std::move(disk)) {}

    database disk_;
    std::optional<shore_seal> end_;
};

} // namespace atirma::seal
