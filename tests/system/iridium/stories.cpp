#include "ocean.hpp"

#include <components/iridium/rockblock.hpp>
#include <components/iridium_proxy/sbd_store.hpp>
#include <ise/http/stream_http_client.hpp>

#include <support/catch.hpp>
#include <support/damaged_file.hpp>

#include <set>

using namespace std::chrono_literals;
using namespace atirma;

namespace {

telecommand_request set_mode(std::uint32_t id, sailing_mode mode, float valid_s = 20'000) {
    telecommand_request request;
    request.id = id;
    request.command = commands::set_mode{mode};
    request.valid_s = valid_s;
    return request;
}

bool is_decided(const ocean::watched& seen, std::uint32_t id, telecommand_stage as) {
    for (const auto& state : seen.states)
        if (state.id == id && state.state == as) return true;
    return false;
}

std::set<std::pair<int, std::uint32_t>> numbers(const std::vector<telemetry_packet>& packets) {
    std::set<std::pair<int, std::uint32_t>> all;
    for (const auto& packet : packets) all.emplace(packet.boot, packet.sequence);
    return all;
}

std::int64_t kept(ocean& it) {
    auto rows = it.disk().query("SELECT count(*) FROM mo");
    return rows ? rows->at(0).integer(0) : 0;
}

iridium_gateway_request gateway_up(bool up) {
    iridium_gateway_request request;
    request.up = up;
    return request;
}

/// One post to the proxy, as the gateway makes it.
void post(ocean& it, const iridium::mo_delivery& what, std::optional<ise::result<ise::http_answer>>& into) {
    it.user([body = iridium::encode_mo_form(what), &into](ise::component& self) -> ise::task<> {
        ise::stream_http_client client(self.on());
        ise::http_exchange request;
        request.method = "POST";
        request.url = "http://shore:7480/rockblock/mo";
        request.body = body;
        into = co_await client.exchange(std::move(request), 3s);
    });
}

iridium::mo_delivery delivery(const ocean& it, std::uint32_t sequence) {
    iridium::mo_delivery made;
    made.message.imei = it.proxy_options.imei;
    made.message.momsn = static_cast<std::uint16_t>(sequence);
    made.message.session_time = std::chrono::sys_seconds(std::chrono::seconds(1'700'000'000 + sequence));
    packet_header header;
    header.boot = 9;
    header.sequence = sequence;
    header.measured_at = utc_time(1'500'000'000'000ms) + std::chrono::seconds(sequence);
    location fix;
    fix.latitude_deg = 28.15;
    fix.quality = fix_quality::gps;
    made.message.data = encode_telemetry(header, fix);
    return made;
}

/// No boat: what comes to the proxy is the test's own.
void without_boat(ocean& it) { it.boat_options.iridium.port.device.clear(); }

} // namespace

TEST_CASE("iridium: telemetry comes from the boat through modem, gateway and web hook, each packet once") {
    ocean it;
    it.gateway_options.duplicates = 0.5;
    it.gateway_options.session_failures = 0.3;
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 40; }, 5h));
    CHECK(numbers(seen.telemetry).size() == seen.telemetry.size());
    std::set<std::string> types;
    for (const auto& packet : seen.telemetry) {
        CHECK(packet.link == link_id::iridium);
        auto message = parse_telemetry(packet.raw);
        REQUIRE(message);
        types.insert(std::string(name_of(message->body)));
    }
    CHECK(types.contains("location"));
    CHECK(types.contains("navigation"));
    REQUIRE(seen.account);
    CHECK(seen.account->duplicate_messages > 0);
    CHECK(seen.account->today.mo_messages == seen.account->messages);
    CHECK(seen.account->today.mo_credits >= seen.account->messages);
    CHECK(seen.account->estimate_cep_km == 5);
    CHECK(seen.account->trouble.empty());
    CHECK(seen.gateway->sessions_failed > 0);
}

