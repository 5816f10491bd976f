#include <components/xbee_proxy/xbee_proxy.hpp>

#include <components/boat/duplicate_filter.hpp>
#include <components/boat/find_component.hpp>
#include <components/boat/receipt.hpp>
#include <components/boat/remote_telemetry_store.hpp>
#include <components/boat/telecommand_service.hpp>
#include <components/boat/telemetry_keeper.hpp>
#include <components/seal_store/seal_store.hpp>

#include <ise/core/log_limiter.hpp>
#include <ise/core/waiter.hpp>

#include <algorithm>
#include <deque>
#include <map>
#include <set>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t max_unheard = 4096; // an hour of telemetry
constexpr std::size_t max_unkept = 8192;  // what a boat keeps at most
constexpr std::size_t max_receipts = 8192;
constexpr ise::duration receipt_time = 4s;  // to be sent in; then the boat has sent the packets again
constexpr ise::duration boat_is_near = 30s; // since it was heard; receipts would be sent into the void
} // namespace

struct xbee_proxy::radio {
    radio(xbee_proxy& self, const xbee_proxy_options& options)
        : port(self.on(), self.log(), options.port), modem(self.on(), port), commands(self, options.policy),
          hand_on_soon(self.on(), [this] { hand_on(); }), stored(!options.store_at.empty()), more(self.on()) {}

    /// The boat's modem has the radio's acknowledgement, and so the boat does not send it again: it waits here for the
    /// first subscriber, such as a communication node that has not found this proxy's new life yet.
    void hand_on() {
        for (; !unheard.empty() && telemetry.subscribers() > 0; unheard.pop_front()) {
            telemetry(unheard.front());
            ++counts.telemetry_published;
            full = false;
        }
    }

    std::unique_ptr<seal::shore_link> seal; // empty: no key
    ise::log_limiter quiet;
    xbee::modem_port port;
    local_modem modem;
    telecommand_service commands;
    ise::timer hand_on_soon;
    std::deque<telemetry_packet> unheard; // oldest first
    bool full = false;
    duplicate_filter seen;
    bool stored;
    std::deque<telemetry_packet> unkept; // for the store, oldest first
    std::set<packet_name> unsafe;        // the names of these
    std::set<packet_name> receipts;      // to be given
    ise::waiter<std::error_code> more;
    std::optional<telemetry_keeper> keeper;
    ise::time_point heard_at{};
    std::map<xbee::token, std::uint32_t> under_way; // telecommands at the modem
    std::uint64_t heard_from = 0;
    xbee_local counts;
    ise::publication<ise::subscription<telemetry_packet>> telemetry;
    ise::publication<ise::subscription<xbee_local>> local;
};

xbee_proxy::xbee_proxy(xbee_proxy_options options) : options_(std::move(options)) {
    options_.policy.link = link_id::xbee;
}
xbee_proxy::~xbee_proxy() = default;

utc_time xbee_proxy::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

ise::task<> xbee_proxy::run() {
    radio_ = std::make_unique<radio>(*this, options_);
    radio_->seal = seal::shore_link::open_for(*this, options_.radio_key_file, link_id::xbee, options_.radio_secondary);
    radio_->port.on_event = [this](const xbee::client_event& event) { on_radio_event(event); };
    provide_all();
    spawn("serial port", radio_->port.run());
    if (radio_->stored) {
        spawn("store", keep());
        spawn("receipts", give_receipts());
    }
    for (;;) {
        co_await sleep(options_.local_period);
        publish_local();
        radio_->modem.refresh();
    }
}

/// Has what came kept; then the boat gets receipts.
ise::task<> xbee_proxy::keep() {
    auto& r = *radio_;
    require(services::telemetry_store);
    r.keeper.emplace(*this, std::make_shared<remote_telemetry_store>(find_component(*this, options_.store_at)),
                     "the boat gets no receipts");
    for (;;) {
        if (r.unkept.empty()) co_await r.more.wait(); // throws what it was resumed with
        auto many = std::min(r.unkept.size(), keep_request::max_packets);
        std::vector<telemetry_packet> packets(r.unkept.begin(), r.unkept.begin() + static_cast<std::ptrdiff_t>(many));
        auto keeping = r.keeper->keep(packets);
        co_await std::move(keeping);
        for (const auto& packet : packets) {
            packet_name name(packet.boot, packet.sequence);
            r.unsafe.erase(name);
            if (r.receipts.size() < max_receipts) r.receipts.insert(name);
        }
        r.unkept.erase(r.unkept.begin(), r.unkept.begin() + static_cast<std::ptrdiff_t>(many));
    }
}

