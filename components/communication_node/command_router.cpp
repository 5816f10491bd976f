#include <components/communication_node/command_router.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <tuple>

namespace atirma {
namespace {

constexpr ise::duration look_again = std::chrono::seconds(1);   // while no link is reached
constexpr ise::duration offer_again = std::chrono::seconds(30); // to a link that refused

std::int64_t steady_ms(ise::time_point at) {
    return std::chrono::duration_cast<std::chrono::milliseconds>(at.time_since_epoch()).count();
}

ise::duration until(utc_time later, utc_time earlier) {
    return std::chrono::duration_cast<ise::duration>(later - earlier);
}

} // namespace

bool knows_more(const command_record& a, const command_record& b) noexcept {
    auto key = [](const command_record& of) {
        return std::tuple(weight_of(of.status.state), of.status.state == telecommand_stage::sent, of.status.at,
                          std::string_view(of.node));
    };
    return key(a) > key(b);
}

ise::result<command_record> command_router::prepare(ise::time_point now, utc_time wall,
                                                    const telecommand_request& request, std::uint32_t chosen,
                                                    const std::string& asked_by, std::uint32_t authority,
                                                    const std::string& node, link_id over) const {
    if (auto good = check_request(request); !good) return good.error();
    const auto before = open();
    std::vector<command_kind> kinds;
    for (const auto& each : before) kinds.push_back(each.kind);
    auto traits = traits_of(request.command.kind());
    if (asked_by == node) traits.needs_authority = true; // its announcement of an epoch is no question of anybody
    if (auto place = check_place(traits, kinds, options_.max_open); !place) return place.error();
    auto valid = validity_of(request, wall, request.via.value_or(over));
    if (!valid)
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("its validity ended at {}, and it is {} here: is the clock there right?",
                                        utc_text(*request.valid_until), utc_text(wall)));
    command_record made;
    made.status.id = request.id != 0 ? request.id : chosen;
    made.status.kind = request.command.kind();
    made.status.command = request.command;
    made.status.asked_by = asked_by;
    made.status.asked_at = wall;
    made.status.at = wall;
    made.status.authority = authority;
    made.status.text = "waits for a link";
    if (request.via) made.status.link = *request.via;
    made.valid_until = wall + *valid;
    made.status.valid_until = made.valid_until;
    made.via = request.via;
    made.node = node;
    made.asked_steady_ms = steady_ms(now);
    for (const auto& older : before)
        if (older.command && request.command.replaces(*older.command)) made.replaces.push_back(older.id);
    return made;
}

/// What is left of its validity. Civil time may have been set back meanwhile, and the steady clock counts anew when the
/// machine starts: the less of the two is right, and never more than the whole.
ise::duration command_router::left_of(ise::time_point now, utc_time wall, const command_record& record, bool mine) {
    auto whole = until(record.valid_until, record.status.asked_at);
    auto left = std::min(whole, until(record.valid_until, wall));
    if (!mine || record.asked_steady_ms == 0) return left;
    auto passed = std::chrono::milliseconds(steady_ms(now) - record.asked_steady_ms);
    if (passed >= ise::duration()) return std::min<ise::duration>(left, whole - passed);
    return wall < record.status.asked_at ? ise::duration() : left; // both went back: nobody knows for how long
}

bool command_router::know(ise::time_point now, utc_time wall, const command_record& record, const std::string& me) {
    auto id = record.status.id;
    auto* known = table_.find(id);
    if (!known) {
        entry made;
        made.record = record;
        made.mine = record.node == me;
        made.expires = ise::saturating_add(now, left_of(now, wall, record, made.mine));
        note_link(made);
        table_.add(id, std::move(made), is_final(record.status.state));
        for (auto older : record.replaces) replace(wall, older, id);
        return true;
    }
    if (!knows_more(record, known->record)) return false;
    bool was_open = !is_final(known->record.status.state);
    auto called_back = std::exchange(known->record, record).called_back;
    if (record.called_back.empty()) known->record.called_back = std::move(called_back); // not known there yet
    known->mine = record.node == me;
    note_link(*known);
    if (was_open && is_final(record.status.state)) table_.decide(id);
    return true;
}

/// The links to which another node gave it, or this one before it was started anew. Of an older program only the last
/// one is known.
void command_router::note_link(entry& e) {
    const auto& status = e.record.status;
    if (e.record.links.empty() && status.at != status.asked_at) e.links[status.link].may_be_there = true;
    for (auto link : e.record.links) {
        auto& there = e.links[link];
        if (there.refused) there = at_link(); // the other node gave it to that link afterwards
        there.may_be_there = true;
    }
}

void command_router::replace(utc_time wall, std::uint32_t id, std::uint32_t by) {
    auto* older = table_.find(id);
    if (!older || is_final(older->record.status.state) || !older->record.called_back.empty()) return;
    auto why = fmt::format("replaced by telecommand {}", by);
    if (!older->mine) {
        older->record.called_back = why; // the node that gives it to the links calls it back, once it knows the newer
        return;
    }
    for (auto link : call_back(wall, id, why)) recalls_.push_back({id, link, why});
}