TEST_CASE("iridium: a telecommand is followed from the queue over the gateway to the boat's acknowledgement") {
    ocean it;
    it.boat_options.iridium.period_s = 0; // nothing but the ring alert makes it open a session
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.sky && seen.sky->port_in_use && seen.account; }));
    ocean::asked answer;
    it.command(set_mode(7, sailing_mode::hold), 5min, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    CHECK((*answer)->result == ack_code::done);
    CHECK((*answer)->text == "hold");
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    REQUIRE(it.until([&] { return is_decided(seen, 7, telecommand_stage::acknowledged); }));
    std::vector<telecommand_stage> stages;
    bool at_gateway = false;
    for (const auto& state : seen.states) {
        stages.push_back(state.state);
        at_gateway = at_gateway || state.text.find("queued at the gateway as ") == 0;
    }
    CHECK(at_gateway);
    CHECK(std::is_sorted(stages.begin(), stages.end()));
    CHECK(seen.sky->rings >= 1);
    it.world.run_for(6s);
    CHECK(seen.account->today.mt_messages == 1);
    CHECK(seen.account->today.mt_credits == 1);
    CHECK(seen.account->queue.empty());
}

TEST_CASE("iridium: a gateway that is down for hours costs no telecommand and no telemetry that still counts") {
    ocean it;
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 2; }));
    it.set_gateway(gateway_up(false));
    ocean::asked answer;
    it.command(set_mode(8, sailing_mode::station_keep), 20s, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::pending);
    it.world.run_for(3h);
    auto before = seen.telemetry.size();
    CHECK_FALSE(is_decided(seen, 8, telecommand_stage::acknowledged));
    CHECK_FALSE(seen.account->trouble.empty());
    REQUIRE(seen.account->queue.size() == 1);
    CHECK(seen.account->queue[0].stage == link_stage::waiting);
    it.set_gateway(gateway_up(true));
    REQUIRE(it.until([&] { return is_decided(seen, 8, telecommand_stage::acknowledged); }, 1h));
    CHECK(it.boat().pilot().mode() == sailing_mode::station_keep);
    REQUIRE(it.until([&] { return seen.telemetry.size() > before; }));
    CHECK(numbers(seen.telemetry).size() == seen.telemetry.size());
}

TEST_CASE("iridium: a proxy that dies between the disk and the 200 loses nothing and shows nothing twice") {
    ocean it;
    without_boat(it);
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.account.has_value(); }));
    std::optional<ise::result<ise::http_answer>> first, again;
    post(it, delivery(it, 1), first);
    REQUIRE(it.until([&] { return kept(it) == 1; }));
    it.world.net().partition("console", "shore"); // the 200 is on its way at most
    it.proxy_process().crash();                   // in the very turn that kept it: nothing was published
    REQUIRE(it.until([&] { return first.has_value(); }));
    CHECK_FALSE(*first);
    it.world.run_for(10s);
    it.world.net().heal("console", "shore");
    CHECK(seen.telemetry.empty());
    it.proxy_process().restart();
    REQUIRE(it.until([&] { return seen.telemetry.size() == 1; }));
    post(it, delivery(it, 1), again);
    REQUIRE(it.until([&] { return again.has_value(); }));
    REQUIRE(*again);
    CHECK((*again)->status == 200);
    it.world.run_for(1min);
    CHECK(seen.telemetry.size() == 1);
    CHECK(kept(it) == 1);
    CHECK(seen.account->duplicate_messages == 1);
}

TEST_CASE("iridium: what came while nobody listened waits on disk for the first who does") {
    ocean it;
    without_boat(it);
    it.start();
    auto& seen = it.watch(false);
    std::optional<ise::result<ise::http_answer>> answers[3];
    for (std::uint32_t i = 0; i < 3; ++i) {
        post(it, delivery(it, 3 - i), answers[i]); // the newest first
        REQUIRE(it.until([&] { return answers[i].has_value(); }));
    }
    REQUIRE(it.until([&] { return seen.account && seen.account->waiting_for_subscriber == 3; }));
    it.proxy_process().restart();
    auto& later = it.watch();
    REQUIRE(it.until([&] { return later.telemetry.size() == 3; }));
    CHECK(later.telemetry[0].sequence == 3);
    CHECK_FALSE(later.telemetry[0].history);
    CHECK(later.telemetry[1].history); // never the current position
    CHECK(later.telemetry[2].history);
    REQUIRE(it.until([&] { return seen.account->waiting_for_subscriber == 0; }));
}

