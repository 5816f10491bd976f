#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/little_endian.hpp>
#include <ise/core/passed_object.hpp>
#include <ise/core/result.hpp>
#include <ise/packet/shared_bytes.hpp>

#include <cstddef>
#include <cstdint>
#include <optional>

namespace ise {

/// The reference to loaned content in a frame (FORMAT.md, section 19.1).
struct loan_reference {
    std::uint32_t slot = 0;   ///< of the block
    std::uint32_t offset = 0; ///< of the content in the block, in bytes
    std::uint32_t size = 0;   ///< of the content, in bytes

    static constexpr std::size_t bytes = 12;
    void put(buffer& out) const {
        out.append(slot);
        out.append(offset);
        out.append(size);
    }
    /// From `bytes` bytes.
    static loan_reference read(const std::byte* from) noexcept {
        return {detail::load_little<std::uint32_t>(from), detail::load_little<std::uint32_t>(from + 4),
                detail::load_little<std::uint32_t>(from + 8)};
    }
};

/// Beside `stream`: large content stays where it was made, and the other end reads it there. It is on loan until that
/// end gives it back. Used on the loop of the stream, while the stream is open.
class loans {
public:
    /// The memory in which content can be loaned; lives as long as the loop. Null: nothing can be loaned.
    virtual large_memory_source* memory() noexcept = 0;
    /// Loans content and holds it until it is given back. Empty if it lies in other memory, the peer does not know the
    /// memory yet, or has it on loan already: then it must be sent as bytes.
    virtual std::optional<loan_reference> loan(const shared_bytes& content) = 0;
    /// The content to which a reference of the peer refers, as an object that `is_encoded()`. Its destruction gives the
    /// content back; it may outlive the stream. Errors: errc::protocol_error (no such content).
    virtual result<passed_object> borrow(const loan_reference& what) = 0;

protected:
    ~loans() = default;
};

} // namespace ise
