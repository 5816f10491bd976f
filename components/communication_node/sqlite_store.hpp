#pragma once
#include <components/communication_node/node_store.hpp>
#include <components/communication_node/packet_table.hpp>
#include <components/communication_node/record_table.hpp>
#include <components/communication_node/store_lives.hpp>
#include <components/communication_node/store_lock.hpp>

#include <chrono>
#include <memory>
#include <span>

namespace atirma {

/// The data that a communication node must not lose, in one SQLite file: packets, telecommands, the authority, and how
/// far the other node's store is known. A packet is its boot, sequence, time and content. Packets are numbered 1, 2, 3…
/// in the order in which they came to this disk, and know their number at the other node. What a call returned success
/// for is on the disk. Used by one component, on its loop. Errors of everything: io_failed with what the disk says;
/// malformed where the file is damaged (a row that differs from its checksum, or a file that SQLite cannot read).
/// Nothing of that call is kept then.
///
/// Each opening is a life of the store with a number of its own. The file knows how far each life came, and so a
/// position of a life that it does not know, or beyond that life's end, tells that the file went back in time.
class sqlite_store final : public node_store {
public:
    /// `fresh_number` becomes the number of this life, made odd (never 0), and of a file that is new its origin. One
    /// store at a time has the file open: io_failed for another one.
    static ise::result<sqlite_store> open(const std::string& file, std::uint64_t fresh_number);
    /// The same, with the lock that the caller has on the file.
    static ise::result<sqlite_store> open(const std::string& file, std::uint64_t fresh_number, store_lock lock);

    std::uint64_t number() const noexcept override { return own_.now.store; }
    std::uint64_t origin() const noexcept { return origin_; } ///< of the file, over all lives
    const std::string& file() const noexcept { return db_->file(); }
    std::string name() const override { return file(); }

    /// See store_lives.
    store_part shared(const store_part& known) const { return own_.shared(known); }
    store_part shared(std::span<const store_part> known) const { return own_.shared(known); }

    /// Closes the file and sets it aside (storage): its new name. Every call but `begin_anew` fails from then on.
    ise::result<std::string> set_aside(const ise::failure& cause, std::chrono::system_clock::time_point now,
                                       const ise::logger& log);
    /// A new file in its place, empty.
    ise::result<void> begin_anew(std::uint64_t fresh_number);
    bool is_open() const noexcept { return db_->is_open(); }

    ise::result<memory> remembered();

    // Packets
    ise::result<kept> add(std::span<const telemetry_packet> packets);
    std::uint64_t head() const noexcept override { return own_.now.packets; }
    ise::result<std::vector<telemetry_packet>> packets(std::uint64_t after, std::uint64_t up_to, std::size_t most);
    /// A page for somebody who knows what `request.seen` says; nothing beyond `up_to`.
    ise::result<track_page> track(const track_request& request, std::uint64_t up_to);
    // Telecommands
    ise::result<void> put(std::span<const command_record> records);
    std::uint64_t commands_head() const noexcept override { return own_.now.commands; }
    ise::result<std::optional<command_record>> command(std::uint32_t id);
    ise::result<record_page> list(const record_request& request);

    // Authority
    ise::result<void> put(const authority_state& state, std::uint64_t change);

    // The other node
    const store_part& peer() const noexcept { return peer_.now; } ///< known of it
    /// The same by the numbers of its last lives, the newest first: what to ask it with.
    std::vector<store_part> known_of_peer() const;
    /// The next page for the other node, whose store is `asker` and which has everything up to those positions.
    ise::result<replication_page> page_after(std::uint64_t asker, std::uint64_t packets, std::uint64_t commands,
                                             std::size_t most);
    /// Takes a page of the other node, and says which of its telecommands are news: all of it, or nothing. Knowledge of
    /// its store beyond `page.after` is forgotten. Gives how many packets were fresh. Errors: also protocol_error (the
    /// page does not follow what is known).
    ise::result<std::uint32_t> apply(const replication_page& page, std::span<const command_record> new_commands,
                                     bool authority_is_news);

    /// Removes all but the newest packets and decided telecommands, a few thousand at a time; how many it were.
    ise::result<std::int64_t> prune(std::uint64_t keep_packets, std::uint64_t keep_commands);
    /// Gives packets that an older program wrote their checksums, a few thousand at a time; how many it were.
    ise::result<std::int64_t> seal();

    // The same by the interface of all stores; each calls `done` before it returns.
    void add(std::vector<telemetry_packet> packets, then<kept> done) override { done(add(packets)); }
    void packets(std::uint64_t after, std::uint64_t up_to, std::size_t most,
                 then<std::vector<telemetry_packet>> done) override {
        done(packets(after, up_to, most));
    }
    void track(const track_request& request, std::uint64_t up_to, then<track_page> done) override {
        done(track(request, up_to));
    }
    void begin(const command_record& record, std::uint32_t epoch, then<begun> done) override;
    void put(std::vector<command_record> records, then<void> done) override { done(put(records)); }
    void command(std::uint32_t id, then<std::optional<command_record>> done) override { done(command(id)); }
    void list(const record_request& request, then<record_page> done) override { done(list(request)); }
    void put(const change_of_authority& state, const std::pair<std::uint32_t, std::uint64_t>& before,
             then<std::optional<change_of_authority>> done) override;
    void tend(std::uint64_t keep_packets, std::uint64_t keep_commands, then<std::int64_t> done) override;

private:
    sqlite_store(ise::database opened, store_lock lock);
    void load();
    ise::result<void> begin_life(std::uint64_t fresh_number);
    void forget_peer_after(std::uint64_t packets, std::uint64_t commands);
    std::uint64_t known_at_peer(const track_cursor& seen) const;
    std::vector<telemetry_packet> numbered(std::vector<telemetry_packet> packets) const;

    store_lock lock_;                   // also while the file is set aside
    std::unique_ptr<ise::database> db_; // its tables point to it
    packet_table packets_;
    record_table records_;
    std::uint64_t origin_ = 0;
    store_lives own_, peer_;
};

} // namespace atirma
