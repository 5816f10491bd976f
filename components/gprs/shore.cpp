#include <components/gprs/shore.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma::gprs {

void shore::connected(ise::time_point now, way by) {
    ++counters_.connections;
    auto place = places_.take(by.peer.text()); // all wait: one makes way
    auto& made = strangers_.emplace_back();
    place->on_displaced([this, channel = by.channel] {
        auto who = std::find_if(strangers_.begin(), strangers_.end(),
                                [&](const stranger& s) { return s.by.channel == channel; });
        cut_stranger(
            who,
            fmt::format(
                "{} connections wait to log in (max_strangers): the oldest one of the host with the most makes way",
                strangers_.size()));
    });
    made.place = std::move(place);
    made.by = std::move(by);
    made.until = ise::saturating_add(now, options_.login_time);
}

void shore::disconnected(ise::time_point, std::uint64_t channel, const std::string& reason) {
    if (boat_ && !boat_->datagrams && boat_->channel == channel) return lose_boat(reason);
    std::erase_if(strangers_, [&](const stranger& s) { return s.by.channel == channel; });
}

void shore::on_bytes(ise::time_point now, std::uint64_t channel, ise::bytes_view bytes) {
    auto who =
        std::find_if(strangers_.begin(), strangers_.end(), [&](const stranger& s) { return s.by.channel == channel; });
    if (who != strangers_.end()) {
        who->bytes += bytes.size();
        who->reader.push(bytes);
        auto got = who->reader.next();
        if (!got) {
            if (who->bytes > options_.max_login_bytes) cut_stranger(who, "it talks and does not log in");
            return;
        }
        if (!*got) return cut_stranger(who, got->error().message());
        const auto* result = std::get_if<login>(&**got);
        if (!result) return cut_stranger(who, "its first line is not a login");
        if (result->id != options_.boat_id)
            return cut_stranger(who, fmt::format("it calls itself '{}', which is not the boat", result->id));
        auto by = who->by;
        auto reader = std::move(who->reader);
        strangers_.erase(who);
        admit(now, by, *result, std::move(reader));
    } else if (boat_ && !boat_->datagrams && boat_->channel == channel) {
        reader_.push(bytes);
    } else {
        return; // it was cut off; this was under way
    }
    while (boat_ && !boat_->datagrams && boat_->channel == channel) {
        auto got = reader_.next();
        if (!got) break;
        take(now, *got);
    }
    acknowledge();
}

void shore::on_datagram(ise::time_point now, const way& by, ise::bytes_view content) {
    line_reader reader;
    reader.push(content);
    reader.push(ise::as_bytes("\n")); // the datagram's end is one, too
    auto refuse = [&](std::string reason) {
        ++counters_.stranger_datagrams;
        tell(stranger_datagram{by.peer, std::move(reason)});
    };
    auto got = reader.next();
    bool proven = false; // whoever sent it receives at that address
    if (got && *got && std::holds_alternative<shown_key>(**got)) {
        proven = std::get<shown_key>(**got).key == key_of(by);
        got = reader.next();
    }
    if (proven && boat_ == by) {
        if (got) take(now, *got);
    } else {
        if (!got) return refuse("it is empty");
        if (!*got) return refuse(got->error().message());
        const auto* result = std::get_if<login>(&**got);
        if (!result) return refuse("it brings no login");
        if (result->id != options_.boat_id)
            return refuse(fmt::format("it calls itself '{}', which is not the boat", result->id));
        if (boat_ && !boat_->datagrams)
            return refuse(fmt::format("the boat is there over a connection, from {}", boat_->peer.text()));
        if (!proven) {
            ++counters_.challenges;
            tell(send_text{by, encode(challenge{result->token, key_of(by)})});
            return;
        }
        admit(now, by, *result, line_reader());
    }
    while (boat_ == by) {
        got = reader.next();
        if (!got) break;
        take(now, *got);
    }
    acknowledge();
}

