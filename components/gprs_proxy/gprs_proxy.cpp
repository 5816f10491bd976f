#include <components/gprs_proxy/gprs_proxy.hpp>

#include <components/boat/duplicate_filter.hpp>
#include <components/boat/find_component.hpp>
#include <components/boat/newest_by_kind.hpp>
#include <components/boat/remote_telemetry_store.hpp>
#include <components/boat/telecommand_service.hpp>
#include <components/boat/telemetry_keeper.hpp>
#include <components/gprs_proxy/gprs_account.hpp>
#include <components/gprs_proxy/listeners.hpp>
#include <components/seal_store/seal_store.hpp>

#include <ise/core/log_limiter.hpp>
#include <ise/service/service_host.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration keep_account_period = 10s; // each time is a write to the disk
} // namespace

struct gprs_proxy::link {
    static gprs::shore_options with_secret(gprs_proxy& self, gprs::shore_options options) {
        options.secret = {self.env().random(), self.env().random()};
        return options;
    }
    link(gprs_proxy& self, const gprs_proxy_options& options)
        : shore(with_secret(self, options.shore)),
          sockets(
              self.on(), self.log(),
              [&self](std::string name, ise::task<> body) { self.spawn(std::move(name), std::move(body)); },
              self.services().peers().credentials()),
          commands(self, options.policy), due(self.on(),
                                              [this, &self] {
                                                  shore.on_time(self.now());
                                                  self.act();
                                              }),
          more(self.on()) {}

    std::unique_ptr<seal::shore_link> seal; // empty: no key
    gprs::shore shore;
    listeners sockets;
    telecommand_service commands;
    duplicate_filter seen;
    std::map<std::uint64_t, newest_by_kind> newest; // by the life of the boat: what one says hides nothing of another
    ise::timer due;
    // What waits for the store, by the life of the boat's numbering.
    std::map<std::uint64_t, std::vector<std::uint32_t>> numbers;
    std::vector<telemetry_packet> packets;
    ise::waiter<std::error_code> more;
    ise::log_limiter strangers;
    std::vector<ise::endpoint> listening;
    std::string from, gone = "the boat has not called yet";
    std::optional<telemetry_keeper> keeper;
    std::optional<gprs_account> account;
    std::string account_trouble;
    gprs_state counts;
    ise::publication<ise::subscription<telemetry_packet>> telemetry;
    ise::publication<ise::subscription<gprs_state>> states;
    bool acting = false;
};

gprs_proxy::gprs_proxy(gprs_proxy_options options) : options_(std::move(options)) {
    options_.policy.link = link_id::gprs;
}
gprs_proxy::~gprs_proxy() = default;

utc_time gprs_proxy::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }
utc_time gprs_proxy::civil(ise::time_point at) const {
    return std::chrono::floor<std::chrono::milliseconds>(wall() - (now() - at));
}

ise::task<> gprs_proxy::run() {
    if (!gprs::is_good_id(options_.shore.boat_id))
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("'{}' is not a name for a boat: up to {} letters, digits, '-', '_', '.'",
                                     options_.shore.boat_id, gprs::max_id));
    if (!options_.store_at.empty()) {
        require(services::telemetry_store);
        options_.store = std::make_shared<remote_telemetry_store>(find_component(*this, options_.store_at));
    }
    if (options_.database.empty() && (options_.daily_budget > 0 || options_.monthly_budget > 0))
        throw ise::error(ise::errc::invalid_argument,
                         "--daily-budget and --monthly-budget need --database FILE: what was spent must survive a "
                         "restart of the proxy");
    link_ = std::make_unique<link>(*this, options_);
    ise::when_damaged how(log(), [this] { return std::chrono::floor<std::chrono::system_clock::duration>(wall()); });
    auto file = options_.database.empty() ? "memory:" + path() + "/account" : options_.database;
    link_->account.emplace(
        gprs_account::open(file, options_.daily_budget, options_.monthly_budget, clock(), std::move(how)).value());
    struct keep_at_end {
        gprs_proxy& self;
        ~keep_at_end() { self.keep_account(); }
    } guard{*this};
    link_->seal = seal::shore_link::open_for(*this, options_.radio_key_file, link_id::gprs, options_.radio_secondary);
    if (options_.store) link_->keeper.emplace(*this, options_.store, "the boat is not acknowledged");
    open_doors();
    provide_all();
    spawn("store", keep());
    if (options_.on_listening) options_.on_listening(link_->listening);
    auto keep_at = now();
    for (;;) {
        if (now() >= keep_at) {
            keep_at = ise::saturating_add(now(), keep_account_period);
            keep_account();
        }
        publish_state();
        co_await sleep(options_.state_period);
    }
}

