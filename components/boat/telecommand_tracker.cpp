#include <components/boat/telecommand_tracker.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace atirma {
namespace {

constexpr std::uint32_t max_called_late = 3;

ise::duration pause_after(std::uint32_t failures, const link_policy& policy) {
    auto pause = policy.min_pause;
    for (std::uint32_t i = 1; i < failures && pause < policy.max_pause; ++i) pause *= 2;
    return std::min(pause, policy.max_pause);
}

} // namespace

link_outcome make_outcome(link_outcome::kind what, std::string text, std::string reference) {
    link_outcome made;
    made.what = what;
    made.text = std::move(text);
    made.reference = std::move(reference);
    return made;
}

telecommand_status status_of(const tracked_telecommand& entry, link_id link) {
    telecommand_status outcome;
    outcome.id = entry.id;
    outcome.link = link;
    outcome.kind = entry.command.kind();
    switch (entry.stage) {
        case link_stage::waiting:
        case link_stage::sending:
            outcome.state = entry.may_have_left ? telecommand_stage::sent : telecommand_stage::queued;
            break;
        case link_stage::at_gateway:
        case link_stage::delivered: outcome.state = telecommand_stage::sent; break;
        case link_stage::acknowledged: outcome.state = telecommand_stage::acknowledged; break;
        case link_stage::failed: outcome.state = telecommand_stage::failed; break;
        case link_stage::expired: outcome.state = telecommand_stage::expired; break;
    }
    outcome.result = entry.result;
    outcome.value = entry.value;
    outcome.boat_obeys = entry.boat_obeys;
    outcome.text = entry.text;
    outcome.at = entry.changed_at;
    outcome.asked_at = entry.asked_at;
    outcome.attempts = entry.attempts;
    outcome.valid_until = entry.valid_until;
    outcome.executed_at = entry.executed_at;
    return outcome;
}

bool is_answer(const acknowledgement& ack, command_kind kind, std::uint32_t sent_under) noexcept {
    if (ack.kind != kind) return false; // of another shore's telecommand with that number
    if (sent_under == 0 || ack.code == ack_code::no_authority || ack.code == ack_code::expired) return true;
    return ack.authority && (!traits_of(kind).needs_authority || *ack.authority == sent_under);
}

void telecommand_tracker::restore(tracker_time at, std::vector<tracked_telecommand> kept) {
    std::ranges::sort(kept, {}, &tracked_telecommand::changed_at);
    for (auto& entry : kept) {
        next_order_ = std::max(next_order_, entry.order + 1);
        entry.failures = entry.attempts;
        bool was_sending = entry.stage == link_stage::sending, decided = is_final(entry.stage);
        auto id = entry.id;
        auto& mine = table_.add(id, std::move(entry), decided);
        if (!was_sending) continue;
        mine.may_have_left = true;
        mine.next_try = at.now;
        change(mine, at, link_stage::waiting, "was being given to the link when the proxy ended; is sent again");
    }
    on_time(at);
}

ise::result<std::uint32_t> telecommand_tracker::submit(tracker_time at, const telecommand_request& request,
                                                       std::uint32_t chosen) {
    auto id = request.id != 0 ? request.id : chosen;
    if (auto* known = table_.find(id)) {
        if (known->command != request.command)
            return ise::failure(
                ise::errc::invalid_argument,
                fmt::format("telecommand {} is {} already; choose another id", id, name_of(known->command.kind())));
        // Else its answer names the epoch that it left with.
        bool here = known->stage == link_stage::waiting && !known->may_have_left;
        if (here) known->authority = std::max(known->authority, request.authority); // taken anew meanwhile
        return id;
    }
    if (auto good = check_request(request); !good) return good.error();
    std::vector<command_kind> kinds;
    for (auto each : table_.open()) kinds.push_back(table_.at(each).command.kind());
    auto place = check_place(traits_of(request.command.kind()), kinds, policy_.max_open);
    if (!place) return place.error();
    auto valid = validity_of(request, at.wall, policy_.link);
    if (!valid)
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("its validity ended at {}, and it is {} here", utc_text(*request.valid_until),
                                        utc_text(at.wall)));
    tracked_telecommand made;
    made.id = id;
    made.command = request.command;
    made.authority = request.authority;
    made.order = next_order_++;
    made.asked_at = at.wall;
    made.next_try = at.now;
    made.expires_at = ise::saturating_add(at.now, *valid);
    made.valid_until = at.wall + *valid;
    change(table_.add(id, std::move(made)), at, link_stage::waiting, std::string(policy_.waits));
    return id;
}

