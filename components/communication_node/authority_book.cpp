#include <components/communication_node/authority_book.hpp>

#include <ise/core/transport.hpp>
#include <ise/naming/services.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>
#include <limits>

namespace atirma {
namespace {

ise::failure refused(std::string why) { return ise::failure(ise::errc::refused, std::move(why)); }

// The boat's epochs wrap around: half of all numbers lie ahead of each.
bool is_ahead(std::uint32_t epoch, std::uint32_t of) { return epoch != of && epoch - of < 0x8000'0000; }

bool may_hold(std::string_view who) { return who.size() <= authority_book::max_name && ise::naming::is_path(who); }

std::string has_no_path(const std::string& who) {
    return fmt::format("{} has no path, so its next call cannot be recognised: it cannot hold the authority; give it a "
                       "path of its own (ise --as PATH call …)",
                       who);
}

} // namespace

std::string operator_of(std::string_view caller, std::string_view who) {
    auto address = caller;
    if (auto at = caller.rfind(" ("); at != caller.npos && caller.ends_with(')')) {
        if (may_hold(caller.substr(0, at))) return std::string(caller.substr(0, at));
        address = caller.substr(at + 2, caller.size() - at - 3);
    }
    // The identity that a shared key verifies is everybody's.
    if (who.starts_with("ise://") && !who.ends_with("/key")) return std::string(who);
    const auto* over = ise::transport_of(address);
    if (over && over->address == ise::address_form::file_or_name) // it names the socket, not the caller
        return fmt::format("anonymous@{}", over->scheme);
    auto scheme = address.find("://");
    return fmt::format("anonymous@{}", scheme == address.npos ? address : address.substr(scheme + 3));
}

std::string authority_book::held() const {
    return fmt::format("{} holds the authority over the boat since {:%Y-%m-%d %H:%M:%S} UTC", state_.holder,
                       std::chrono::floor<std::chrono::seconds>(state_.since));
}

ise::result<std::uint32_t> authority_book::next_epoch() const {
    auto last = state_.epoch;
    // A change here must have a higher epoch than one of a node that is out of reach.
    if (boat_ && *boat_ > last && *boat_ - last <= max_step) last = *boat_;
    auto step = last % 2 == (odd_ ? 1u : 0u) ? 2u : 1u;
    if (last > std::numeric_limits<std::uint32_t>::max() - step)
        return refused(fmt::format("the authority cannot change: its epochs are used up ({} is the last but {}), which "
                                   "only a damaged store can cause; stop both nodes and start them with new "
                                   "files, then take the authority again",
                                   last, std::numeric_limits<std::uint32_t>::max() - last));
    return last + step;
}

std::uint32_t authority_book::next_boat_epoch() const noexcept {
    auto last = boat_.value_or(state_.boat_epoch);
    auto next = last + (last % 2 == (odd_ ? 1u : 0u) ? 2u : 1u);
    return next != 0 ? next : 2u; // 0 is none
}

ise::result<authority_state> authority_book::decide(const authority_request& request, const std::string& who,
                                                    utc_time wall) const {
    auto made = state_;
    auto change_hands = [&](const std::string& to, std::string how) -> ise::result<authority_state> {
        auto epoch = next_epoch();
        if (!epoch) return epoch.error();
        made.holder = to;
        made.epoch = *epoch;
        made.boat_epoch = next_boat_epoch();
        made.since = wall;
        made.how = std::move(how);
        made.asked_by.clear();
        return made;
    };
    if (!may_hold(who) && request.action != authority_action::look) return refused(has_no_path(who));
    // If the boat obeys another epoch, the holder here must take the authority again.
    bool outdated = boat_.has_value();
    switch (request.action) {
        case authority_action::look: return made;
        case authority_action::take:
            if (state_.holder == who && !outdated) return made;
            if (!state_.holder.empty() && state_.holder != who && !request.confirmed)
                return refused(held() +
                               ": request it (action ask) and wait for hand_over, or take it against the holder's will "
                               "(action take, confirmed true)");
            return change_hands(who, state_.holder.empty() || state_.holder == who
                                         ? fmt::format("taken by {}", who)
                                         : fmt::format("taken by {} from {}", who, state_.holder));
        case authority_action::ask:
            if (state_.holder.empty())
                return refused("nobody holds the authority over the boat: take it (action take)");
            if (state_.holder == who || std::ranges::count(made.asked_by, who) != 0) return made;
            if (made.asked_by.size() >= max_asking)
                return refused(fmt::format(
                    "{} operators have requested the authority already: wait until it changes hands", max_asking));
            made.asked_by.push_back(who);
            return made;
        case authority_action::hand_over:
            if (state_.holder != who)
                return refused(state_.holder.empty()
                                   ? "nobody holds the authority over the boat: there is nothing to hand over"
                                   : held() + ": only the holder can hand it over");
            if (!may_hold(request.to) || request.to == who)
                return refused(
                    "hand_over requires in `to` the path of the operator who gets the authority, other than "
                    "the holder: letters, digits, '_', '-', '.', and '/' between them, at most 200 characters");
            return change_hands(request.to, fmt::format("handed over to {} by {}", request.to, who));
        case authority_action::release:
            if (state_.holder != who)
                return refused(state_.holder.empty()
                                   ? "nobody holds the authority over the boat: there is nothing to release"
                                   : held() + ": only the holder can release it");
            return change_hands({}, fmt::format("released by {}", who));
    }
    return refused(fmt::format("there is no action with number {}", static_cast<int>(request.action)));
}

void authority_book::apply(authority_state state, std::uint64_t change) {
    state_ = std::move(state);
    if (state_.boat_epoch == 0) state_.boat_epoch = state_.epoch; // from a store with only one epoch
    change_ = change;
    if (boat_ && !is_ahead(*boat_, state_.boat_epoch)) boat_.reset();
}

bool authority_book::is_newer(const authority_state& theirs, std::uint64_t change) const noexcept {
    return theirs.epoch > state_.epoch || (theirs.epoch == state_.epoch && change > change_);
}

void authority_book::boat_obeys(std::uint32_t epoch, std::uint32_t sent_under) noexcept {
    if (epoch == state_.boat_epoch) boat_.reset();
    else if (sent_under == state_.boat_epoch || is_ahead(epoch, state_.boat_epoch)) boat_ = epoch;
    // Else the answer was in transit while the authority changed hands.
}

std::optional<std::string> authority_book::refusal(const std::string& who) const {
    if (state_.holder.empty())
        return "nobody holds the authority over the boat: take it first (service authority, action take)";
    if (state_.holder != who)
        return held() +
               fmt::format(", not {}: request it (service authority, action ask), or take it against the holder's will "
                           "(action take, confirmed true)",
                           who);
    if (!may_hold(who)) return has_no_path(who); // from a store of an older program
    if (boat_)
        return fmt::format(
            "the boat obeys epoch {} of the authority, which a node out of reach granted, or somebody forged; "
            "here {} holds epoch {}: take it again (service authority, action take) to command the boat",
            *boat_, who, state_.boat_epoch);
    return std::nullopt;
}

} // namespace atirma
