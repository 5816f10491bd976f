#include <components/iridium_proxy/iridium_proxy.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat/remote_telemetry_store.hpp>
#include <components/iridium_proxy/proxy_state.hpp>
#include <ise/http/stream_http_client.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t max_key_bytes = 64 * 1024;
constexpr ise::duration forget_period = std::chrono::hours(1);

ise::error wrong(std::string what) { return ise::error(ise::errc::invalid_argument, std::move(what)); }
} // namespace

iridium_proxy::iridium_proxy(iridium_proxy_options options) : options_(std::move(options)) {}
iridium_proxy::~iridium_proxy() = default;

utc_time iridium_proxy::clock() const { return std::chrono::floor<std::chrono::milliseconds>(wall()); }

std::optional<ise::endpoint> iridium_proxy::webhook_at() const {
    if (!state_ || !state_->webhook) return std::nullopt;
    return state_->webhook->where();
}
std::optional<ise::endpoint> iridium_proxy::directip_at() const {
    if (!state_ || !state_->directip) return std::nullopt;
    return state_->directip->where();
}

void iridium_proxy::check_options() const {
    if (auto good = iridium::check_imei(options_.imei); !good) throw wrong("--imei: " + good.error().message());
    if (!options_.beacon_imei.empty()) {
        if (auto good = iridium::check_imei(options_.beacon_imei); !good)
            throw wrong("--beacon-imei: " + good.error().message());
        if (options_.beacon_imei == options_.imei)
            throw wrong("--beacon-imei is that of --imei: the second controller needs a modem of its own");
    }
    if (options_.webhook.empty() && options_.directip.empty() && !options_.open_mailbox)
        throw wrong("nothing can come from the boat: give --webhook, --directip or a mailbox");
    if (options_.webhook_path.empty() || options_.webhook_path[0] != '/')
        throw wrong("--webhook-path begins with a slash");
    auto beyond = [](const std::string& at) {
        return !at.empty() && !ise::within_host(ise::endpoint::parse(at).value());
    };
    if (beyond(options_.webhook) && options_.jwt_key_file.empty() && options_.gateway_addresses.empty())
        throw wrong(fmt::format(
            "--webhook {}: any host could post there as the gateway; give --jwt-key, or --gateway-addresses, or "
            "listen on 127.0.0.1 behind a reverse proxy",
            options_.webhook));
    if (beyond(options_.directip) && options_.gateway_addresses.empty())
        throw wrong(fmt::format(
            "--directip {}: any host could connect there as the gateway; give --gateway-addresses, or listen on "
            "127.0.0.1",
            options_.directip));
    if (options_.open_mailbox && options_.mail_authserv.empty() && !options_.mail_unchecked)
        throw wrong(
            "any sender can forge the gateway's address: name the mail server whose Authentication-Results are to be "
            "believed with --mail-authserv, or give --mail-unchecked if no other sender can reach the mailbox");
    if (options_.send_by == "mail" && (!options_.make_mail_sender || options_.mail_from.empty()))
        throw wrong("to send by mail, a mail server and --mail-from are needed");
    if (options_.send_by == "directip" && options_.send_directip.empty())
        throw wrong("to send by DirectIP, --send-directip is needed");
}

std::unique_ptr<mt_path> iridium_proxy::make_path() {
    if (options_.send_by == "none") return nullptr;
    if (options_.send_by == "directip")
        return make_directip_path(on(), ise::endpoint::parse(options_.send_directip).value());
    if (options_.send_by == "mail") {
        std::shared_ptr<mail_sender> sender = options_.make_mail_sender(on());
        return make_mail_path(std::move(sender), options_.mail_from, options_.mail_to);
    }
    if (options_.send_by != "http")
        throw wrong(fmt::format("--send-by is http, directip, mail or none, not '{}'", options_.send_by));
    auto account = options_.rockblock;
    if (account.password.empty()) account.password = env().variable("ATIRMA_ROCKBLOCK_PASSWORD").value_or("");
    std::shared_ptr<ise::http_client> client;
    if (options_.make_http_client) client = options_.make_http_client(on());
    else client = std::make_shared<ise::stream_http_client>(on());
    return make_rockblock_path(std::move(client), std::move(account));
}

ise::task<> iridium_proxy::run() {
    check_options();
    state_.reset();
    ise::when_damaged how(log(), [this] { return std::chrono::floor<std::chrono::system_clock::duration>(wall()); });
    how.begun = [this](ise::database&, const std::string&) { keep_what_is_open(); };
    state_ = std::make_unique<proxy_state>(*this, sbd_store::open(options_.database, std::move(how)).value(),
                                           sbd_policy(), [this] { hand_on(); });
    state_->seal =
        seal::shore_link::open_for(*this, options_.radio_key_file, link_id::iridium, options_.radio_secondary);
    auto& s = *state_;
    s.clock = s.store.clock().value();
    s.commands.clock = [this] {
        auto at = civil_tracker_time(state_->clock.read(clock(), now()));
        at.wall = clock(); // for the boat and for people
        return at;
    };
    s.commands.keep = [this](const tracked_telecommand& entry) { return keep_on_disk(entry); };
    s.commands.give = [this] {
        state_->wake_sender.resume({});
        return state_->path && !state_->sender_rests;
    };
    s.commands.tracker().restore(s.commands.now(), s.store.load().value());
    s.path = make_path();
    if (!options_.store_at.empty()) {
        require(services::telemetry_store);
        options_.store = std::make_shared<remote_telemetry_store>(find_component(*this, options_.store_at));
    }
    if (!options_.jwt_key_file.empty()) {
        auto pem = env().read_trusted(options_.jwt_key_file, max_key_bytes).value();
        auto key = iridium::jwt_key::parse(pem);
        if (!key) throw wrong(fmt::format("--jwt-key {}: {}", options_.jwt_key_file, key.error().message()));
        s.key.emplace(std::move(*key));
    }
    auto gateways = iridium::address_list::parse(options_.gateway_addresses);
    if (!gateways) throw wrong("--gateway-addresses: " + gateways.error().message());
    s.gateways = std::move(*gateways);
    take_kept_acknowledgements();
    provide_all();
    open_doors();
    spawn("to the gateway", send_all());
    if (options_.store) {
        s.keeper.emplace(*this, options_.store, "it waits on disk");
        spawn("to the store", keep_messages());
    }
    s.commands.work();
    auto forget_at = now();
    for (;;) {
        if (now() >= forget_at) {
            forget_at = ise::saturating_add(now(), forget_period);
            auto forgotten = s.store.forget_before(clock() - options_.keep);
            if (!forgotten) disk_trouble(forgotten.error());
        }
        s.account(account());
        co_await sleep(options_.account_period);
    }
}