void telecommand_tracker::replace_older(tracker_time at, std::uint32_t id) {
    const auto& newer = table_.at(id);
    for (auto other : std::vector(table_.open())) {
        const auto& older = table_.at(other);
        if (other != id && older.authority == newer.authority && newer.command.replaces(older.command))
            recall(at, other, fmt::format("replaced by telecommand {}", id));
    }
}

void telecommand_tracker::forget(std::uint32_t id) {
    std::erase_if(changes_, [id](const tracked_telecommand& e) { return e.id == id; });
    table_.forget(id);
}

bool telecommand_tracker::may_be_sent(const tracked_telecommand& e) const {
    if (e.stage == link_stage::waiting) return true;
    return policy_.answer_time && (e.stage == link_stage::at_gateway || e.stage == link_stage::delivered);
}

bool telecommand_tracker::link_is_taken() const {
    return policy_.one_at_a_time && std::ranges::any_of(table_.open(), [this](std::uint32_t id) {
               return table_.at(id).stage == link_stage::sending;
           });
}

const tracked_telecommand* telecommand_tracker::first_due(tracker_time at) {
    on_time(at);
    if (link_is_taken()) return nullptr;
    for (const auto* e : open())
        if (may_be_sent(*e) && e->next_try <= at.now) return e;
    return nullptr;
}

std::optional<telecommand_tracker::due> telecommand_tracker::next_due(tracker_time at) {
    const auto* first = first_due(at);
    if (!first) return std::nullopt;
    auto& e = table_.at(first->id);
    held_until_ = {};
    ++e.attempts;
    if (e.stage != link_stage::waiting) e.may_have_left = true;
    if (policy_.is_given.empty()) e.stage = link_stage::sending;
    else change(e, at, link_stage::sending, std::string(policy_.is_given));
    due made;
    made.id = e.id;
    made.raw = encoded(e, at);
    made.remaining = e.expires_at - at.now;
    return made;
}

ise::bytes telecommand_tracker::encoded(const tracked_telecommand& entry, tracker_time at) const {
    auto stamp = clock_.read(at.now, at.wall);
    telecommand made;
    made.id = entry.id;
    made.sent_at = stamp.at;
    made.clock_of = stamp.boot;
    made.command = entry.command;
    made.authority = entry.authority;
    made.valid_for = std::chrono::floor<std::chrono::milliseconds>(entry.expires_at - at.now);
    return encode_telecommand(made);
}

void telecommand_tracker::hold(tracker_time at, ise::time_point until, const std::string& why) {
    held_until_ = until;
    const auto* first = first_due(at);
    if (first && first->text != why) change(table_.at(first->id), at, first->stage, why);
}

void telecommand_tracker::mark_unreadable(std::uint32_t id, bool unreadable) {
    if (auto* e = table_.find(id)) e->unreadable = unreadable;
}

void telecommand_tracker::repeat_unreadable(tracker_time at) {
    for (auto id : table_.open()) {
        auto& e = table_.at(id);
        if (!e.unreadable || (e.stage != link_stage::at_gateway && e.stage != link_stage::delivered)) continue;
        e.may_have_left = true; // it was reported as sent, and never becomes queued again
        e.next_try = at.now;
        change(e, at, link_stage::waiting, "the boat could not open it, as its session was not known: is sent again");
    }
}

void telecommand_tracker::on_outcome(tracker_time at, std::uint32_t id, const link_outcome& outcome) {
    auto* e = table_.find(id);
    if (!e || e->stage != link_stage::sending) return;
    using kind = link_outcome::kind;
    switch (outcome.what) {
        case kind::delivered:
        case kind::accepted:
            e->failures = 0;
            e->reference = outcome.reference;
            e->next_try = ise::saturating_add(at.now, policy_.answer_time.value_or(ise::duration()));
            return change(*e, at, outcome.what == kind::delivered ? link_stage::delivered : link_stage::at_gateway,
                          outcome.text);
        case kind::refused: return give_up(*e, at, outcome.text);
        case kind::unknown: e->may_have_left = true; [[fallthrough]];
        case kind::later:
            e->next_try = ise::saturating_add(at.now, pause_after(++e->failures, policy_));
            change(*e, at, link_stage::waiting, outcome.text + "; is tried again");
    }
}

void telecommand_tracker::on_delivered(tracker_time at) {
    tracked_telecommand* oldest = nullptr;
    for (auto id : table_.open()) {
        auto& e = table_.at(id);
        if (e.stage == link_stage::at_gateway && (!oldest || e.next_try < oldest->next_try)) oldest = &e; // as given
    }
    if (oldest) change(*oldest, at, link_stage::delivered, "delivered to the boat's modem");
}

void telecommand_tracker::on_gateway_word(tracker_time at, std::uint32_t id, bool kept, const std::string& text) {
    auto* e = table_.find(id);
    if (!e || is_final(e->stage)) return;
    if (kept) change(*e, at, std::max(e->stage, link_stage::at_gateway), text);
    else give_up(*e, at, text);
}

