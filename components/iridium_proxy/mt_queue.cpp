#include <components/iridium_proxy/mt_queue.hpp>

#include <components/boat/command_book.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace atirma {
namespace {

command_priority priority_of(const mt_entry& entry) { return traits_of(entry.command.kind()).priority; }

bool goes_before(const mt_entry& a, const mt_entry& b) {
    return std::tuple(priority_of(a), a.order) < std::tuple(priority_of(b), b.order);
}

utc_time midnight_after(utc_time now) { return std::chrono::floor<std::chrono::days>(now) + std::chrono::days(1); }

} // namespace

telecommand_status status_of(const mt_entry& entry) {
    telecommand_status told;
    told.id = entry.id;
    told.link = link_id::iridium;
    told.kind = entry.command.kind();
    switch (entry.stage) {
        case iridium_stage::waiting:
        case iridium_stage::sending:
            told.state = entry.may_have_left ? telecommand_stage::sent : telecommand_stage::queued;
            break;
        case iridium_stage::at_gateway:
        case iridium_stage::delivered: told.state = telecommand_stage::sent; break;
        case iridium_stage::acknowledged: told.state = telecommand_stage::acknowledged; break;
        case iridium_stage::failed: told.state = telecommand_stage::failed; break;
        case iridium_stage::expired: told.state = telecommand_stage::expired; break;
    }
    told.result = entry.result;
    told.value = entry.value;
    told.boat_obeys = entry.boat_obeys;
    told.text = entry.text;
    told.at = entry.changed_at;
    told.asked_at = entry.asked_at;
    told.attempts = entry.attempts;
    return told;
}

std::uint64_t credits_of(std::size_t bytes, std::uint32_t bytes_per_credit) noexcept {
    auto each = std::max<std::uint64_t>(1, bytes_per_credit);
    return std::max<std::uint64_t>(1, (bytes + each - 1) / each);
}

void mt_queue::restore(utc_time now, std::vector<mt_entry> kept) {
    std::sort(kept.begin(), kept.end(),
              [](const mt_entry& a, const mt_entry& b) { return a.changed_at < b.changed_at; });
    for (auto& entry : kept) {
        auto id = entry.id;
        next_order_ = std::max(next_order_, entry.order + 1);
        bool open = !is_final(entry.stage);
        auto& mine = entries_.insert_or_assign(id, std::move(entry)).first->second;
        if (!open) {
            decided_.push_back(id);
            continue;
        }
        ++open_;
        if (mine.stage != iridium_stage::sending) continue;
        mine.may_have_left = true;
        mine.next_try = now;
        change(mine, now, iridium_stage::waiting, "was being given to the gateway when the proxy ended; is sent again");
    }
    on_time(now);
}

ise::result<std::uint32_t> mt_queue::submit(utc_time now, const telecommand_request& request, std::uint32_t chosen) {
    auto id = request.id != 0 ? request.id : chosen;
    if (auto known = entries_.find(id); known != entries_.end()) {
        auto& e = known->second;
        if (e.command == request.command) {
            bool here = e.stage == iridium_stage::waiting &&
                        !e.may_have_left; // else its answer names the epoch that it left with
            if (here) e.authority = std::max(e.authority, request.authority); // taken anew meanwhile
            return id;
        }
        return ise::failure(ise::errc::invalid_argument, fmt::format("telecommand {} is {} already; choose another id",
                                                                     id, name_of(known->second.command.kind())));
    }
    command_book rules; // what makes sense is the same on every link
    auto good = rules.submit({}, now, request, id);
    if (!good) return good.error();
    if (open_ >= options_.max_open)
        return ise::failure(ise::errc::overloaded, fmt::format("{} telecommands wait for the boat already", open_));
    mt_entry made;
    made.id = id;
    made.command = request.command;
    made.authority = request.authority;
    made.order = next_order_++;
    made.asked_at = now;
    made.next_try = now;
    made.expires_at =
        now + std::chrono::round<std::chrono::milliseconds>(std::chrono::duration<double>(request.valid_s));
    auto& kept = entries_.emplace(id, std::move(made)).first->second;
    ++open_;
    change(kept, now, iridium_stage::waiting, "waits for its turn at the gateway");
    return id;
}

void mt_queue::forget(std::uint32_t id) {
    auto found = entries_.find(id);
    if (found == entries_.end()) return;
    if (!is_final(found->second.stage)) --open_;
    std::erase(changed_, id);
    entries_.erase(found);
}

const mt_entry* mt_queue::first_waiting(utc_time now) const {
    const mt_entry* first = nullptr;
    for (const auto& [id, e] : entries_) {
        if (e.stage == iridium_stage::sending) return nullptr; // one at a time
        if (e.stage != iridium_stage::waiting || e.next_try > now) continue;
        if (!first || goes_before(e, *first)) first = &e;
    }
    return first;
}

std::optional<mt_queue::due> mt_queue::next_due(utc_time now, std::optional<std::uint64_t> budget_left) {
    on_time(now);
    const auto* first = first_waiting(now);
    if (!first) return std::nullopt;
    auto& e = entries_.at(first->id);
    due made;
    made.id = e.id;
    made.raw = encode_telecommand({e.id, now, e.command, e.authority});
    made.credits = credits_of(made.raw.size(), options_.bytes_per_credit);
    if (budget_left && made.credits > *budget_left) {
        budget_until_ = midnight_after(now);
        std::string why = "today's budget is spent: it goes on at 00:00 UTC";
        if (e.text != why) change(e, now, iridium_stage::waiting, std::move(why));
        return std::nullopt;
    }
    budget_until_ = {};
    ++e.attempts;
    change(e, now, iridium_stage::sending, "is being given to the gateway");
    return made;
}

