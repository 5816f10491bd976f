#pragma once
#include <components/boat/communication.hpp>

#include <optional>
#include <string>
#include <string_view>

namespace atirma {

/// The operator behind a caller ("PATH (ADDRESS)", or "ADDRESS"): the path that it claims. Without a valid path:
/// the identity that its certificate verifies (`who`: ise://atirma/operator/ana), else "anonymous@ADDRESS", which are
/// no paths; the latter identifies that session only. An access policy lets a path be claimed only by whose it is.
std::string operator_of(std::string_view caller, std::string_view who = {});

/// The authority over the boat: its holder, and which changes are permitted; without I/O. Two nodes that cannot reach
/// each other never grant the same epoch: one grants even ones, the other odd ones; when they meet again, the higher
/// one wins. Only a path can hold the authority, because other callers cannot be recognised.
class authority_book {
public:
    static constexpr std::size_t max_asking = 16;
    static constexpr std::size_t max_name = 200;
    /// A report of the boat moves the epoch of the nodes by at most this much.
    static constexpr std::uint32_t max_step = 1024;

    explicit authority_book(bool odd) : odd_(odd) {}

    const authority_state& now() const noexcept { return state_; }
    std::uint64_t change() const noexcept { return change_; } ///< counts the changes within the epoch

    /// Returns the state after that request of `who`; `now()` if it changes nothing. The caller stores it on disk, then
    /// applies it. Errors: refused (the message names the holder and what to do), also if the epochs are used up.
    ise::result<authority_state> decide(const authority_request& request, const std::string& who, utc_time wall) const;
    void apply(authority_state state, std::uint64_t change);
    /// Whether the state of the other node is newer than this one.
    bool is_newer(const authority_state& theirs, std::uint64_t change) const noexcept;
    /// The boat answered a telecommand that was sent under `sent_under`: it obeys `epoch`. A node out of reach may have
    /// granted that epoch, or it is forged: the next change of the authority goes beyond it, and it decides nothing
    /// between the nodes beyond `max_step`.
    void boat_obeys(std::uint32_t epoch, std::uint32_t sent_under) noexcept;

    /// Why `who` may not command the boat; empty if it may.
    std::optional<std::string> refusal(const std::string& who) const;

private:
    ise::result<std::uint32_t> next_epoch() const;
    std::uint32_t next_boat_epoch() const noexcept;
    std::string held() const;

    authority_state state_;
    std::uint64_t change_ = 0;
    std::optional<std::uint32_t> boat_; // the epoch that it obeys, if that is not ours
    bool odd_;
};

} // namespace atirma