void command_router::take_over(ise::time_point now, utc_time wall, const std::string& me, const std::string& from) {
    for (auto id : std::vector(table_.open())) {
        auto& e = table_.at(id);
        if (!from.empty() && e.record.node != from) continue;
        if (e.mine || e.expires <= now) continue;
        e.mine = true;
        e.record.node = me;
        e.record.asked_steady_ms = steady_ms(e.expires - until(e.record.valid_until, e.record.status.asked_at));
        change(e, wall, e.record.status.state, "is taken over, as the node that had it is silent");
        if (!e.record.called_back.empty()) end_called_back(e, wall);
    }
}

/// When another link may be tried; nothing where none may.
std::optional<ise::time_point> command_router::next_link_at(const entry& e, const link_table& links) const {
    auto at = ise::time_point::min();
    for (const auto& [link, given] : e.links) {
        if (!given.given) continue;
        if (e.record.via) return std::nullopt;
        if (!given.refused) at = std::max(at, ise::saturating_add(given.since, links.patience(link)));
    }
    return at;
}

std::optional<command_router::give> command_router::next_give(ise::time_point now, utc_time wall,
                                                              const link_table& links) {
    on_time(now, wall);
    for (auto id : table_.open()) {
        auto& e = table_.at(id);
        if (!e.mine || e.expires - now < std::chrono::seconds(1)) continue;
        if (!e.record.called_back.empty()) {
            auto there = std::ranges::find_if(e.links, [](const auto& one) { return one.second.to_be_asked(); });
            if (there == e.links.end()) continue;
            auto made = give_to(e, there->first, now);
            made.only_recall = true;
            return made;
        }
        auto at = next_link_at(e, links);
        if (!at || *at > now) continue;
        std::set<link_id> tried;
        bool waits = false; // a link that has it already, and did not refuse it
        for (const auto& [link, given] : e.links) {
            if (!given.given || given.retry_at <= now) continue;
            tried.insert(link);
            waits = waits || !given.refused;
        }
        auto link = e.record.via ? e.record.via : links.best(now, tried);
        // A second link only where the boat is heard: it is no use to wait for two that are dead.
        if (!link || (waits && !links.alive(*link, now))) continue;
        auto text = fmt::format("is given to {}", name_of(*link));
        if (e.links[*link].given) text += " again";
        else if (!tried.empty()) text += " too";
        auto made = give_to(e, *link, now);
        e.record.status.link = *link;
        change(e, wall, e.record.status.state, std::move(text));
        return made;
    }
    return std::nullopt;
}

command_router::give command_router::give_to(entry& e, link_id link, ise::time_point now) {
    auto& there = e.links[link];
    if (there.refused) there = at_link(); // its proxy does not have it: a new request
    there.given = true;
    there.since = now;
    give made;
    made.id = e.record.status.id;
    made.link = link;
    made.request.id = made.id;
    made.request.command = e.record.status.command.value_or(boat_command());
    made.request.valid_s = std::clamp(std::chrono::duration<float>(e.expires - now).count(), 1.0f, 86400.0f);
    made.request.authority = e.record.status.authority;
    return made;
}

void command_router::on_status(utc_time wall, link_id link, const telecommand_status& status) {
    auto* known = table_.find(status.id);
    if (!known || known->record.status.kind != status.kind) return;
    auto& e = *known;
    auto& mine = e.record.status;
    if (mine.state == telecommand_stage::acknowledged) return;
    auto& there = e.links[link];
    there.may_be_there = true;
    there.attempts = std::max(there.attempts, status.attempts);
    mine.attempts = 0;
    for (const auto& [name, given] : e.links) mine.attempts += given.attempts;
    if (status.state == telecommand_stage::acknowledged) {
        mine.link = link;
        mine.result = status.result;
        mine.value = status.value;
        mine.boat_obeys = status.boat_obeys;
        mine.executed_at = status.executed_at;
        if (status.boat_obeys) boat_epochs_.push_back({mine.authority, *status.boat_obeys});
        for (const auto& [other, given] : e.links)
            if (other != link && (given.given || e.mine) && !given.refused)
                recalls_.push_back({status.id, other, fmt::format("acknowledged over {}", name_of(link))});
        change(e, wall, telecommand_stage::acknowledged, status.text);
        return;
    }
    if (is_final(mine.state)) return;
    if (status.state == telecommand_stage::failed) {
        there.retry_at = ise::time_point::max();
        refused(e, wall, link, fmt::format("{}: {}", name_of(link), status.text));
    } else if (status.state == telecommand_stage::expired && !e.record.called_back.empty()) {
        there.refused = true;
        mine.state = telecommand_stage::sent;
        end_called_back(e, wall);
    } else if (status.state == telecommand_stage::expired) {
        there.stage = telecommand_stage::expired;
    } else if (status.state == telecommand_stage::sent &&
               (there.stage != telecommand_stage::sent || mine.state != telecommand_stage::sent)) {
        there.stage = telecommand_stage::sent;
        mine.link = link;
        change(e, wall, telecommand_stage::sent, status.text);
    } else if (status.state == telecommand_stage::queued && !status.text.empty() && status.text != mine.text &&
               mine.link == link) {
        change(e, wall, mine.state, status.text);
    }
}