/// One that is lost is made up for by the boat, which sends the packets again.
ise::task<> xbee_proxy::give_receipts() {
    auto& r = *radio_;
    for (;;) {
        co_await sleep(options_.receipt_period);
        auto to = options_.boat_address != 0 ? options_.boat_address : r.heard_from;
        if (to == 0 || !r.port.modem_ready() || now() - r.heard_at >= boat_is_near) continue;
        for (int few = 0; few < 4 && !r.receipts.empty(); ++few) {
            auto span = r.seal ? telemetry_receipt::sealed_span : telemetry_receipt::span;
            auto raw = encode_receipt(clock(), r.receipts, span);
            if (r.seal) {
                auto sealed = r.seal->seal(raw);
                if (!sealed) {
                    log().warning("a receipt is not sealed, and so not sent", {{"cause", sealed.error().message()}});
                    break; // the boat sends the packets again
                }
                raw = std::move(*sealed);
            }
            auto sent = r.port.send(to, std::move(raw), receipt_time);
            if (sent) ++r.counts.receipts_sent;
        }
    }
}

void xbee_proxy::provide_all() {
    auto& r = *radio_;
    ise::publication_callbacks<ise::subscription<telemetry_packet>> arrivals;
    arrivals.on_subscribe = [this](const auto&, const ise::subscriber_info&) {
        radio_->hand_on_soon.arm(now()); // once the subscription stands
        return ise::nothing{};
    };
    r.telemetry = publish(services::telemetry, std::move(arrivals));
    r.local = publish(services::xb_local);
    r.commands.give = [this] {
        give();
        return true;
    };
    r.commands.provide();
    provide_exclusive(services::xb_local_param,
                      [this](xbee_param_request request) { return radio_->modem.parameter(std::move(request)); });
    publish_local();
}

void xbee_proxy::on_radio_event(const xbee::client_event& event) {
    if (radio_->modem.on_event(event)) return;
    if (const auto* packet = std::get_if<xbee::packet_received>(&event)) on_packet(*packet);
    else if (const auto* outcome = std::get_if<xbee::send_outcome>(&event)) on_sent(*outcome);
    else if (std::holds_alternative<xbee::radio_ready>(event)) radio_->modem.refresh();
    if (!std::holds_alternative<xbee::at_outcome>(event)) radio_->commands.work();
}

/// Nothing: not of the boat, or about the seal only.
std::optional<ise::bytes> xbee_proxy::opened(const xbee::packet_received& packet) {
    auto& r = *radio_;
    if (!r.seal) return packet.payload;
    auto got = r.seal->open(packet.payload);
    if (auto question = r.seal->take_question(); !question.empty()) {
        auto sent = r.port.send(packet.source, std::move(question), options_.send_time);
        if (!sent)
            log().warning("a packet about the seal is not sent to the boat", {{"cause", sent.error().message()}});
    }
    if (!got) {
        ++r.counts.malformed;
        if (auto left_out = r.quiet.admit(now()))
            log().warning("a packet was refused",
                          {{"cause", got.error().message()}, {"left_out", std::to_string(*left_out)}});
        return std::nullopt;
    }
    r.heard_from = packet.source;
    if (got->empty()) return std::nullopt;
    return std::move(*got);
}

