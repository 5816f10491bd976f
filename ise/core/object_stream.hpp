#pragma once
#include <ise/core/buffer.hpp>
#include <ise/core/passed_object.hpp>
#include <ise/core/ring.hpp>
#include <ise/core/stream.hpp>

namespace ise {

/// A stream within one process: beside its bytes it can carry objects as they are, and hand both over without a
/// coroutine that reads.
class object_stream : public stream {
public:
    class user {
    public:
        /// What the other side wrote, each `pass` whole and with its objects, in order; the buffer may be taken over
        /// for an empty one. Called inside a turn of the loop; what is left is dropped.
        virtual void on_passed(buffer& content, ring<passed_object>& attachments) = 0;

    protected:
        ~user() = default;
    };

    /// From now on everything that comes goes to `receiver`, who lives as long as the stream and does not destroy it
    /// from within `on_passed`; `read_some` only completes with the end.
    virtual void use(user& receiver) = 0;
    /// Takes all of it, and then both are empty (`content` with room of one that was taken before); or nothing,
    /// `would_block`, where too much waits already. What waits may exceed the capacity by one such write.
    virtual transfer pass(buffer& content, ring<passed_object>& attachments) = 0;
    /// Both sides are on one loop.
    virtual bool on_one_loop() const noexcept = 0;
};

} // namespace ise
