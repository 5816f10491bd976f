#include <components/boat/command_book.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {

bool is_answer(const acknowledgement& ack, command_kind kind, std::uint32_t sent_under) noexcept {
    if (ack.kind != kind) return false; // of another shore's telecommand with that number
    if (sent_under == 0 || ack.code == ack_code::no_authority) return true;
    return ack.authority && (!traits_of(kind).needs_authority || *ack.authority == sent_under);
}

ise::result<std::uint32_t> command_book::submit(ise::time_point now, utc_time wall, const telecommand_request& request,
                                                std::uint32_t chosen) {
    auto id = request.id != 0 ? request.id : chosen;
    if (auto known = entries_.find(id); known != entries_.end()) {
        auto& e = known->second;
        if (e.command == request.command) {
            bool here = e.status.state == telecommand_stage::queued &&
                        !e.at_link; // else its answer names the epoch that it left with
            if (here) e.authority = std::max(e.authority, request.authority); // taken anew meanwhile
            return id;
        }
        return ise::failure(ise::errc::invalid_argument, fmt::format("telecommand {} is {} already; choose another id",
                                                                     id, name_of(known->second.command.kind())));
    }
    if (auto good = check_request(request); !good) return good.error();
    if (open_ >= options_.max_open)
        return ise::failure(ise::errc::overloaded, fmt::format("{} telecommands wait for the boat already", open_));
    entry made;
    made.status.id = id;
    made.status.link = options_.link;
    made.status.kind = request.command.kind();
    made.status.asked_at = wall;
    made.command = request.command;
    made.authority = request.authority;
    made.expires = ise::saturating_add(
        now, std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(request.valid_s)));
    made.next_try = now;
    made.pause = options_.min_pause;
    auto& kept = entries_.emplace(id, std::move(made)).first->second;
    order_.push_back(id);
    ++open_;
    change(kept, wall, telecommand_stage::queued, "waits for the link");
    return id;
}

std::optional<command_book::due> command_book::next_due(ise::time_point now, utc_time wall) {
    on_time(now, wall);
    for (auto id : order_) {
        auto& e = entries_.at(id);
        if (e.at_link || e.next_try > now) continue;
        e.at_link = true;
        ++e.status.attempts;
        due made;
        made.id = id;
        made.raw = encode_telecommand({id, wall, e.command, e.authority});
        made.remaining = e.expires - now;
        return made;
    }
    return std::nullopt;
}

void command_book::on_outcome(ise::time_point now, utc_time wall, std::uint32_t id, bool delivered, bool certain,
                              const std::string& reason) {
    auto found = entries_.find(id);
    if (found == entries_.end()) return;
    auto& e = found->second;
    e.at_link = false;
    if (is_final(e.status.state)) return;
    if (delivered) {
        e.pause = options_.min_pause;
        e.next_try = ise::saturating_add(now, options_.answer_time);
        change(e, wall, telecommand_stage::sent, reason.empty() ? "arrived at the boat's modem" : reason);
        return;
    }
    e.next_try = ise::saturating_add(now, e.pause);
    e.pause = std::min(e.pause * 2, options_.max_pause);
    // What may have arrived stays "sent": it never goes back to a state that promises more.
    bool left = !certain || e.status.state == telecommand_stage::sent;
    change(e, wall, left ? telecommand_stage::sent : telecommand_stage::queued, reason + "; is tried again");
}

bool command_book::on_acknowledgement(utc_time wall, const acknowledgement& ack) {
    auto found = entries_.find(ack.id);
    if (found == entries_.end() || found->second.status.state == telecommand_stage::acknowledged) return false;
    auto& e = found->second;
    if (!is_answer(ack, e.command.kind(), e.authority)) return false;
    e.status.result = ack.code;
    if (traits_of(ack.kind).returns_value) e.status.value = ack.value;
    e.status.boat_obeys = ack.authority;
    change(e, wall, telecommand_stage::acknowledged, ack.text);
    return true;
}

bool command_book::recall(utc_time wall, std::uint32_t id, const std::string& why) {
    auto found = entries_.find(id);
    if (found == entries_.end() || is_final(found->second.status.state)) return false;
    auto& e = found->second;
    bool left = e.at_link || e.status.state == telecommand_stage::sent;
    change(e, wall, left ? telecommand_stage::expired : telecommand_stage::failed,
           left ? fmt::format("called back ({}): it may have arrived here as well", why)
                : fmt::format("called back before it was sent ({})", why));
    return true;
}

void command_book::on_link_up(ise::time_point now) {
    for (auto id : order_) {
        auto& e = entries_.at(id);
        e.pause = options_.min_pause;
        if (!e.at_link) e.next_try = now;
    }
}

void command_book::on_time(ise::time_point now, utc_time wall) {
    for (auto id : std::vector(order_.begin(), order_.end())) {
        auto& e = entries_.at(id);
        if (e.expires > now) continue;
        auto why = e.status.state == telecommand_stage::queued
                       ? "its time was over before it could be sent"
                       : "its time was over without the boat's answer: it may have been executed";
        change(e, wall, telecommand_stage::expired, why);
    }
}

ise::time_point command_book::next_event() const {
    auto next = ise::time_point::max();
    for (auto id : order_) {
        const auto& e = entries_.at(id);
        next = std::min(next, e.expires);
        if (!e.at_link) next = std::min(next, e.next_try);
    }
    return next;
}

ise::time_point command_book::next_expiry() const {
    auto next = ise::time_point::max();
    for (auto id : order_) next = std::min(next, entries_.at(id).expires);
    return next;
}

const telecommand_status* command_book::find(std::uint32_t id) const {
    auto found = entries_.find(id);
    return found == entries_.end() ? nullptr : &found->second.status;
}

std::vector<telecommand_status> command_book::open() const {
    std::vector<telecommand_status> all;
    for (auto id : order_) all.push_back(entries_.at(id).status);
    return all;
}

std::vector<telecommand_status> command_book::take_changes() { return std::exchange(changes_, {}); }

void command_book::change(entry& e, utc_time wall, telecommand_stage stage, std::string text) {
    bool was_final = is_final(e.status.state);
    e.status.state = stage;
    e.status.text = std::move(text);
    e.status.at = wall;
    changes_.push_back(e.status);
    if (was_final || !is_final(stage)) return; // an answer after expiry corrects what was said
    --open_;
    std::erase(order_, e.status.id);
    decided_.push_back(e.status.id);
    if (decided_.size() <= options_.max_remembered) return;
    auto oldest = decided_.front();
    decided_.pop_front();
    if (oldest != e.status.id) entries_.erase(oldest);
}

} // namespace atirma
