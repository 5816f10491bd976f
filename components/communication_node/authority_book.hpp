#pragma once
#include <components/boat/communication.hpp>

#include <optional>
#include <string>
#include <string_view>

namespace atirma {

/// The operator behind a caller ("PATH (ADDRESS)", or "ADDRESS"): the path that it claims. Without one, or where what
/// it claims is no path: "anonymous@ADDRESS", which is no path either and belongs to that session only.
std::string operator_of(std::string_view caller);

/// Who holds the authority over the boat: what may be done with it, without I/O. Two nodes that cannot see each other
/// never give the same epoch: one gives even ones, the other odd ones. Where they meet again the higher one wins.
/// Only a path holds the authority; what is none is nobody that would be known again.
class authority_book {
public:
    static constexpr std::size_t max_asking = 16;
    static constexpr std::size_t max_name = 200;
    /// The boat's word moves the epoch of the nodes by this much at most.
    static constexpr std::uint32_t max_step = 1024;

    explicit authority_book(bool odd) : odd_(odd) {}

    const authority_state& now() const noexcept { return state_; }
    std::uint64_t change() const noexcept { return change_; } ///< counts what happened within the epoch

    /// What would hold after that request of `who`; the same as `now()` where it changes nothing. To be put to disk and
    /// then applied. Errors: refused, with who holds it and what to do; also where the epochs are used up.
    ise::result<authority_state> decide(const authority_request& request, const std::string& who, utc_time wall) const;
    void apply(authority_state state, std::uint64_t change);
    /// What the other node says; true where it is newer than what is known here.
    bool is_newer(const authority_state& theirs, std::uint64_t change) const noexcept;
    /// The boat answered a telecommand that was sent under `sent_under`: it obeys `epoch`. That may have been given by
    /// a node that is not seen, or be forged: it is followed by the next change of the authority, and decides nothing
    /// between the nodes beyond `max_step`.
    void boat_obeys(std::uint32_t epoch, std::uint32_t sent_under) noexcept;

    /// Why `who` may not command the boat; nothing where he may.
    std::optional<std::string> refusal(const std::string& who) const;

private:
    ise::result<std::uint32_t> next_epoch() const;
    std::uint32_t next_boat_epoch() const noexcept;
    std::string held() const;

    authority_state state_;
    std::uint64_t change_ = 0;
    std::optional<std::uint32_t> boat_; // obeys this one and not ours
    bool odd_;
};

} // namespace atirma
