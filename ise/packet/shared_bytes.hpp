#pragma once
#include <ise/core/bytes.hpp>
#include <ise/packet/buffer.hpp>

#include <cstddef>
#include <memory>

namespace ise {

/// Bytes that are written once and then shared by all who send them. A value; a copy costs a count.
class shared_bytes {
public:
    shared_bytes() = default;
    shared_bytes(std::shared_ptr<const bytes> owned) : size_(owned->size()) {
        auto* data = owned->data();
        owner_ = std::shared_ptr<const std::byte>(std::move(owned), data);
    }
    /// `size` bytes at `owner`, which keeps them alive.
    shared_bytes(std::shared_ptr<const std::byte> owner, std::size_t size) noexcept : owner_(std::move(owner)), size_(size) {}

    std::size_t size() const noexcept { return size_; }
    bytes_view view() const noexcept { return {owner_.get(), size_}; }
    const std::shared_ptr<const std::byte>& owner() const noexcept { return owner_; }

private:
    std::shared_ptr<const std::byte> owner_;
    std::size_t size_ = 0;
};

/// Makes shared bytes of what was encoded. Small contents lie side by side in common chunks, so that a burst of them
/// does not cost an allocation each; a chunk lives as long as anything in it is shared, and is small for that reason.
/// A big content keeps the buffer that it was encoded into.
class shared_bytes_maker {
public:
    /// An empty buffer to encode into; valid until `share()`.
    buffer& room();
    /// What is in the room, as shared bytes.
    shared_bytes share();

private:
    buffer room_;
    std::shared_ptr<std::byte[]> chunk_;
    std::size_t used_ = 0;
    std::size_t last_big_ = 0;
};

} // namespace ise