TEST_CASE("iridium: a telecommand's validity ends in time where the clock goes back, also over a restart") {
    for (bool restarts : {true, false}) {
        ocean it;
        it.start();
        auto& seen = it.watch();
        REQUIRE(it.until([&] { return seen.telemetry.size() >= 2; }));
        it.set_gateway(gateway_up(false));
        ocean::asked asked;
        auto request = set_mode(21, sailing_mode::hold);
        request.valid_s = 15;
        it.command(request, 5s, asked);
        REQUIRE(it.until([&] { return asked.has_value(); }));
        if (restarts) it.proxy_process().crash();
        it.proxy_process().set_wall_offset(-1h);
        it.world.run_for(10s);
        if (restarts) it.proxy_process().restart();
        it.set_gateway(gateway_up(true));
        it.world.run_for(12s);
        std::optional<followed_telecommands> known;
        it.user([&known](ise::component& self) -> ise::task<> {
            auto shore = ocean::proxy(self);
            follow_telecommand one;
            one.id = 21;
            auto states = co_await shore.subscribe(services::telecommand_state, one, ise::subscribe_options());
            known = states.response();
        });
        REQUIRE(it.until([&] { return known.has_value(); }));
        REQUIRE(known->now.size() == 1);
        CHECK(known->now[0].state == telecommand_stage::expired);
    }
}

TEST_CASE("iridium: a shore clock that was once ahead makes no validity longer") {
    ocean it;
    it.boat_options.iridium.period_s = 0; // nothing of the boat comes first, by which its clock were known
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.sky && seen.sky->port_in_use && seen.account; }));
    it.set_gateway(gateway_up(false));
    it.proxy_process().set_wall_offset(1h);
    ocean::asked ahead, asked;
    it.command(set_mode(21, sailing_mode::return_home, 10), 5s, ahead);
    REQUIRE(it.until([&] { return ahead.has_value(); }));
    it.proxy_process().crash();
    it.proxy_process().set_wall_offset(0s);
    it.world.run_for(10s);
    it.proxy_process().restart();
    it.set_gateway(gateway_up(true));
    iridium_sky_request sky;
    sky.free = false;
    it.set_sky(sky);
    it.command(set_mode(22, sailing_mode::hold, 60), 10s, asked);
    REQUIRE(it.until([&] { return asked.has_value(); }));
    REQUIRE(*asked);
    CHECK((*asked)->text.find("queued at the gateway") == 0);
    auto received = seen.sky->messages_received;
    it.world.run_for(5min);
    sky.free = true;
    it.set_sky(sky);
    REQUIRE(it.until([&] { return seen.sky->messages_received > received; }, 3h));
    it.world.run_for(1min);
    CHECK(it.boat().pilot().mode() == sailing_mode::automatic);
    CHECK(it.boat().late_count() == 1);
}

TEST_CASE("iridium: the queue survives a restart of the proxy, and who follows it hears on") {
    ocean it;
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 2; }));
    it.set_gateway(gateway_up(false));
    ocean::asked a, b;
    it.command(set_mode(21, sailing_mode::hold), 5s, a);
    it.command(set_mode(22, sailing_mode::return_home), 5s, b);
    REQUIRE(it.until([&] { return a && b; }));
    it.proxy_process().crash();
    it.world.run_for(10min);
    it.proxy_process().restart();
    std::optional<followed_telecommands> open;
    it.user([&open](ise::component& self) -> ise::task<> {
        auto shore = ocean::proxy(self);
        auto states = co_await shore.subscribe(services::telecommand_state);
        open = states.response();
    });
    REQUIRE(it.until([&] { return open.has_value(); }));
    REQUIRE(open->now.size() == 2);
    CHECK(open->now[0].id == 21);
    it.set_gateway(gateway_up(true));
    REQUIRE(it.until(
        [&] {
            return is_decided(seen, 21, telecommand_stage::acknowledged) &&
                   is_decided(seen, 22, telecommand_stage::acknowledged);
        },
        2h));
    CHECK(it.boat().pilot().mode() == sailing_mode::return_home); // in their order
    ocean::asked again;
    it.command(set_mode(21, sailing_mode::hold), 5s, again);
    REQUIRE(it.until([&] { return again.has_value(); }));
    CHECK((*again)->state == telecommand_stage::acknowledged);
    CHECK(it.boat().pilot().mode() == sailing_mode::return_home); // it was not done a second time
}

