#include <components/iridium_gateway/gateway_model.hpp>

#include <components/iridium/text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

namespace atirma {
namespace {

constexpr std::uint8_t failures[] = {18, 32, 17, 13, 10}; // how sessions fail

ise::duration seconds_of(double s) {
    return std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(s));
}

} // namespace

ise::result<sbd_session_reply> gateway_model::session(ise::time_point now, std::chrono::sys_seconds wall,
                                                      const sbd_session_request& request) {
    if (!state.up) return ise::failure(ise::errc::not_connected, "the gateway is switched off");
    if (auto good = iridium::check_imei(request.imei); !good)
        return ise::failure(ise::errc::refused, good.error().message());
    if (request.data.size() > iridium::max_mo_bytes)
        return ise::failure(ise::errc::refused, fmt::format("a message of {} bytes, {} at most", request.data.size(),
                                                            iridium::max_mo_bytes));
    on_time(now);
    ++state.sessions;
    sbd_session_reply reply;
    bool unknown = !options_.imeis.contains(request.imei);
    bool full = deliveries_.size() >= options_.max_deliveries;
    if (unknown || full || dice_.chance(state.session_failures)) {
        ++state.sessions_failed;
        reply.mo_status = unknown ? std::uint8_t{15}
                          : full  ? std::uint8_t{11}
                                  : failures[dice_.next() % std::size(failures)];
        return reply;
    }
    auto& mine = modems_[request.imei];
    if (mine.handed_out != 0 && mine.handed_out == request.received_mtmsn) {
        mine.queue.pop_front();
        mine.handed_out = 0;
        ++state.mt_delivered;
    }
    if (!mine.queue.empty()) {
        auto& first = mine.queue.front();
        mine.handed_out = first.mtmsn;
        reply.mt_status = 1;
        reply.mtmsn = first.mtmsn;
        reply.data = first.raw;
        reply.mt_queued = static_cast<std::uint16_t>(mine.queue.size() - 1);
    }
    ++state.mo_messages;
    waiting_mo made;
    made.message.imei = request.imei;
    made.message.momsn = request.momsn;
    made.message.mtmsn = options_.tells_mtmsn ? reply.mtmsn : std::uint16_t{0};
    made.message.session_time = wall;
    made.message.cdr = next_cdr_++;
    auto where = options_.where;
    where.latitude_deg = std::round((where.latitude_deg + dice_.between(-0.02, 0.02)) * 1e4) / 1e4;
    where.longitude_deg = std::round((where.longitude_deg + dice_.between(-0.02, 0.02)) * 1e4) / 1e4;
    made.message.where = where;
    made.message.data = request.data;
    made.since = now;
    made.next = ise::saturating_add(now, seconds_of(state.delivery_delay_s * dice_.between(0.5, 1.5)));
    made.pause = options_.min_repeat;
    deliveries_.emplace(next_number_++, std::move(made));
    state.mo_waiting = deliveries_.size();
    state.mt_waiting = 0;
    for (const auto& [imei, of] : modems_) state.mt_waiting += of.queue.size();
    return reply;
}

std::optional<gateway_model::delivery> gateway_model::next_delivery(ise::time_point now) {
    if (!state.up) return std::nullopt;
    for (auto& [number, d] : deliveries_) {
        if (d.under_way || d.next > now) continue;
        d.under_way = true;
        ++state.posts;
        delivery made;
        made.number = number;
        made.message = d.message;
        return made;
    }
    return std::nullopt;
}

void gateway_model::on_delivered(ise::time_point now, std::uint64_t number, bool taken, const std::string& trouble) {
    auto found = deliveries_.find(number);
    if (found == deliveries_.end()) return;
    auto& d = found->second;
    d.under_way = false;
    state.trouble = taken ? std::string() : trouble;
    if (taken && (d.again || !dice_.chance(state.duplicates))) {
        deliveries_.erase(found);
    } else if (taken) {
        d.again = true;
        d.next = ise::saturating_add(now, options_.min_repeat);
    } else {
        ++state.posts_failed;
        d.next = ise::saturating_add(now, d.pause);
        d.pause = std::min(d.pause * 2, options_.max_repeat);
        if (now - d.since >= options_.give_up) {
            deliveries_.erase(found);
            ++state.mo_given_up;
        }
    }
    state.mo_waiting = deliveries_.size();
}

