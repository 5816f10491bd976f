#pragma once
#include <ise/core/bytes.hpp>
#include <ise/transport/loans.hpp>
#include <ise/transport/shm/blocks.hpp>
#include <ise/transport/shm/memory.hpp>

#include <atomic>
#include <cstdint>
#include <memory>
#include <optional>
#include <span>
#include <vector>

/// Both ends of the loans of one connection (FORMAT.md, section 19.1). The lender passes each block once, in a notice
/// over the local socket. The borrower maps it for reading. It returns the block then, and after each loan, by a bit in
/// the memory of the rings.
namespace ise::net::shm {

/// Slots of a connection for the blocks of one side.
inline constexpr std::size_t loan_slots = 32 * returned_words;

/// A message over the local socket: a block is in a slot from now on or, with size 0, the slot is empty.
struct block_notice {
    std::uint32_t slot = 0;
    std::uint32_t size = 0; ///< in bytes

    static constexpr std::size_t bytes = 8;
};

/// The side that loans.
class lender final : private block_user {
public:
    /// `ring`: the one that this side writes; `socket`: the local one.
    lender(std::shared_ptr<block_pool> pool, std::shared_ptr<const mapping> rings, int ring, int socket);
    ~lender();

    /// As `loans::loan`.
    std::optional<loan_reference> loan(const shared_bytes& content);

private:
    enum class state : std::uint8_t {
        empty,
        passed,    // the peer has not mapped the block yet, or cannot
        known,     // the peer has mapped it
        on_loan,   // the peer may read it
        forgotten, // the block has gone while it was `passed`
    };
    struct slot {
        state now = state::empty;
        block* of = nullptr;
        shared_bytes content; // on loan
    };

    void collect() noexcept override;
    void forget(const block& gone) noexcept override;
    slot* find(const block& of) noexcept;
    void pass(block& what);
    void empty(slot& which) noexcept;
    bool notify(const slot& which, std::size_t size, std::span<const int> memory) const noexcept;

    std::shared_ptr<block_pool> pool_;
    std::shared_ptr<const mapping> rings_;
    std::vector<slot> slots_; // as many as were needed
    int ring_;
    int socket_;
};

/// The side that reads.
class borrower {
public:
    /// `ring`: the one that this side reads.
    borrower(std::shared_ptr<const mapping> rings, int ring)
        : rings_(std::move(rings)), mapped_bytes_(std::make_shared<std::atomic<std::size_t>>(0)), ring_(ring) {}

    /// Takes a notice, with the descriptors that came with it. False: the peer breaks the rules.
    bool on_notice(bytes_view notice, std::span<owned_fd> passed);
    /// As `loans::borrow`.
    result<passed_object> borrow(const loan_reference& what) const;

    class peer_block;

private:
    struct unmapped {
        std::uint32_t slot;
        std::size_t size;
        owned_fd memory;
    };
    bool map_blocks();

    std::shared_ptr<const mapping> rings_;
    std::vector<std::shared_ptr<const peer_block>> slots_;   // as many as were used
    std::vector<unmapped> unmapped_;                         // blocks that could not be mapped yet
    std::shared_ptr<std::atomic<std::size_t>> mapped_bytes_; // with those that were replaced while they are on loan
    int ring_;
};

} // namespace ise::net::shm