bool telecommand_tracker::on_acknowledgement(tracker_time at, const acknowledgement& ack) {
    return answer(at, ack, true);
}

bool telecommand_tracker::on_result(tracker_time at, std::uint32_t id, ack_code code) {
    const auto* e = table_.find(id);
    if (!e) return false;
    acknowledgement ack;
    ack.id = id;
    ack.kind = e->command.kind();
    ack.code = code;
    return answer(at, ack, false);
}

bool telecommand_tracker::answer(tracker_time at, const acknowledgement& ack, bool is_packet) {
    auto* e = table_.find(ack.id);
    if (!e || e->stage == link_stage::acknowledged || !is_answer(ack, e->command.kind(), e->authority)) return false;
    if (is_packet) clock_.heard(at.now, ack.header, true);
    bool late = ack.code == ack_code::expired;
    if (late && !is_final(e->stage) && e->expires_at > at.now && e->called_late < max_called_late) {
        ++e->called_late;
        clock_.distrust(ack.header.boot);
        e->next_try = at.now;
        e->may_have_left = true;
        change(*e, at, link_stage::waiting,
               fmt::format("the boat finds it late by its own clock ({}): is sent again by that clock", ack.text));
        return true;
    }
    e->result = ack.code;
    bool executed = !late && ack.code != ack_code::no_authority;
    if (is_packet && executed) e->executed_at = clock_.shore_time(at.now, at.wall, ack.header);
    if (is_packet && traits_of(ack.kind).returns_value) e->value = ack.value;
    e->boat_obeys = ack.authority;
    change(*e, at, link_stage::acknowledged, ack.text);
    return true;
}

void telecommand_tracker::on_link_up(tracker_time at) {
    for (auto id : table_.open()) {
        auto& e = table_.at(id);
        e.failures = 0;
        e.next_try = at.now;
    }
}

bool telecommand_tracker::recall(tracker_time at, std::uint32_t id, const std::string& why) {
    auto* e = table_.find(id);
    if (!e || is_final(e->stage)) return false;
    bool left = e->stage != link_stage::waiting && !e->unreadable;
    if (left && !policy_.answer_time) return false; // it is the link's now
    if (!left && !e->may_have_left)
        change(*e, at, link_stage::failed, fmt::format("called back before it was sent ({})", why));
    else change(*e, at, link_stage::expired, fmt::format("called back ({}): it may have arrived here as well", why));
    return true;
}

void telecommand_tracker::on_time(tracker_time at) {
    for (auto id : std::vector(table_.open())) {
        auto& e = table_.at(id);
        if (e.expires_at > at.now) continue;
        bool never_left = e.stage == link_stage::waiting && !e.may_have_left;
        change(e, at, link_stage::expired,
               never_left ? "its time was over before it could be sent"
               : e.stage == link_stage::at_gateway
                   ? "its time was over while it waited at the gateway: the boat may still get it"
                   : "its time was over without the boat's answer: it may have been executed");
    }
}

ise::time_point telecommand_tracker::next_event() const {
    auto next = next_expiry();
    if (link_is_taken()) return next;
    for (auto id : table_.open()) {
        const auto& e = table_.at(id);
        if (may_be_sent(e)) next = std::min(next, std::max(e.next_try, held_until_));
    }
    return next;
}

ise::time_point telecommand_tracker::next_expiry() const {
    auto next = ise::time_point::max();
    for (auto id : table_.open()) next = std::min(next, table_.at(id).expires_at);
    return next;
}

std::vector<const tracked_telecommand*> telecommand_tracker::open() const {
    std::vector<const tracked_telecommand*> all;
    for (auto id : table_.open()) all.push_back(&table_.at(id));
    std::ranges::sort(all, {}, [this](const tracked_telecommand* e) {
        auto priority = policy_.one_at_a_time ? traits_of(e->command.kind()).priority : command_priority();
        return std::tuple(priority, e->order);
    });
    return all;
}

// `failed` promises that the boat has not executed it.
void telecommand_tracker::give_up(tracked_telecommand& e, tracker_time at, const std::string& why) {
    if (e.may_have_left)
        change(e, at, link_stage::expired, why + "; an attempt before may have arrived: it may have been executed");
    else change(e, at, link_stage::failed, why);
}

void telecommand_tracker::change(tracked_telecommand& e, tracker_time at, link_stage stage, std::string text) {
    bool was_final = is_final(e.stage);
    e.stage = stage;
    e.text = std::move(text);
    e.changed_at = at.wall;
    changes_.push_back(e);
    if (!was_final && is_final(stage)) table_.decide(e.id); // an answer after expiry corrects what was said
}

} // namespace atirma