/// A damaged file was replaced: the telecommands that are known here go to the new one.
void iridium_proxy::keep_what_is_open() {
    if (!state_) return;
    auto& s = *state_;
    for (const auto* entry : s.commands.tracker().open())
        if (!keep_on_disk(*entry)) return;
}

ise::result<void> iridium_proxy::keep_on_disk(const tracked_telecommand& entry) {
    auto& s = *state_;
    auto kept = s.store.keep(s.clock);
    if (kept) kept = s.store.save(entry);
    if (!kept) disk_trouble(kept.error());
    return kept;
}

/// Everything through which something of the boat comes.
void iridium_proxy::open_doors() {
    auto& s = *state_;
    auto spawner = [this](std::string name, ise::task<> body) { spawn(std::move(name), std::move(body)); };
    if (!options_.webhook.empty()) {
        s.webhook = std::make_unique<ise::http_server>(on(), log(), options_.http, spawner);
        s.webhook->otherwise([this](const ise::http_request& request) { return on_post(request); });
        s.webhook->listen(ise::endpoint::parse(options_.webhook).value()).value();
        log().info("the gateway may post here",
                   {{"url", fmt::format("{}{}", s.webhook->where().text(), options_.webhook_path)}});
    }
    if (!options_.directip.empty()) {
        auto answer = [this](ise::bytes_view message, const std::string& peer) { return on_directip(message, peer); };
        auto at = ise::endpoint::parse(options_.directip).value();
        auto bounds = options_.directip_bounds;
        if (!ise::within_host(at)) bounds.allowed = s.gateways;
        s.directip = std::make_unique<iridium::directip_server>(on(), log(), std::move(bounds), answer, spawner);
        s.directip->listen(at).value();
        log().info("the gateway may connect here", {{"directip", s.directip->where().text()}});
    }
    if (options_.open_mailbox) {
        s.mails = options_.open_mailbox(on());
        spawn("mails", read_mails());
    }
}

void iridium_proxy::provide_all() {
    auto& s = *state_;
    ise::publication_callbacks<ise::subscription<telemetry_packet>> arrivals;
    arrivals.on_subscribe = [this](const auto&, const ise::subscriber_info&) {
        state_->hand_on_soon.arm(now()); // what waited for somebody, once the subscription stands
        return ise::nothing{};
    };
    s.telemetry = publish(services::telemetry, std::move(arrivals));
    s.account = publish(services::iridium_account);
    s.commands.provide();
}

iridium_account iridium_proxy::account() {
    auto& s = *state_;
    auto outcome = s.counts;
    auto at = clock();
    outcome.day = day_text(at);
    auto fill = [&](ise::result<iridium_spending> spent, iridium_spending& into) {
        if (spent) into = *spent;
        else disk_trouble(spent.error());
    };
    fill(s.store.spent_on(at), outcome.today);
    fill(s.store.spent_in_month_of(at), outcome.this_month);
    fill(s.store.spent_ever(), outcome.ever);
    auto left = budget();
    outcome.daily_budget = left.daily;
    outcome.budget_left = left.daily_left;
    outcome.monthly_budget = left.monthly;
    outcome.monthly_budget_left = left.monthly_left;
    for (const auto* entry : s.commands.tracker().open()) {
        iridium_queued one;
        one.id = entry->id;
        one.kind = entry->command.kind();
        one.stage = entry->stage;
        one.priority = static_cast<std::uint8_t>(traits_of(one.kind).priority);
        one.attempts = entry->attempts;
        one.reference = entry->reference;
        one.text = entry->text;
        one.expires_at = at + (civil_time_of(entry->expires_at) - civil_time_of(s.commands.now().now));
        outcome.queue.push_back(std::move(one));
    }
    if (auto waiting = s.store.count_unpublished()) outcome.waiting_for_subscriber = *waiting;
    auto store_trouble = s.keeper ? s.keeper->trouble() : std::string();
    for (const auto* trouble : {&s.disk_trouble, &s.send_trouble, &s.mail_trouble, &store_trouble})
        if (!trouble->empty()) outcome.trouble += (outcome.trouble.empty() ? "" : "; ") + *trouble;
    outcome.seal = seal::shore_link::report(s.seal);
    return outcome;
}

void iridium_proxy::disk_trouble(const ise::failure& why) {
    auto& s = *state_;
    if (s.disk_trouble != why.message()) log().error("the database fails", {{"cause", why.message()}});
    s.disk_trouble = why.message();
}

} // namespace atirma