TEST_CASE("iridium: a daily budget that is spent holds telecommands until midnight UTC") {
    ocean it;
    it.proxy_options.daily_budget = 2;
    it.world.wall_start += 14h; // 22:00
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 2; }));
    ocean::asked answers[3];
    for (std::uint32_t i = 0; i < 3; ++i) {
        auto request = set_mode(31 + i, sailing_mode::hold, 80'000);
        request.command = commands::waypoint_add{{28.16, -15.45}}; // none replaces another
        it.command(request, 5s, answers[i]);
    }
    REQUIRE(it.until(
        [&] {
            return is_decided(seen, 31, telecommand_stage::acknowledged) &&
                   is_decided(seen, 32, telecommand_stage::acknowledged);
        },
        1h));
    it.world.run_for(1min);
    CHECK(seen.account->budget_left == 0);
    REQUIRE(seen.account->queue.size() == 1);
    CHECK(seen.account->queue[0].text.find("budget") != std::string::npos);
    CHECK(seen.gateway->mt_messages == 2);
    REQUIRE(it.until([&] { return is_decided(seen, 33, telecommand_stage::acknowledged); }, 4h));
    CHECK(it.world.elapsed() > 2h);
    CHECK(seen.account->today.mt_credits == 1);
}

TEST_CASE("iridium: each refusal of the gateway fails its telecommand at once, in its own words, and costs nothing") {
    ocean it;
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 2; }));
    std::set<std::string> words;
    for (int code : {10, 11, 12, 13, 14, 15, 16}) {
        iridium_gateway_request failing;
        failing.fail_mt = code;
        it.set_gateway(failing);
        ocean::asked answer;
        it.command(set_mode(static_cast<std::uint32_t>(100 + code), sailing_mode::hold), 30s, answer);
        REQUIRE(it.until([&] { return answer.has_value(); }));
        REQUIRE(*answer);
        CHECK((*answer)->state == telecommand_stage::failed);
        CHECK((*answer)->text.find("FAILED " + std::to_string(code)) != std::string::npos);
        words.insert((*answer)->text);
    }
    CHECK(words.size() == 7);
    it.world.run_for(10min);
    CHECK(seen.gateway->mt_refused == 7); // none was tried again
    CHECK(seen.account->today.mt_credits == 0);
    // 99 passes by itself.
    iridium_gateway_request failing;
    failing.fail_mt = 99;
    it.set_gateway(failing);
    ocean::asked answer;
    it.command(set_mode(199, sailing_mode::hold), 1h, answer);
    it.world.run_for(2min);
    CHECK_FALSE(answer);
    CHECK(seen.gateway->mt_refused > 8);
    CHECK(seen.account->trouble.find("99") != std::string::npos);
    failing.fail_mt = 0;
    it.set_gateway(failing);
    REQUIRE(it.until([&] { return answer.has_value(); }, 1h));
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    CHECK(seen.account->trouble.empty());
}

TEST_CASE("iridium: under a blocked sky the boat gives telemetry up and keeps what it owes") {
    ocean it;
    it.boat_options.iridium.period_s = 90;
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 2; }, 1h));
    ocean::asked answer;
    it.command(set_mode(41, sailing_mode::hold), 5s, answer);
    REQUIRE(it.until([&] { return seen.sky->messages_received == 1; }, 1h));
    iridium_sky_request sky;
    sky.free = false;
    it.set_sky(sky); // the acknowledgement is under way
    auto before = seen.telemetry.size();
    it.world.run_for(1h);
    CHECK(seen.telemetry.size() == before);
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
    CHECK_FALSE(is_decided(seen, 41, telecommand_stage::acknowledged));
    sky.free = true;
    it.set_sky(sky);
    REQUIRE(it.until(
        [&] { return is_decided(seen, 41, telecommand_stage::acknowledged) && seen.telemetry.size() > before; }, 1h));
    // What it says now is of now.
    REQUIRE(it.until([&] { return seen.telemetry.back().received_at - seen.telemetry.back().measured_at < 6min; }, 1h));
}

TEST_CASE("iridium: DirectIP carries both directions, and tells when a telecommand was delivered") {
    ocean it;
    it.gateway_options.post_to.clear();
    it.gateway_options.directip_to = "tcp://shore:10800";
    it.gateway_options.directip_listen = "tcp://0.0.0.0:10801";
    it.proxy_options.webhook.clear();
    it.proxy_options.directip = "tcp://0.0.0.0:10800";
    it.proxy_options.send_by = "directip";
    it.proxy_options.send_directip = "tcp://gateway:10801";
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 4; }, 1h));
    ocean::asked answer;
    it.command(set_mode(51, sailing_mode::hold), 1h, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }, 1h));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    bool delivered = false;
    for (const auto& state : seen.states) delivered = delivered || state.text == "delivered to the boat's modem";
    CHECK(delivered);
}