iridium::mt_reply gateway_model::submit(ise::time_point now, const iridium::mt_submission& what, std::string& ring) {
    using iridium::mt_failure;
    auto failed = [&](int code, std::string text) {
        ++state.mt_refused;
        iridium::mt_reply reply;
        reply.code = code;
        reply.text = std::move(text);
        return reply;
    };
    if (state.fail_mt != 0) return failed(state.fail_mt, "as it was told to");
    if (what.username != options_.username || what.password != options_.password)
        return failed(10, "Invalid login credentials");
    if (!options_.imeis.contains(what.imei)) return failed(11, "No RockBLOCK with this IMEI found on your account");
    if (what.data.empty()) return failed(16, "No data");
    auto raw = iridium::from_hex(what.data, iridium::max_mt_bytes);
    if (!raw)
        return raw.error().code() == ise::errc::too_large ? failed(15, "Data too long")
                                                          : failed(14, "Could not decode hex data");
    auto place = enqueue(now, what.imei, std::move(*raw), what.flush);
    if (place.status < 1) return failed(99, "System Error");
    ring = what.imei;
    iridium::mt_reply reply;
    reply.accepted = true;
    reply.reference = std::to_string(next_reference_++);
    return reply;
}

gateway_model::queued gateway_model::enqueue(ise::time_point now, const std::string& imei, ise::bytes raw, bool flush) {
    auto refused = [&](int status) {
        ++state.mt_refused;
        queued made;
        made.status = status;
        return made;
    };
    if (!state.up) return refused(-6);
    if (!iridium::check_imei(imei)) return refused(-1);
    if (!options_.imeis.contains(imei)) return refused(-2);
    if (raw.size() > iridium::max_mt_bytes) return refused(-3);
    if (raw.empty() && !flush) return refused(-4);
    on_time(now);
    auto& mine = modems_[imei];
    if (flush) {
        state.mt_waiting -= mine.queue.size();
        mine.queue.clear();
        mine.handed_out = 0;
    }
    if (raw.empty()) return queued(); // DirectIP: the queue is emptied, and nothing is queued
    if (mine.queue.size() >= options_.max_queue) return refused(-5);
    waiting_mt made;
    made.mtmsn = next_mtmsn_;
    next_mtmsn_ = next_mtmsn_ == 65535 ? std::uint16_t{1} : static_cast<std::uint16_t>(next_mtmsn_ + 1);
    made.raw = std::move(raw);
    made.since = now;
    mine.queue.push_back(std::move(made));
    ++state.mt_messages;
    ++state.mt_waiting;
    queued place;
    place.status = static_cast<int>(mine.queue.size());
    place.mtmsn = mine.queue.back().mtmsn;
    return place;
}

void gateway_model::flush() {
    modems_.clear();
    state.mt_waiting = 0;
}

void gateway_model::on_time(ise::time_point now) {
    state.mt_waiting = 0;
    for (auto& [imei, mine] : modems_) {
        while (!mine.queue.empty() && now - mine.queue.front().since >= options_.purge) {
            if (mine.queue.front().mtmsn == mine.handed_out) mine.handed_out = 0;
            mine.queue.pop_front();
        }
        state.mt_waiting += mine.queue.size();
    }
}

ise::time_point gateway_model::next_event() const {
    auto next = ise::time_point::max();
    if (!state.up) return next;
    for (const auto& [number, d] : deliveries_)
        if (!d.under_way) next = std::min(next, d.next);
    return next;
}

} // namespace atirma