void gprs_proxy::keep_account() {
    auto& l = *link_;
    auto kept = l.account->keep(clock());
    auto trouble = kept ? std::string() : "what was spent cannot be kept: " + kept.error().message();
    if (trouble != l.account_trouble && !trouble.empty()) log().error(trouble);
    l.account_trouble = trouble;
}

/// What may save the boat is worth its bytes, and what makes telemetry rarer saves them.
ise::result<void> gprs_proxy::within_budget(const boat_command& command) const {
    auto end = end_of_budget(link_->account->budget(), 1, clock());
    const auto* period = command.get_if<commands::set_telemetry_period>();
    if (!end || traits_of(command.kind()).priority == command_priority::saves) return {};
    if (period && period->link == link_id::gprs) return {};
    return ise::failure(ise::errc::refused,
                        fmt::format("GPRS: {}; send it over another link, or raise the budget", end->text));
}

void gprs_proxy::open_doors() {
    auto& l = *link_;
    l.sockets.on_connected = [this](const gprs::way& by) {
        link_->shore.connected(now(), by);
        act();
    };
    l.sockets.on_bytes = [this](std::uint64_t channel, ise::bytes_view bytes) {
        auto was = link_->shore.boat();
        link_->shore.on_bytes(now(), channel, bytes);
        const auto& boat = link_->shore.boat(); // who has not logged in is not charged to the boat
        if (boat && !boat->datagrams && boat->channel == channel) {
            if (was != boat) link_->account->connected();
            link_->account->count(false, bytes.size(), false);
        }
        act();
    };
    l.sockets.on_disconnected = [this](std::uint64_t channel, const std::string& reason) {
        link_->shore.disconnected(now(), channel, reason);
        act();
    };
    l.sockets.on_unverified = [this](const std::string& peer, const std::string& reason) {
        if (auto left_out = link_->strangers.admit(now()))
            log().warning("a login over tls is refused",
                          {{"from", peer}, {"cause", reason}, {"not_told_before", std::to_string(*left_out)}});
    };
    l.sockets.on_datagram = [this](const gprs::way& by, ise::bytes_view content) {
        link_->shore.on_datagram(now(), by, content);
        if (link_->shore.boat() == by) link_->account->count(false, content.size(), true);
        act();
    };
    if (options_.listen.empty())
        throw ise::error(ise::errc::invalid_argument,
                         "the boat has nowhere to call: name an endpoint such as tcp://0.0.0.0:7420");
    for (const auto& text : options_.listen) {
        auto at = ise::endpoint::parse(text).value();
        l.listening.push_back(l.sockets.open(at).value());
        log().info("the boat can call", {{"at", l.listening.back().text()}});
    }
}

void gprs_proxy::provide_all() {
    auto& l = *link_;
    l.telemetry = publish(services::telemetry);
    l.states = publish(services::gprs);
    l.commands.give = [this] { return give(); };
    l.commands.admit = [this](const telecommand_request& request) { return within_budget(request.command); };
    l.commands.provide();
    publish_state();
}

void gprs_proxy::act() {
    auto& l = *link_;
    if (l.acting) return;
    l.acting = true;
    while (auto event = l.shore.take_event()) handle(*event);
    l.acting = false;
    l.commands.work();
    auto next = l.shore.next_event();
    if (next == ise::time_point::max()) l.due.disarm();
    else l.due.arm(next);
}

