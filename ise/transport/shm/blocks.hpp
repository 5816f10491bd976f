#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/real/descriptor.hpp>

#include <cstddef>
#include <memory>
#include <span>
#include <vector>

/// Blocks of shared memory, in which a process encodes the large packets that its peers read in place.
namespace ise::net::shm {

using real::owned_fd;

/// Memory that this process writes and its peers only read. It cannot shrink, and no other process can write to it.
struct block {
    block() = default;
    block(const block&) = delete;
    block& operator=(const block&) = delete;
    ~block();

    std::byte* begin = nullptr;
    std::size_t size = 0;
    owned_fd memory;
    bool taken = false;   ///< by a buffer
    bool retired = false; ///< a peer may read it at any time from now on: it is not used again
    bool used = false;    ///< since `look` ran last
};

/// A connection over which blocks are loaned.
class block_user {
public:
    /// Takes back the blocks that the peer has returned.
    virtual void collect() noexcept = 0;
    /// The block is freed after this call; it is not on loan.
    virtual void forget(const block& gone) noexcept = 0;

protected:
    ~block_user() = default;
};

/// The blocks of one loop. They are made when they are needed, up to `max_blocks` and a share of the machine's memory,
/// and freed after some seconds without use. The pool outlives the loop as long as there is a buffer with it.
class block_pool final : public large_memory_source, public std::enable_shared_from_this<block_pool> {
public:
    static constexpr std::size_t max_blocks = 64;

    /// That of a loop.
    static const std::shared_ptr<block_pool>& of(loop& on);

    explicit block_pool(loop& on);
    ~block_pool();
    /// The loop ends.
    void leave_loop() noexcept { look_.reset(); }

    std::span<std::byte> take(std::size_t least) override;
    bool give_back(const std::byte* at) noexcept override;
    void add_buffer() noexcept override;
    void remove_buffer() noexcept override;

    /// The block that contains this address; null: none does.
    block* find(const std::byte* at) const noexcept;
    void add(block_user& user) { users_.push_back(&user); }
    void remove(block_user& user) noexcept { std::erase(users_, &user); }

private:
    void look();
    void look_later();
    block* find_free(std::size_t least) noexcept;
    block* make(std::size_t least);
    void free_one(std::size_t place) noexcept;

    std::vector<std::unique_ptr<block>> blocks_; // the ones used last are at the end
    std::vector<block_user*> users_;
    loop& on_;
    std::unique_ptr<timer> look_; // as long as the loop lives
    std::size_t bytes_ = 0;
    std::size_t buffers_ = 0;
    std::shared_ptr<block_pool> self_; // while there are buffers
};

} // namespace ise::net::shm