void command_router::on_refused(ise::time_point now, utc_time wall, std::uint32_t id, link_id link,
                                const std::string& why) {
    auto* known = table_.find(id);
    if (!known || is_final(known->record.status.state)) return;
    known->links[link].retry_at = ise::saturating_add(now, offer_again);
    refused(*known, wall, link, fmt::format("{} refuses it: {}", name_of(link), why));
}

void command_router::on_given(std::uint32_t id, link_id link) {
    if (auto* known = table_.find(id)) known->links[link].may_be_there = true;
}

void command_router::refused(entry& e, utc_time wall, link_id link, std::string text) {
    e.links[link].refused = true;
    if (!e.record.called_back.empty()) return end_called_back(e, wall);
    if (!e.record.via) return change(e, wall, e.record.status.state, text);
    bool left = e.record.status.state == telecommand_stage::sent; // before the proxy forgot it, or under another node
    if (left) text += "; it was sent before: it may have been executed";
    change(e, wall, left ? telecommand_stage::expired : telecommand_stage::failed, text);
}

std::vector<link_id> command_router::call_back(utc_time wall, std::uint32_t id, const std::string& why) {
    std::vector<link_id> have;
    auto* known = table_.find(id);
    if (!known || is_final(known->record.status.state)) return have;
    known->record.called_back = why;
    for (const auto& [link, given] : known->links)
        if (!given.refused) have.push_back(link);
    if (have.empty()) end_called_back(*known, wall);
    else change(*known, wall, known->record.status.state, fmt::format("is called back ({})", why));
    return have;
}

void command_router::end_called_back(entry& e, utc_time wall) {
    if (std::ranges::any_of(e.links, [](const auto& one) { return !one.second.refused; })) return;
    bool left = e.record.status.state == telecommand_stage::sent;
    change(e, wall, left ? telecommand_stage::expired : telecommand_stage::failed,
           left ? fmt::format("called back ({}), but it had left: it may have been executed", e.record.called_back)
                : fmt::format("called back before it was sent ({})", e.record.called_back));
}

void command_router::on_time(ise::time_point now, utc_time wall) {
    for (auto id : std::vector(table_.open())) {
        auto& e = table_.at(id);
        // Another node's is left to it for a while longer: it may have heard the boat.
        if (ise::saturating_add(e.expires, e.mine ? ise::duration() : ise::duration(std::chrono::seconds(30))) > now)
            continue;
        bool left = e.record.status.state == telecommand_stage::sent;
        auto lost = std::ranges::find_if(e.links, [](const auto& one) { return one.second.is_in_the_dark(); });
        auto why = left ? "its time was over without the boat's answer: it may have been executed"
                   : lost != e.links.end()
                       ? fmt::format("its time was over, and {} did not tell whether it was sent: it "
                                     "may have been executed",
                                     name_of(lost->first))
                       : "its time was over before it could be sent: " + e.record.status.text;
        change(e, wall, telecommand_stage::expired, why);
    }
}

ise::time_point command_router::next_event(ise::time_point now, const link_table& links) const {
    auto next = ise::time_point::max();
    for (auto id : table_.open()) {
        const auto& e = table_.at(id);
        next = std::min(
            next, ise::saturating_add(e.expires, e.mine ? ise::duration() : ise::duration(std::chrono::seconds(30))));
        if (!e.mine) continue;
        if (auto at = next_link_at(e, links))
            next = std::min(next, std::max(*at, ise::saturating_add(now, look_again)));
    }
    return next;
}

const command_record* command_router::find(std::uint32_t id) const {
    const auto* known = table_.find(id);
    return known ? &known->record : nullptr;
}

bool command_router::is_called_back(std::uint32_t id) const {
    const auto* known = table_.find(id);
    return known && !known->record.called_back.empty();
}

std::vector<telecommand_status> command_router::open() const {
    std::vector<telecommand_status> all;
    for (auto id : table_.open()) all.push_back(table_.at(id).record.status);
    return all;
}

void command_router::change(entry& e, utc_time wall, telecommand_stage stage, std::string text) {
    bool was_final = is_final(e.record.status.state);
    e.record.status.state = stage;
    e.record.status.text = std::move(text);
    e.record.links.clear();
    for (const auto& [link, there] : e.links)
        if (!there.refused) e.record.links.push_back(link);
    // Each change is later than the last.
    e.record.status.at = std::max(wall, e.record.status.at + std::chrono::milliseconds(1));
    changes_.push_back(e.record);
    if (!was_final && is_final(stage)) table_.decide(e.record.status.id);
}

} // namespace atirma