void shore::admit(ise::time_point now, const way& by, const login& result, line_reader reader) {
    bool moved = boat_.has_value();
    if (moved) {
        ++counters_.moves;
        if (!boat_->datagrams) tell(cut_off{*boat_, fmt::format("the boat is back from {}", by.peer.text()), false});
    }
    boat_ = by;
    reader_ = std::move(reader);
    bad_lines_ = 0;
    came_at_ = heard_at_ = now;
    take_login(result);
    tell(boat_came{by, moved});
}

void shore::take(ise::time_point now, const ise::result<line>& got) {
    if (!got) {
        ++counters_.malformed;
        if (++bad_lines_ < options_.max_bad_lines || boat_->datagrams) return;
        tell(cut_off{
            *boat_,
            fmt::format("{} lines one after the other make no sense; the last: {}", bad_lines_, got.error().message()),
            false});
        return lose_boat("its connection brings nonsense");
    }
    bad_lines_ = 0;
    heard_at_ = now;
    if (const auto* report = std::get_if<login>(&*got)) {
        if (report->id == options_.boat_id) return take_login(*report);
        ++counters_.malformed;
    } else if (const auto* data = std::get_if<record>(&*got)) {
        take_record(record(*data));
    } else if (const auto* done = std::get_if<outcome>(&*got)) {
        const auto* here = known(boot_);
        auto asked =
            std::find_if(orders_.begin(), orders_.end(), [&](const auto& one) { return one.first == done->id; });
        if (here && asked != orders_.end() && asked->second == here->id) tell(outcome_came{*done});
        else ++counters_.strange_outcomes; // it comes again once the telecommand has gone there
    } else {
        ++counters_.malformed; // what only the shore says
    }
}

void shore::take_login(const login& result) {
    ++counters_.logins;
    if (std::pair(result.boot, result.token) != std::pair(boot_, token_)) owed_.clear();
    boot_ = result.boot;
    token_ = result.token;
    auto& of = life_of(result.boot);
    if (result.last < of.safe.complete()) {
        // It has given fewer numbers than it was acknowledged.
        if (boat_->datagrams) return; // a datagram of long ago
        tell(remark{fmt::format("boot {} counts from {} again, and had come to {}: give each start of the boat another "
                                "boot number and token",
                                result.boot, result.first_unacked, of.safe.complete())});
        start_afresh(of);
    }
    of.announced = std::max(of.announced, result.last);
    auto gone = of.received.skip_to(result.first_unacked - 1);
    of.safe.skip_to(result.first_unacked - 1);
    // Of a life that is new here the shore does not know what was acknowledged before: by another proxy, or its last
    // start.
    if (gone > 0 && of.heard) {
        counters_.given_up += gone;
        tell(remark{fmt::format("the boat gave up {} packets that had not arrived: its memory was full", gone)});
    }
    of.heard = true;
    owed_.insert(result.boot);
}

void shore::take_record(record&& result) {
    auto& of = life_of(result.boot);
    of.announced = std::max(of.announced, result.number);
    if (of.received.contains(result.number)) {
        ++counters_.resends;
        owed_.insert(result.boot); // the acknowledgement did not arrive
        return;
    }
    if (unsafe_ >= options_.max_unsafe || !of.received.add(result.number)) {
        ++counters_.postponed;
        return;
    }
    ++unsafe_;
    ++counters_.records;
    if (result.history) ++counters_.history;
    tell(record_came{of.id, result.number, result.history, std::move(result.raw)});
}

void shore::safe(std::uint64_t life_id, const std::vector<std::uint32_t>& numbers) {
    unsafe_ -= std::min(unsafe_, numbers.size());
    auto* of = life_by(life_id);
    if (!of) return; // that is over
    for (auto number : numbers) of->safe.add(number);
    if (of->token == token_) owed_.insert(of->boot);
    acknowledge();
}

void shore::refused(std::uint64_t life_id, std::uint32_t number) {
    unsafe_ -= std::min<std::size_t>(unsafe_, 1);
    auto* of = life_by(life_id);
    if (of && !of->safe.contains(number)) of->received.remove(number); // else the boat has given it up meanwhile
}