void gprs_proxy::handle(const gprs::shore_event& event) {
    auto& l = *link_;
    if (const auto* send = std::get_if<gprs::send_text>(&event)) {
        l.sockets.send(send->to, send->text);
        if (l.shore.boat() == send->to) l.account->count(true, send->text.size(), send->to.datagrams);
    } else if (const auto* cut = std::get_if<gprs::cut_off>(&event)) {
        l.sockets.cut(cut->whom.channel);
        auto left_out = cut->stranger ? l.strangers.admit(now()) : std::optional<std::uint64_t>(0);
        if (left_out)
            log().warning(cut->stranger ? "a stranger was cut off" : "a connection of the boat was cut off",
                          {{"from", cut->whom.peer.text()},
                           {"cause", cut->reason},
                           {"not_told_before", std::to_string(*left_out)}});
    } else if (const auto* stranger = std::get_if<gprs::stranger_datagram>(&event)) {
        if (auto left_out = l.strangers.admit(now()))
            log().warning("a stranger's datagram was dropped", {{"from", stranger->from.text()},
                                                                {"cause", stranger->reason},
                                                                {"not_told_before", std::to_string(*left_out)}});
    } else if (const auto* came = std::get_if<gprs::boat_came>(&event)) {
        l.from = came->by.peer.text();
        l.gone.clear();
        log().info(came->moved ? "the boat moved" : "the boat is there",
                   {{"from", l.from}, {"boot", std::to_string(l.shore.boot())}});
        l.commands.tracker().on_link_up(l.commands.now());
        publish_state();
    } else if (const auto* went = std::get_if<gprs::boat_went>(&event)) {
        l.gone = went->reason;
        log().info("the boat is gone", {{"cause", went->reason}, {"from", l.from}});
        publish_state();
    } else if (const auto* record = std::get_if<gprs::record_came>(&event)) {
        on_record(*record);
    } else if (const auto* result = std::get_if<gprs::outcome_came>(&event)) {
        on_outcome(result->what);
    } else if (const auto* said = std::get_if<gprs::remark>(&event)) {
        log().warning(said->text, {{"from", l.from}});
    }
}

/// Empty: it is about the seal only.
ise::result<ise::bytes> gprs_proxy::open(const ise::bytes& raw) {
    auto& l = *link_;
    if (!l.seal && seal::is_sealed(raw))
        return ise::failure(ise::errc::refused, "the packet is sealed, and there is no key (set radio-key)");
    if (!l.seal) return raw;
    auto got = l.seal->open(raw);
    if (auto question = l.seal->take_question(); !question.empty()) {
        gprs::order result;
        result.raw = std::move(question);
        l.shore.send(result); // if the boat has gone, its next notice is answered
    }
    return got;
}

/// Nothing: it cannot be read here.
std::optional<ise::bytes> gprs_proxy::opened(const ise::bytes& raw) {
    auto& l = *link_;
    auto got = open(raw);
    if (got) return std::move(*got);
    ++l.counts.malformed;
    if (auto left_out = l.strangers.admit(now()))
        log().warning("a packet was dropped",
                      {{"cause", got.error().message()}, {"not_told_before", std::to_string(*left_out)}});
    return std::nullopt;
}

void gprs_proxy::on_record(const gprs::record_came& came) {
    auto& l = *link_;
    auto raw = opened(came.raw);
    // Another key may open it; but a notice is worth nothing without the key that it is about.
    if (!raw && !seal::is_notice(came.raw)) return l.shore.refused(came.life, came.number);
    // Whatever it is, the boat need not send it again.
    l.numbers[came.life].push_back(came.number);
    l.more.resume({});
    if (!raw || raw->empty()) return;
    auto message = parse_telemetry(*raw);
    if (!message) {
        ++l.counts.malformed;
        log().warning("a packet was dropped", {{"cause", message.error().message()}});
        return;
    }
    const auto& header = message->header;
    l.commands.tracker().on_heard(l.commands.now(), header);
    if (!l.seen.first_time(header.boot, header.sequence, *raw)) {
        ++l.counts.duplicates;
        return;
    }
    telemetry_packet out;
    out.link = link_id::gprs;
    out.boot = header.boot;
    out.sequence = header.sequence;
    out.measured_at = header.measured_at;
    out.received_at = clock();
    out.history = came.history;
    out.raw = std::move(*raw);
    out.history = l.newest[came.life].is_history(out);
    if (l.newest.size() > options_.shore.max_boots) l.newest.erase(l.newest.begin());
    l.telemetry(out);
    ++l.counts.telemetry_published;
    if (out.history) ++l.counts.history;
    l.packets.push_back(std::move(out));
}