TEST_CASE("iridium: mail carries both directions, over a mail server that fails for an hour") {
    ocean it;
    it.gateway_options.post_to.clear();
    it.gateway_options.listen.clear();
    it.gateway_options.mail_to = "boat@shore.example";
    it.gateway_options.make_mail_sender = [&](ise::loop& on) { return it.mails.open_sender(on); };
    it.gateway_options.open_mailbox = [&](ise::loop& on) { return it.mails.open_mailbox(on, "data@sbd.iridium.com"); };
    it.proxy_options.webhook.clear();
    it.proxy_options.open_mailbox = [&](ise::loop& on) { return it.mails.open_mailbox(on, "boat@shore.example"); };
    it.proxy_options.mail_unchecked = true; // the server in memory authenticates nobody
    it.proxy_options.make_mail_sender = [&](ise::loop& on) { return it.mails.open_sender(on); };
    it.proxy_options.mail_from = "boat@shore.example";
    it.proxy_options.send_by = "mail";
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 4; }, 1h));
    ocean::asked answer;
    it.command(set_mode(61, sailing_mode::hold), 1h, answer);
    REQUIRE(it.until([&] { return answer.has_value(); }, 1h));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    bool queued = false;
    for (const auto& state : seen.states) queued = queued || state.text.find("queued at the gateway as ") == 0;
    CHECK(queued); // the disposition mail said so
    it.mails.options.reachable = false;
    ocean::asked late;
    it.command(set_mode(62, sailing_mode::return_home), 5s, late);
    it.world.run_for(1h);
    CHECK(seen.account->trouble.find("mailbox") != std::string::npos);
    it.mails.options.reachable = true;
    REQUIRE(it.until([&] { return is_decided(seen, 62, telecommand_stage::acknowledged); }, 2h));
    CHECK(numbers(seen.telemetry).size() == seen.telemetry.size());
}

TEST_CASE("iridium: the proxy says which option makes no sense, before it listens") {
    auto failure_of = [](auto change) {
        ocean it;
        change(it.proxy_options);
        std::string failure;
        it.world.host("shore").start_process("proxy", [&](ise::sim::process& here) -> std::shared_ptr<void> {
            ise::node_options options;
            options.use_names = false;
            options.log = {};
            auto node = std::make_shared<ise::node>(here, options);
            ise::component_options silent;
            silent.listens = false;
            node->start<iridium_proxy>("atirma/shore/iridium", silent, it.proxy_options);
            it.world.after(1s, [&failure, node = node.get()] {
                for (const auto& report : node->reports()) failure = report.failure;
            });
            return node;
        });
        it.world.run_for(2s);
        return failure;
    };
    CHECK(failure_of([](auto& o) { o.imei = "17"; }).find("15 digits") != std::string::npos);
    CHECK(failure_of([](auto& o) { o.webhook.clear(); }).find("--webhook") != std::string::npos);
    CHECK(failure_of([](auto& o) { o.send_by = "pigeon"; }).find("pigeon") != std::string::npos);
    CHECK(failure_of([](auto& o) { o.jwt_key_file = "/no/such.pem"; }).find("/no/such.pem") != std::string::npos);
    CHECK(failure_of([](auto& o) { o.send_by = "directip"; }).find("--send-directip") != std::string::npos);
    CHECK(failure_of([](auto& o) { o.send_by = "mail"; }).find("--mail-from") != std::string::npos);
    CHECK(failure_of([](auto& o) { o.gateway_addresses = "gateway"; }).find("'gateway'") != std::string::npos);
    CHECK(failure_of([](auto&) {}).empty());
}