void shore::acknowledge() {
    auto owed = std::exchange(owed_, {});
    if (!boat_) return; // its next login asks for it
    std::string text;
    for (auto boot : owed)
        if (const auto* of = known(boot)) text += encode(receipt{boot, of->safe.complete()});
    if (!text.empty()) send_to_boat(std::move(text));
}

void shore::send_to_boat(std::string text) {
    if (boat_->datagrams) text = encode(shown_key{key_of(*boat_)}) + text;
    tell(send_text{*boat_, std::move(text)});
}

/// Only who receives at that address learns it, and only the shore's secret makes it.
std::uint64_t shore::key_of(const way& by) const {
    return ise::net::udp::keyed_hash(options_.secret, ise::as_bytes(fmt::format("{} {}", by.channel, by.peer.text())));
}

bool shore::send(const order& what) {
    if (!boat_) return false;
    std::erase_if(orders_, [&](const auto& one) { return one.first == what.id; });
    orders_.emplace_back(what.id, life_of(boot_).id);
    if (orders_.size() > options_.max_orders) orders_.pop_front();
    send_to_boat(encode(what));
    return true;
}

void shore::on_time(ise::time_point now) {
    while (!strangers_.empty() && strangers_.front().until <= now)
        cut_stranger(strangers_.begin(), "it did not log in in time");
    if (!boat_ || now < ise::saturating_add(heard_at_, options_.silence)) return;
    ++counters_.half_open;
    if (!boat_->datagrams) tell(cut_off{*boat_, "the boat is silent: the connection is half open", false});
    lose_boat(fmt::format("nothing was heard for {} s",
                          std::chrono::duration_cast<std::chrono::seconds>(options_.silence).count()));
}

ise::time_point shore::next_event() const {
    auto next = strangers_.empty() ? ise::time_point::max() : strangers_.front().until;
    if (boat_) next = std::min(next, ise::saturating_add(heard_at_, options_.silence));
    return next;
}

std::optional<shore_event> shore::take_event() {
    if (events_.empty()) return std::nullopt;
    std::optional<shore_event> first(std::move(events_.front()));
    events_.pop_front();
    return first;
}

std::uint32_t shore::acknowledged() const {
    const auto* of = known(boot_);
    return of ? of->safe.complete() : 0;
}

std::uint32_t shore::announced() const {
    const auto* of = known(boot_);
    return of ? of->announced : 0;
}

void shore::lose_boat(const std::string& reason) {
    boat_.reset();
    reader_ = line_reader();
    tell(boat_went{reason});
}

void shore::cut_stranger(std::list<stranger>::iterator who, std::string reason) {
    ++counters_.strangers_cut_off;
    tell(cut_off{who->by, std::move(reason), true});
    strangers_.erase(who);
}

const shore::life* shore::known(std::uint16_t boot) const {
    auto found =
        std::find_if(lives_.begin(), lives_.end(), [&](const life& l) { return l.boot == boot && l.token == token_; });
    return found == lives_.end() ? nullptr : &*found;
}

shore::life& shore::life_of(std::uint16_t boot) {
    auto found =
        std::find_if(lives_.begin(), lives_.end(), [&](const life& l) { return l.boot == boot && l.token == token_; });
    if (found != lives_.end()) {
        lives_.splice(lives_.begin(), lives_, found);
        return lives_.front();
    }
    if (lives_.size() >= options_.max_boots) lives_.pop_back();
    auto& made = lives_.emplace_front();
    made.boot = boot;
    made.token = token_;
    start_afresh(made);
    return made;
}

shore::life* shore::life_by(std::uint64_t id) {
    auto found = std::find_if(lives_.begin(), lives_.end(), [&](const life& l) { return l.id == id; });
    return found == lives_.end() ? nullptr : &*found;
}

void shore::start_afresh(life& of) {
    of.id = ++last_life_;
    of.received = of.safe = number_set();
    of.announced = 0;
    of.heard = false;
}

} // namespace atirma::gprs