std::chrono::seconds mt_queue::pause_of(const mt_entry& e) const {
    auto pause = options_.min_pause;
    for (std::uint32_t i = 1; i < e.attempts && pause < options_.max_pause; ++i) pause *= 2;
    return std::min(pause, options_.max_pause);
}

void mt_queue::on_outcome(utc_time now, std::uint32_t id, const mt_outcome& outcome) {
    auto found = entries_.find(id);
    if (found == entries_.end() || found->second.stage != iridium_stage::sending) return;
    auto& e = found->second;
    switch (outcome.what) {
        case mt_outcome::kind::accepted:
            e.reference = outcome.reference;
            change(e, now, iridium_stage::at_gateway, outcome.text);
            break;
        case mt_outcome::kind::refused: change(e, now, iridium_stage::failed, outcome.text); break;
        case mt_outcome::kind::unknown: e.may_have_left = true; [[fallthrough]];
        case mt_outcome::kind::later:
            e.next_try = now + pause_of(e);
            change(e, now, iridium_stage::waiting, outcome.text + "; is tried again");
    }
}

void mt_queue::on_delivered(utc_time now) {
    mt_entry* oldest = nullptr;
    for (auto& [id, e] : entries_)
        if (e.stage == iridium_stage::at_gateway && (!oldest || e.changed_at < oldest->changed_at)) oldest = &e;
    if (oldest) change(*oldest, now, iridium_stage::delivered, "delivered to the boat's modem");
}

void mt_queue::on_gateway_word(utc_time now, std::uint32_t id, bool kept, const std::string& text) {
    auto found = entries_.find(id);
    if (found == entries_.end() || is_final(found->second.stage)) return;
    auto& e = found->second;
    if (kept) return change(e, now, std::max(e.stage, iridium_stage::at_gateway), text);
    change(e, now, iridium_stage::failed, text);
}

bool mt_queue::recall(utc_time now, std::uint32_t id, const std::string& why) {
    auto found = entries_.find(id);
    if (found == entries_.end() || found->second.stage != iridium_stage::waiting) return false;
    auto& e = found->second;
    change(e, now, e.may_have_left ? iridium_stage::expired : iridium_stage::failed,
           e.may_have_left ? fmt::format("called back ({}): it may have arrived here as well", why)
                           : fmt::format("called back before it was sent ({})", why));
    return true;
}

bool mt_queue::on_acknowledgement(utc_time now, const acknowledgement& ack) {
    auto found = entries_.find(ack.id);
    if (found == entries_.end() || found->second.stage == iridium_stage::acknowledged) return false;
    auto& e = found->second;
    if (!is_answer(ack, e.command.kind(), e.authority)) return false;
    e.result = ack.code;
    if (traits_of(ack.kind).returns_value) e.value = ack.value;
    e.boat_obeys = ack.authority;
    change(e, now, iridium_stage::acknowledged, ack.text);
    return true;
}

void mt_queue::on_time(utc_time now) {
    for (auto& [id, e] : entries_) {
        if (is_final(e.stage) || e.expires_at > now) continue;
        bool never_left = !e.may_have_left && e.stage == iridium_stage::waiting;
        auto why = never_left ? "its time was over before it could be sent"
                   : e.stage == iridium_stage::at_gateway
                       ? "its time was over while it waited at the gateway: the boat may still get it"
                       : "its time was over without the boat's answer: it may have been executed";
        change(e, now, iridium_stage::expired, why);
    }
    while (decided_.size() > options_.max_remembered) {
        entries_.erase(decided_.front());
        decided_.erase(decided_.begin());
    }
}

utc_time mt_queue::next_event() const {
    auto next = utc_time::max();
    bool sending = false;
    for (const auto& [id, e] : entries_) sending = sending || e.stage == iridium_stage::sending;
    for (const auto& [id, e] : entries_) {
        if (is_final(e.stage)) continue;
        next = std::min(next, e.expires_at);
        if (e.stage == iridium_stage::waiting && !sending) next = std::min(next, std::max(e.next_try, budget_until_));
    }
    return next;
}

const mt_entry* mt_queue::find(std::uint32_t id) const {
    auto found = entries_.find(id);
    return found == entries_.end() ? nullptr : &found->second;
}

std::vector<const mt_entry*> mt_queue::open() const {
    std::vector<const mt_entry*> all;
    for (const auto& [id, e] : entries_)
        if (!is_final(e.stage)) all.push_back(&e);
    std::sort(all.begin(), all.end(), [](const mt_entry* a, const mt_entry* b) { return goes_before(*a, *b); });
    return all;
}

std::vector<mt_entry> mt_queue::take_changes() {
    std::vector<mt_entry> all;
    for (auto id : std::exchange(changed_, {}))
        if (const auto* e = find(id)) all.push_back(*e);
    return all;
}

void mt_queue::change(mt_entry& e, utc_time now, iridium_stage stage, std::string text) {
    bool was_final = is_final(e.stage);
    e.stage = stage;
    e.text = std::move(text);
    e.changed_at = now;
    if (std::find(changed_.begin(), changed_.end(), e.id) == changed_.end()) changed_.push_back(e.id);
    if (was_final || !is_final(stage)) return; // an answer after expiry corrects what was said
    --open_;
    decided_.push_back(e.id);
}

} // namespace atirma
