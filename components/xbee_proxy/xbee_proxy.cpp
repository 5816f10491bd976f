#include <components/xbee_proxy/xbee_proxy.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <list>
#include <set>

namespace atirma {
namespace {
// Before the caller's deadline, so that "pending" still reaches it.
ise::duration reply_margin(ise::duration left) {
    return std::clamp<ise::duration>(left / 5, std::chrono::milliseconds(20), std::chrono::milliseconds(800));
}
} // namespace

struct xbee_proxy::waiting_call {
    waiting_call(ise::loop& on, std::uint32_t of) : id(of), wake(on, [this] { wake.resume(asio::error::operation_aborted); }), late(on, [this] { wake.resume({}); }) {}
    std::uint32_t id;
    ise::waiter<std::error_code> wake;
    ise::timer late;
};

struct xbee_proxy::radio {
    radio(xbee_proxy& self, const xbee_proxy_options& options)
        : port(self.on(), self.log(), options.port), modem(self.on(), port), book(options.book), due(self.on(), [&self] { self.work(); }) {}

    xbee::modem_port port;
    local_modem modem;
    command_book book;
    duplicate_filter seen;
    ise::timer due;
    std::map<xbee::token, std::uint32_t> under_way; // telecommands at the modem
    std::list<waiting_call*> calls;
    std::map<std::uint64_t, std::uint32_t> followers; // subscriber's number → id, 0 for all
    std::uint64_t heard_from = 0;
    xbee_local counts;
    ise::publication<ise::subscription<telemetry_packet>> telemetry;
    ise::publication<std::decay_t<decltype(services::telecommand_state)>> states;
    ise::publication<ise::subscription<xbee_local>> local;
    bool working = false;
};

xbee_proxy::xbee_proxy(xbee_proxy_options options) : options_(std::move(options)) { options_.book.link = link_id::xbee; }
xbee_proxy::~xbee_proxy() = default;

utc_time xbee_proxy::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

ise::task<> xbee_proxy::run() {
    radio_ = std::make_unique<radio>(*this, options_);
    radio_->port.on_event = [this](const xbee::client_event& event) { on_radio_event(event); };
    provide_all();
    spawn("serial port", radio_->port.run());
    for (;;) {
        co_await sleep(options_.local_period);
        publish_local();
        radio_->modem.refresh();
    }
}

void xbee_proxy::provide_all() {
    auto& r = *radio_;
    r.telemetry = publish(services::telemetry);
    r.local = publish(services::xb_local);
    ise::publication_callbacks<std::decay_t<decltype(services::telecommand_state)>> follow;
    follow.on_subscribe = [this](const follow_telecommand& which, const ise::subscriber_info& who) -> ise::result<followed_telecommands> {
        radio_->followers[who.number] = which.id;
        followed_telecommands answer;
        if (which.id == 0) answer.now = radio_->book.open();
        else if (const auto* known = radio_->book.find(which.id)) answer.now.push_back(*known);
        return answer;
    };
    follow.on_unsubscribe = [this](const auto&, const ise::subscriber_info& who) {
        radio_->followers.erase(who.number);
        return ise::nothing{};
    };
    r.states = publish(services::telecommand_state, std::move(follow));
    provide(services::telecommand, [this](telecommand_request request, const ise::call_context& context) {
        return command(std::move(request), context.deadline);
    });
    provide_exclusive(services::xb_local_param, [this](xbee_param_request request) { return radio_->modem.parameter(std::move(request)); });
    publish_local();
}

void xbee_proxy::on_radio_event(const xbee::client_event& event) {
    if (radio_->modem.on_event(event)) return;
    if (const auto* packet = std::get_if<xbee::packet_received>(&event)) on_packet(*packet);
    else if (const auto* outcome = std::get_if<xbee::send_outcome>(&event)) on_sent(*outcome);
    else if (std::holds_alternative<xbee::radio_ready>(event)) radio_->modem.refresh();
    if (!std::holds_alternative<xbee::at_outcome>(event)) work();
}

void xbee_proxy::on_packet(const xbee::packet_received& packet) {
    auto& r = *radio_;
    if (options_.boat_address != 0 && packet.source != options_.boat_address) {
        ++r.counts.foreign;
        return;
    }
    ++r.counts.packets_received;
    if (classify(packet.payload) == packet_class::acknowledgement) {
        auto ack = parse_acknowledgement(packet.payload);
        if (!ack) {
            ++r.counts.malformed;
            return;
        }
        r.heard_from = packet.source;
        if (r.book.on_acknowledgement(clock(), *ack)) ++r.counts.telecommands_acknowledged;
        return;
    }
    auto message = parse_telemetry(packet.payload);
    if (!message) {
        ++r.counts.malformed;
        log().debug("a packet was dropped", {{"cause", message.error().message()}});
        return;
    }
    r.heard_from = packet.source;
    if (!r.seen.first_time(message->header.boot, message->header.sequence)) {
        ++r.counts.duplicates;
        return;
    }
    telemetry_packet out;
    out.link = link_id::xbee;
    out.boot = message->header.boot;
    out.sequence = message->header.sequence;
    out.measured_at = message->header.measured_at;
    out.received_at = clock();
    out.raw = packet.payload;
    r.telemetry(out);
    ++r.counts.telemetry_published;
}

void xbee_proxy::on_sent(const xbee::send_outcome& outcome) {
    auto& r = *radio_;
    auto found = r.under_way.find(outcome.id);
    if (found == r.under_way.end()) return;
    auto id = found->second;
    r.under_way.erase(found);
    r.book.on_outcome(now(), clock(), id, outcome.delivered, outcome.executed == ise::execution::not_executed, outcome.reason);
}

void xbee_proxy::work() {
    auto& r = *radio_;
    if (r.working) return; // giving to the port may bring events, which end here again
    r.working = true;
    auto to = options_.boat_address != 0 ? options_.boat_address : r.heard_from;
    while (auto due = r.book.next_due(now(), clock())) {
        if (to == 0) {
            r.book.on_outcome(now(), clock(), due->id, false, true, "the boat's modem was not heard yet, and no --boat-address was given");
            continue;
        }
        auto sent = r.port.send(to, std::move(due->raw), std::min(due->remaining, options_.send_time));
        if (sent) {
            r.under_way[*sent] = due->id;
            ++r.counts.telecommands_sent;
        } else {
            r.book.on_outcome(now(), clock(), due->id, false, true, sent.error().message());
        }
    }
    r.working = false;
    for (const auto& change : r.book.take_changes()) {
        r.states.to_some(change, [&r, &change](const ise::subscriber_info& subscriber) {
            auto who = r.followers.find(subscriber.number);
            return who == r.followers.end() || who->second == 0 || who->second == change.id;
        });
        if (!is_final(change.state)) continue;
        for (auto* call : r.calls)
            if (call->id == change.id) call->wake.resume({});
    }
    auto next = r.book.next_event();
    if (next == ise::time_point::max()) r.due.disarm();
    else r.due.arm(next);
}

ise::task<telecommand_reply> xbee_proxy::command(telecommand_request request, ise::time_point deadline) {
    auto& r = *radio_;
    auto chosen = static_cast<std::uint32_t>(env().random()) | 1u; // never 0
    auto taken = r.book.submit(now(), clock(), request, chosen);
    if (!taken) throw ise::error(ise::errc::refused, taken.error().message()); // it had no effect
    auto id = *taken;
    work();
    waiting_call here(on(), id);
    struct listed {
        std::list<waiting_call*>& in;
        std::list<waiting_call*>::iterator at;
        ~listed() { in.erase(at); }
    } guard{r.calls, r.calls.insert(r.calls.end(), &here)};
    auto until = deadline == ise::time_point::max() ? ise::saturating_add(now(), std::chrono::seconds(30)) : deadline - reply_margin(deadline - now());
    here.late.arm(until);
    for (;;) {
        const auto* status = r.book.find(id);
        bool decided = !status || is_final(status->state);
        if (decided || now() >= until) break;
        co_await here.wake.wait(); // throws what it was resumed with
    }
    telecommand_reply reply;
    reply.id = id;
    if (const auto* status = r.book.find(id)) {
        reply.state = is_final(status->state) ? status->state : telecommand_stage::pending;
        reply.result = status->result;
        reply.value = status->value;
        reply.text = status->text;
    }
    co_return reply;
}

void xbee_proxy::publish_local() {
    auto& r = *radio_;
    auto told = r.counts;
    told.port_open = r.port.is_open();
    told.modem_ready = r.port.modem_ready();
    told.device = r.port.options().device;
    told.trouble = r.port.trouble();
    told.api_mode = told.modem_ready ? static_cast<std::uint8_t>(r.port.mode()) : std::uint8_t{0};
    told.port_openings = r.port.openings();
    told.telecommands_open = r.book.open_count();
    const auto& line = r.port.counters();
    told.frames = line.frames;
    told.frames_refused = line.refused_frames;
    told.bytes_skipped = line.skipped_bytes;
    r.modem.fill(told);
    r.local(told);
}

} // namespace atirma
