#pragma once
#include <ise/call/incoming_call.hpp>
#include <ise/core/bytes.hpp>
#include <ise/core/function_ref.hpp>
#include <ise/session/carried_packet.hpp>

#include <deque>
#include <map>
#include <optional>
#include <vector>

namespace ise {

/// A request that no handler is free for.
struct waiting_call {
    held<call_origin> from;
    incoming_call call;
    payload request;
    time_point since; ///< it waits
};

/// The requests of one service that wait for a handler. The sessions take turns, so that one that asks much is served
/// no faster than one that asks little; where there are too many, who has most loses its newest.
class waiting_calls {
public:
    bool empty() const noexcept { return count_ == 0; }
    std::size_t size() const noexcept { return count_; }
    std::size_t bytes_held() const noexcept { return bytes_; }

    void push(waiting_call one);
    /// The next whose session `may` be served now.
    std::optional<waiting_call> pop(function_ref<bool(const call_origin&)> may);
    /// The newest request of the session that has most of them, or the most bytes, while there are more than allowed.
    std::optional<waiting_call> overflow(std::size_t most, std::size_t max_bytes);
    /// One that nobody waits for any more.
    void withdraw(const call_origin& from, std::uint64_t id);
    std::vector<waiting_call> take_all();

private:
    struct line {
        std::deque<waiting_call> calls;
        std::size_t bytes = 0;
    };
    using lines = std::map<const call_origin*, line>;
    waiting_call take(lines::iterator from, std::size_t place);

    lines lines_;
    std::deque<const call_origin*> turns_; // each session of lines_ once
    std::size_t count_ = 0;
    std::size_t bytes_ = 0;
};

} // namespace ise