TEST_CASE("iridium: beyond loopback the proxy demands what tells the gateway from others") {
    auto problem = [](auto change) {
        iridium_proxy_options options;
        options.imei = "300234010753370";
        options.database = "memory:who-is-the-gateway";
        options.webhook = "tcp://0.0.0.0:7480";
        change(options);
        ise::sim::world world;
        std::string failure;
        world.host("shore").start_process("proxy", [&](ise::sim::process& here) -> std::shared_ptr<void> {
            ise::node_options nameless;
            nameless.use_names = false;
            nameless.log = {};
            auto node = std::make_shared<ise::node>(here, nameless);
            ise::component_options silent;
            silent.listens = false;
            node->start<iridium_proxy>("atirma/shore/iridium", silent, options);
            world.after(1s, [&failure, node = node.get()] {
                for (const auto& report : node->reports()) failure = report.failure;
            });
            return node;
        });
        world.run_for(2s);
        return failure;
    };
    CHECK(problem([](auto&) {}).find("--jwt-key") != std::string::npos);
    CHECK(problem([](auto& o) { o.webhook = "tcp://127.0.0.1:7480"; }).empty());
    CHECK(problem([](auto& o) { o.gateway_addresses = "10.0.0.0/8, 2001:db8::/32, 192.0.2.1"; }).empty());
    CHECK(problem([](auto& o) {
              o.webhook = "tcp://127.0.0.1:7480", o.directip = "tcp://0.0.0.0:10800";
          }).find("--gateway-addresses") != std::string::npos);
    memory_mail mails;
    auto with_mailbox = [&](auto change) {
        return problem([&](auto& o) {
            o.webhook.clear();
            o.open_mailbox = [&](ise::loop& on) { return mails.open_mailbox(on, "boat@shore.example"); };
            change(o);
        });
    };
    CHECK(with_mailbox([](auto&) {}).find("--mail-authserv") != std::string::npos);
    CHECK(with_mailbox([](auto& o) { o.mail_authserv = "mx.shore.example"; }).empty());
    CHECK(with_mailbox([](auto& o) { o.mail_unchecked = true; }).empty());
}

TEST_CASE("iridium: posts and DirectIP from another address than the gateway's count for nothing") {
    ocean it;
    it.gateway_options.directip_to = "tcp://shore:10800";
    it.proxy_options.directip = "tcp://0.0.0.0:10800";
    it.proxy_options.gateway_addresses = "192.0.2.0/24";
    it.start();
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.account && seen.account->refused >= 3; }));
    CHECK(seen.telemetry.empty());
    CHECK(seen.account->messages == 0);
    CHECK(seen.gateway->trouble.find("403") != std::string::npos);
}

TEST_CASE("iridium: a proxy whose file is no database sets it aside, says so, and keeps what comes in a new one") {
    damaged_file::folder disk("iridium-proxy");
    damaged_file::write_garbage(disk.file());
    ocean it;
    it.proxy_options.database = disk.file();
    it.start();
    it.world.run_for(5s);
    std::optional<ise::result<ise::http_answer>> answer;
    post(it, delivery(it, 1), answer);
    REQUIRE(it.world.run_until([&] { return answer.has_value(); }, 30s));
    REQUIRE(*answer);
    CHECK((*answer)->status == 200);
    auto aside = disk.set_aside();
    REQUIRE(aside.size() == 1);
    CHECK_THAT(it.log.errors, ise_test::Contains(aside.front()));
    auto kept = ise::database::open_to_read(disk.file()).value().query("SELECT count(*) FROM mo").value();
    CHECK(kept.at(0).integer(0) == 1);
}

TEST_CASE("iridium: a proxy whose file has a damaged page keeps all that can still be read") {
    damaged_file::folder disk("iridium-proxy");
    {
        auto store = sbd_store::open(disk.file()).value();
        for (std::uint16_t i = 1; i <= 100; ++i) {
            iridium::mo_message message;
            message.imei = "300434060000001";
            message.momsn = i;
            message.session_time = std::chrono::sys_seconds(std::chrono::seconds(1'700'001'000 + i));
            message.data.assign(100, std::byte{static_cast<unsigned char>(i < 40 || i > 60 ? 0xcd : 0xab)});
            REQUIRE(store.add(message, "directip", message.session_time, 2).value());
        }
    }
    damaged_file::overwrite_pages_with(disk.file(), std::vector<std::byte>(100, std::byte{0xab}));
    ocean it;
    it.proxy_options.database = disk.file();
    it.start();
    auto& seen = it.watch();
    std::optional<ise::result<ise::http_answer>> answer;
    it.world.run_for(10s);
    post(it, delivery(it, 1), answer);
    CHECK(it.world.run_until([&] { return answer && *answer && (*answer)->status == 200; }, 30s));
    REQUIRE(disk.set_aside().size() == 1);
    CHECK_THAT(it.log.errors, ise_test::Contains(disk.set_aside().front()));
    // What was spent.
    CHECK(it.world.run_until([&] { return seen.account && seen.account->ever.mo_messages > 100; }, 2min));
    auto db = ise::database::open_to_read(disk.file()).value();
    CHECK(db.query("SELECT count(*) FROM mo WHERE substr(data, 1, 1) = x'cd'").value().at(0).integer(0) > 10);
}
