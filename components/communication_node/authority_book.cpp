#include <components/communication_node/authority_book.hpp>

#include <fmt/chrono.h>
#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

ise::failure refused(std::string why) { return ise::failure(ise::errc::refused, std::move(why)); }

} // namespace

std::string authority_book::held() const {
    return fmt::format("{} holds the authority over the boat since {:%Y-%m-%d %H:%M:%S} UTC", state_.holder,
                       std::chrono::floor<std::chrono::seconds>(state_.since));
}

std::uint32_t authority_book::next_epoch() const noexcept {
    auto next = std::max(state_.epoch, boat_) + 1;
    return next % 2 == (odd_ ? 1u : 0u) ? next : next + 1;
}

ise::result<authority_state> authority_book::decide(const authority_request& request, const std::string& who,
                                                    utc_time wall) const {
    auto made = state_;
    auto change_hands = [&](const std::string& to, std::string how) {
        made.holder = to;
        made.epoch = next_epoch();
        made.since = wall;
        made.how = std::move(how);
        made.asked_by.clear();
    };
    if (who.empty() || who.size() > longest_name)
        return refused("an operator is known by a path of 1 to 200 characters");
    // A higher epoch than ours at the boat was given elsewhere: what is held here is worth nothing until it is taken
    // anew.
    bool outdated = boat_ > state_.epoch;
    switch (request.action) {
        case authority_action::look: return made;
        case authority_action::take:
            if (state_.holder == who && !outdated) return made;
            if (!state_.holder.empty() && state_.holder != who && !request.confirmed)
                return refused(
                    held() +
                    ": ask for it (action ask) and wait for hand_over, or take it against the holder's will "
                    "(action take, confirmed true)");
            change_hands(who, state_.holder.empty() || state_.holder == who
                                  ? fmt::format("taken by {}", who)
                                  : fmt::format("taken by {} from {}", who, state_.holder));
            return made;
        case authority_action::ask:
            if (state_.holder.empty())
                return refused("nobody holds the authority over the boat: take it (action take)");
            if (state_.holder == who || std::ranges::count(made.asked_by, who) != 0) return made;
            if (made.asked_by.size() >= max_asking)
                return refused(fmt::format("{} operators ask for the authority already", max_asking));
            made.asked_by.push_back(who);
            return made;
        case authority_action::hand_over:
            if (state_.holder != who)
                return refused(state_.holder.empty()
                                   ? "nobody holds the authority over the boat: there is nothing to hand over"
                                   : held() + ": only the holder hands it over");
            if (request.to.empty() || request.to.size() > longest_name || request.to == who)
                return refused(
                    "hand_over names in `to` the path of the operator who gets the authority, another one than "
                    "the holder");
            change_hands(request.to, fmt::format("handed over to {} by {}", request.to, who));
            return made;
        case authority_action::release:
            if (state_.holder != who)
                return refused(state_.holder.empty()
                                   ? "nobody holds the authority over the boat: there is nothing to release"
                                   : held() + ": only the holder releases it");
            change_hands({}, fmt::format("released by {}", who));
            return made;
    }
    return refused(fmt::format("no action has number {}", static_cast<int>(request.action)));
}

void authority_book::apply(authority_state state, std::uint64_t change) {
    state_ = std::move(state);
    change_ = change;
}

bool authority_book::is_newer(const authority_state& theirs, std::uint64_t change) const noexcept {
    return theirs.epoch > state_.epoch || (theirs.epoch == state_.epoch && change > change_);
}

void authority_book::boat_obeys(std::uint32_t epoch) noexcept { boat_ = std::max(boat_, epoch); }

std::optional<std::string> authority_book::refusal(const std::string& who) const {
    if (state_.holder.empty())
        return "nobody holds the authority over the boat: take it first (service authority, action take)";
    if (state_.holder != who)
        return held() +
               fmt::format(
                   ", not {}: ask for it (service authority, action ask), or take it against the holder's will "
                   "(action take, confirmed true)",
                   who);
    if (boat_ > state_.epoch)
        return fmt::format(
            "the boat obeys epoch {} of the authority, which was given where this node could not see it; here "
            "{} holds epoch {}: take it anew "
            "(service authority, action take) if the boat shall obey you",
            boat_, who, state_.epoch);
    return std::nullopt;
}

} // namespace atirma
