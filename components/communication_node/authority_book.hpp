#pragma once
#include <components/boat/communication.hpp>

namespace atirma {

/// Who holds the authority over the boat: what may be done with it, without I/O. Two nodes that cannot see each other
/// never give the same epoch: one gives even ones, the other odd ones. Where they meet again the higher one wins.
class authority_book {
public:
    static constexpr std::size_t max_asking = 16;
    static constexpr std::size_t longest_name = 200;

    explicit authority_book(bool odd) : odd_(odd) {}

    const authority_state& now() const noexcept { return state_; }
    std::uint64_t change() const noexcept { return change_; } ///< counts what happened within the epoch

    /// What would hold after that request of `who`; the same as `now()` where it changes nothing. To be put to disk and
    /// then applied. Errors: refused, with who holds it and what to do.
    ise::result<authority_state> decide(const authority_request& request, const std::string& who, utc_time wall) const;
    void apply(authority_state state, std::uint64_t change);
    /// What the other node says; true where it is newer than what is known here.
    bool is_newer(const authority_state& theirs, std::uint64_t change) const noexcept;
    /// The boat refused what came under a lower epoch than this one, which may have been given by a node that is not
    /// seen.
    void boat_obeys(std::uint32_t epoch) noexcept;
    std::uint32_t boat_epoch() const noexcept { return boat_; }

    /// Why `who` may not command the boat; nothing where he may.
    std::optional<std::string> refusal(const std::string& who) const;

private:
    std::uint32_t next_epoch() const noexcept;
    std::string held() const;

    authority_state state_;
    std::uint64_t change_ = 0;
    std::uint32_t boat_ = 0;
    bool odd_;
};

} // namespace atirma