void xbee_proxy::on_packet(const xbee::packet_received& packet) {
    auto& r = *radio_;
    if (options_.boat_address != 0 && packet.source != options_.boat_address) {
        ++r.counts.foreign;
        return;
    }
    ++r.counts.packets_received;
    auto payload = opened(packet);
    if (!payload) return;
    r.heard_at = now();
    if (classify(*payload) == packet_class::acknowledgement) {
        auto ack = parse_acknowledgement(*payload);
        if (!ack) {
            ++r.counts.malformed;
            return;
        }
        r.heard_from = packet.source;
        if (r.commands.tracker().on_acknowledgement(r.commands.now(), *ack)) ++r.counts.telecommands_acknowledged;
        return;
    }
    auto message = parse_telemetry(*payload);
    if (!message) {
        ++r.counts.malformed;
        log().debug("a packet was dropped", {{"cause", message.error().message()}});
        return;
    }
    r.heard_from = packet.source;
    r.commands.tracker().on_heard(r.commands.now(), message->header);
    packet_name name(message->header.boot, message->header.sequence);
    if (r.unkept.size() >= max_unkept) return; // without a receipt it comes again
    if (!r.seen.first_time(name.first, name.second, *payload)) {
        ++r.counts.duplicates;
        if (r.stored && !r.unsafe.contains(name) && r.receipts.size() < max_receipts) r.receipts.insert(name);
        return;
    }
    telemetry_packet out;
    out.link = link_id::xbee;
    out.boot = message->header.boot;
    out.sequence = message->header.sequence;
    out.measured_at = message->header.measured_at;
    out.received_at = clock();
    out.raw = *payload;
    if (r.unheard.size() >= max_unheard) {
        r.unheard.pop_front();
        if (!std::exchange(r.full, true))
            log().warning("the telemetry has no subscriber, and the oldest packet is dropped",
                          {{"waiting", std::to_string(r.unheard.size())}});
    }
    if (r.stored) {
        r.unsafe.insert(name);
        r.unkept.push_back(out);
        r.more.resume({});
    }
    r.unheard.push_back(std::move(out));
    r.hand_on();
}

void xbee_proxy::on_sent(const xbee::send_outcome& outcome) {
    auto& r = *radio_;
    auto found = r.under_way.find(outcome.id);
    if (found == r.under_way.end()) return;
    auto id = found->second;
    r.under_way.erase(found);
    using kind = link_outcome::kind;
    bool stayed = outcome.executed == ise::execution::not_executed;
    auto text = outcome.delivered && outcome.reason.empty() ? "arrived at the boat's modem" : outcome.reason;
    r.commands.tracker().on_outcome(r.commands.now(), id,
                                    make_outcome(outcome.delivered ? kind::delivered
                                                 : stayed          ? kind::later
                                                                   : kind::unknown,
                                                 std::move(text)));
}

void xbee_proxy::give() {
    auto& r = *radio_;
    auto& tracker = r.commands.tracker();
    auto to = options_.boat_address != 0 ? options_.boat_address : r.heard_from;
    while (auto due = tracker.next_due(r.commands.now())) {
        std::string trouble = "the boat's modem was not heard yet, and no --boat-address was given";
        if (to != 0 && r.seal) { // each attempt anew: the boat accepts a counter once
            auto sealed = r.seal->seal(due->raw);
            if (!sealed) {
                tracker.on_outcome(r.commands.now(), due->id,
                                   make_outcome(link_outcome::kind::later, sealed.error().message()));
                continue;
            }
            due->raw = std::move(*sealed);
        }
        if (to != 0) {
            auto sent = r.port.send(to, std::move(due->raw), std::min(due->remaining, options_.send_time));
            if (sent) {
                r.under_way[*sent] = due->id;
                ++r.counts.telecommands_sent;
                continue;
            }
            trouble = sent.error().message();
        }
        tracker.on_outcome(r.commands.now(), due->id, make_outcome(link_outcome::kind::later, std::move(trouble)));
    }
}

void xbee_proxy::publish_local() {
    auto& r = *radio_;
    auto result = r.counts;
    result.port_open = r.port.is_open();
    result.modem_ready = r.port.modem_ready();
    result.device = r.port.options().device;
    result.trouble = !r.port.trouble().empty() ? r.port.trouble() : r.keeper ? r.keeper->trouble() : std::string();
    result.api_mode = result.modem_ready ? static_cast<std::uint8_t>(r.port.mode()) : std::uint8_t{0};
    result.port_openings = r.port.openings();
    result.telecommands_open = r.commands.tracker().open_count();
    const auto& line = r.port.counters();
    result.frames = line.frames;
    result.frames_refused = line.refused_frames;
    result.bytes_skipped = line.skipped_bytes;
    result.seal = seal::shore_link::report(r.seal);
    r.modem.fill(result);
    r.local(result);
}

} // namespace atirma
