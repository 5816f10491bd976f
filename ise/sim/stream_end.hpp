#pragma once
#include <ise/core/byte_queue.hpp>
#include <ise/core/stream.hpp>
#include <ise/core/waiter.hpp>
#include <ise/sim/resource.hpp>
#include <ise/sim/socket_owner.hpp>

#include <asio/buffer.hpp>

#include <memory>
#include <optional>
#include <string>

namespace ise::sim {

/// One end of a virtual byte stream: what its host keeps for it, and who waits there. A stream's coroutines
/// hold on to it, so that the stream may be destroyed under them.
class stream_end : public resource, public std::enable_shared_from_this<stream_end> {
public:
    stream_end(socket_owner& owner, loop& on, std::size_t receive_limit_bytes, std::string peer,
               std::optional<endpoint> local = std::nullopt);

    // For the stream, on its loop.
    transfer read(std::span<std::byte> into); ///< would_block: nothing yet
    transfer write(std::span<const asio::const_buffer> from);
    std::error_code writable() const;
    void shutdown();
    void close();
    virtual void limit_unsent([[maybe_unused]] std::size_t most) {}

    // For whatever brings bytes.
    std::size_t receive_room() const noexcept { return received_.room(); }
    std::size_t receive(bytes_view content);
    void receive_end();
    void fail(std::error_code why); ///< reads get what has arrived and then this; writes get it at once
    void wake_writer();

    bool gone() const noexcept { return closed_ || dead_; } ///< nobody will read from it any more
    bool unread() const noexcept { return !received_.empty(); }
    const std::string& peer() const noexcept { return peer_; }
    /// Of the side that was connected to: the endpoint that the other one asked for.
    const std::optional<endpoint>& local() const noexcept { return local_; }
    socket_owner& owner() noexcept { return owner_; }

    waiter<transfer> readable, writable_again;

    void end(ending how) final;

protected:
    virtual std::size_t send_room() const = 0;
    virtual void send(bytes_view content) = 0; ///< no more than there is room for
    virtual void finish() = 0;                 ///< nothing more will be sent
    virtual void let_go() = 0;                 ///< closed by its owner
    virtual void lost(ending how) = 0;         ///< its process ended
    virtual void drained() {}                  ///< there is room again

private:
    void wake(waiter<transfer>& who);

    socket_owner& owner_;
    std::shared_ptr<flow> where_;
    loop& loop_;
    byte_queue received_;
    std::string peer_;
    std::optional<endpoint> local_;
    std::error_code broken_;
    bool ended_ = false;
    bool shut_ = false;
    bool closed_ = false;
    bool dead_ = false;
};

/// The stream that a program holds.
std::unique_ptr<stream> make_stream(std::shared_ptr<stream_end> end);

} // namespace ise::sim
