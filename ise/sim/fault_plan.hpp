#pragma once
#include <asio/error.hpp>

#include <cstdint>
#include <optional>
#include <system_error>

namespace ise::sim {

/// Counts the I/O operations of a world (connect, listen, accept, read, write, wait for writability, open,
/// send, receive, read a file) and makes one of them fail: for a sweep over all of them.
class fault_plan {
public:
    /// The operation number `n` from now on (0: the next one) fails with `with`.
    void fail_at(std::uint64_t n, std::error_code with = asio::error::connection_reset) {
        at_ = operations_ + n;
        with_ = with;
    }
    /// Withdraws it.
    void fail_never() noexcept { at_.reset(); }

    /// So far.
    std::uint64_t operations() const noexcept { return operations_; }
    /// Whether the operation that was to fail was reached: a sweep is over when it was not.
    bool failed() const noexcept { return at_ && operations_ > *at_; }

    /// For the world's parts: one operation begins. Its failure, if it is the one.
    std::error_code begin() noexcept {
        const bool now = at_ == operations_;
        ++operations_;
        return now ? with_ : std::error_code{};
    }

private:
    std::uint64_t operations_ = 0;
    std::optional<std::uint64_t> at_;
    std::error_code with_;
};

} // namespace ise::sim