void gprs_proxy::on_outcome(const gprs::outcome& result) {
    auto& l = *link_;
    auto& tracker = l.commands.tracker();
    bool answered = false;
    if (!result.raw.empty() || l.seal) {
        auto raw = opened(result.raw);
        if (!raw || raw->empty()) return;
        auto whole = parse_acknowledgement(*raw);
        if (!whole || whole->id != result.id) {
            ++l.counts.malformed;
            return;
        }
        answered = tracker.on_acknowledgement(l.commands.now(), *whole);
    } else { // a boat of few words
        answered = tracker.on_result(l.commands.now(), result.id, static_cast<ack_code>(result.code));
    }
    if (answered) ++l.counts.telecommands_acknowledged;
}

/// Has what came kept, and then acknowledged.
ise::task<> gprs_proxy::keep() {
    auto& l = *link_;
    for (;;) {
        if (l.numbers.empty()) co_await l.more.wait(); // throws what it was resumed with
        auto numbers = std::exchange(l.numbers, {});
        auto packets = std::exchange(l.packets, {});
        if (l.keeper && !packets.empty()) {
            auto keeping = l.keeper->keep(std::move(packets));
            co_await std::move(keeping);
        }
        for (const auto& [life, which] : numbers) l.shore.safe(life, which);
        act();
    }
}

bool gprs_proxy::give() {
    auto& l = *link_;
    auto& tracker = l.commands.tracker();
    if (!l.shore.boat()) return false;
    using kind = link_outcome::kind;
    while (auto due = tracker.next_due(l.commands.now())) {
        gprs::order result;
        result.id = due->id;
        result.raw = std::move(due->raw);
        if (l.seal) { // each attempt anew: the boat accepts a counter once
            auto sealed = l.seal->seal(result.raw);
            if (!sealed) {
                tracker.on_outcome(l.commands.now(), result.id, make_outcome(kind::later, sealed.error().message()));
                continue;
            }
            result.raw = std::move(*sealed);
        }
        bool sent = l.shore.send(result);
        if (sent) ++l.counts.telecommands_sent;
        tracker.on_outcome(l.commands.now(), result.id,
                           sent ? make_outcome(kind::delivered, "left the shore; the boat's answer is awaited")
                                : make_outcome(kind::later, "the boat is not there"));
    }
    while (auto event = l.shore.take_event()) handle(*event);
    return true;
}

void gprs_proxy::publish_state() {
    auto& l = *link_;
    auto result = l.counts;
    for (const auto& at : l.listening) result.listening.push_back(at.text());
    result.connected = l.shore.boat().has_value();
    result.from = l.from;
    result.trouble = l.keeper && !l.keeper->trouble().empty() ? l.keeper->trouble() : l.gone;
    if (result.trouble.empty()) result.trouble = l.account_trouble;
    const auto& counted = l.shore.counters();
    if (result.connected) result.connected_since = civil(l.shore.came_at());
    if (counted.logins > 0) result.last_heard = civil(l.shore.heard_at());
    result.boot = l.shore.boot();
    result.acknowledged = l.shore.acknowledged();
    result.announced = l.shore.announced();
    result.not_safe_yet = l.shore.unsafe();
    result.logins = counted.logins;
    result.moves = counted.moves;
    result.half_open = counted.half_open;
    result.packets_received = counted.records;
    result.resends = counted.resends;
    result.postponed = counted.postponed;
    result.given_up = counted.given_up;
    result.malformed += counted.malformed;
    result.strangers = l.shore.strangers();
    result.strangers_cut_off = counted.strangers_cut_off;
    result.stranger_datagrams = counted.stranger_datagrams;
    result.challenges = counted.challenges;
    result.strange_outcomes = counted.strange_outcomes;
    result.telecommands_open = l.commands.tracker().open_count();
    result.seal = seal::shore_link::report(l.seal);
    result.day = day_text(clock());
    result.today = l.account->today();
    result.this_month = l.account->this_month();
    result.budget = l.account->budget();
    if (auto end = end_of_budget(result.budget, 1, clock()))
        result.budget_notice = end->text +
                               "; telecommands are refused meanwhile, except modes, beacon and the period of "
                               "telemetry over GPRS. Telemetry goes on: make it rarer";
    l.states(result);
}

} // namespace atirma
