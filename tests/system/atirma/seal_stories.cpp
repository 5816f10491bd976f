#include "gprs_sea.hpp"

#include <components/seal/boat_notice.hpp>
#include <components/seal/key_file.hpp>
#include <components/seal/shore_seal.hpp>

#include <support/catch.hpp>

#include <algorithm>

using namespace std::chrono_literals;
using namespace atirma;

namespace {

std::string key_text(int salt = 0) {
    seal::radio_key key;
    key.boat = "atirma";
    for (std::size_t i = 0; i < seal::key_size; ++i)
        key.secret[i] = static_cast<std::byte>(i + static_cast<std::size_t>(salt));
    return seal::format_key(key);
}

using sealed_answer = std::optional<ise::result<telecommand_reply>>;

void ask(sea& it, telecommand_request request, sealed_answer& into) {
    it.user([request, &into](ise::component& self) -> ise::task<> {
        auto proxy = sea::proxy(self);
        into = co_await proxy.try_call(services::telecommand, request, 30s);
    });
}

void use_key(sea& it, const std::string& at_boat, const std::string& ashore) {
    it.world.host("boat").write_file("radio.key", at_boat);
    it.world.host("shore").write_file("radio.key", ashore);
    if (!at_boat.empty()) it.boat_options.radio_key_file = "radio.key";
    if (!ashore.empty()) it.proxy_options.radio_key_file = "radio.key";
    it.boat_process().restart(); // both run since the sea was made
    if (!ashore.empty()) it.proxy_process().restart();
}

/// A modem ashore in the hands of somebody who sends bytes of his own to the boat, in place of the proxy.
class strange_modem {
public:
    explicit strange_modem(sea& it) {
        it.proxy_process().crash();
        it.world.host("shore").start_process("stranger", [this](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, sea::quiet());
            ise::component_options sends_only;
            sends_only.listens = false;
            node->start(
                "", [this](ise::component& self) { return run(self); }, sends_only);
            return node;
        });
    }

    bool ready() const { return port_ && port_->modem_ready(); }
    void send(ise::bytes raw) { port_->send(0x0013A20040000002, std::move(raw), 20s).value(); }

    std::function<void(const ise::bytes&)> on_packet;

private:
    ise::task<> run(ise::component& self) {
        xbee::port_options options;
        options.baud = 115200;
        port_ = std::make_unique<xbee::modem_port>(self.on(), self.log(), options);
        port_->on_event = [this](const xbee::client_event& event) {
            const auto* packet = std::get_if<xbee::packet_received>(&event);
            if (packet && on_packet) on_packet(packet->payload);
        };
        co_await port_->run();
    }

    std::unique_ptr<xbee::modem_port> port_;
};

ise::bytes mode_command(std::uint32_t id, sailing_mode mode, const sea& it) {
    telecommand made;
    made.id = id;
    made.sent_at = std::chrono::floor<std::chrono::milliseconds>(it.world.wall_start);
    made.command = commands::set_mode{mode};
    made.valid_for = 1h;
    return encode_telecommand(made);
}

} // namespace

TEST_CASE("atirma: over a sealed radio telemetry arrives, and the boat obeys a telecommand") {
    sea it;
    use_key(it, key_text(), key_text());
    auto& seen = it.watch();
    REQUIRE(it.until([&] { return seen.telemetry.size() >= 10; }));
    for (const auto& packet : seen.telemetry) CHECK(parse_telemetry(packet.raw));
    CHECK(seen.local->malformed == 0);
    sealed_answer answer;
    ask(it, set_mode(7, sailing_mode::hold), answer);
    REQUIRE(it.until([&] { return answer.has_value(); }));
    REQUIRE(*answer);
    CHECK((*answer)->state == telecommand_stage::acknowledged);
    CHECK(it.boat().pilot().mode() == sailing_mode::hold);
}

TEST_CASE("atirma: a boat with a key obeys no telecommand that is unsealed or sealed under another key") {
    for (const auto& ashore : {std::string(), key_text(1)}) {
        sea it;
        use_key(it, key_text(), ashore);
        auto& seen = it.watch();
        REQUIRE(it.until([&] { return seen.local && seen.local->modem_ready; }));
        REQUIRE(it.boat().pilot().mode() == sailing_mode::automatic);
        sealed_answer answer;
        ask(it, set_mode(7, sailing_mode::hold), answer);
        REQUIRE(it.until([&] { return answer.has_value(); }));
        CHECK(seen.local->telecommands_sent > 0);
        CHECK((!*answer || (*answer)->state == telecommand_stage::pending));
        CHECK(it.boat().pilot().mode() == sailing_mode::automatic);
        CHECK(seen.telemetry.empty()); // that of a boat with another key is none
    }
}

TEST_CASE("atirma: a boat with a key refuses injected and recorded packets, also after a loss of its memory") {
    sea it;
    use_key(it, key_text(), "");
    strange_modem modem(it);
    REQUIRE(it.until([&] { return modem.ready(); }));
    auto key = seal::parse_keys(key_text(), "key").value().now;
    key.link = name_of(link_id::xbee);
    seal::shore_seal shore(key, seal::lane::primary, {},
                           [](const seal::shore_counters&) { return ise::result<void>(); });
    std::size_t notices = 0, plain = 0;
    std::vector<std::uint32_t> obeyed;
    modem.on_packet = [&](const ise::bytes& raw) {
        if (!seal::is_sealed(raw)) ++plain;
        auto opened = shore.open(raw);
        if (!opened) return;
        if (opened->plain.empty()) ++notices;
        else if (auto ack = parse_acknowledgement(opened->plain)) obeyed.push_back(ack->id);
    };
    auto mode = [&] { return it.boat().pilot().mode(); };
    // A refused sealed packet shows in the notice that answers it.
    auto refused = [&](const ise::bytes& raw) {
        auto before = notices;
        modem.send(raw);
        return it.until([&] { return notices > before; });
    };

    REQUIRE(refused(shore.seal(mode_command(1, sailing_mode::hold, it)).value())); // of no session
    modem.send(mode_command(2, sailing_mode::hold, it));                           // not sealed
    auto good = shore.seal(mode_command(3, sailing_mode::hold, it)).value();
    it.world.run_for(10s);
    CHECK(mode() == sailing_mode::automatic);
    modem.send(good);
    REQUIRE(it.until([&] { return mode() == sailing_mode::hold; }));
    REQUIRE(it.until([&] { return !obeyed.empty(); }));
    modem.send(shore.seal(mode_command(4, sailing_mode::automatic, it)).value());
    REQUIRE(it.until([&] { return mode() == sailing_mode::automatic; }));
    CHECK(refused(good));
    CHECK(mode() == sailing_mode::automatic);

    it.boat_process().restart(); // the disks of this world go with their process: its counters are lost
    REQUIRE(it.until([&] { return it.boat_component().boat() != nullptr; }));
    auto lost = shore.seal(mode_command(5, sailing_mode::hold, it)).value();
    it.world.run_for(15s); // its first notice was heard
    CHECK(refused(good));
    CHECK(refused(lost));
    CHECK(mode() == sailing_mode::automatic);
    modem.send(shore.seal(mode_command(6, sailing_mode::hold, it)).value());
    REQUIRE(it.until([&] { return mode() == sailing_mode::hold; }));
    CHECK(obeyed.front() == 3);
    CHECK(std::ranges::none_of(obeyed, [](auto id) { return id == 1 || id == 2 || id == 5; }));
    CHECK(plain == 0);
}

TEST_CASE("atirma gprs: over a sealed call telemetry arrives and the boat obeys, unsealed it does not") {
    for (const auto& protocol : {std::string("tcp"), std::string("udp")})
        for (const auto& ashore : {key_text(), std::string(), key_text(1)}) {
            INFO(protocol << " " << ashore.size());
            gprs_sea it(protocol);
            it.world.host("boat").write_file("radio.key", key_text());
            it.world.host("shore").write_file("gprs.key", ashore);
            it.boat_options.radio_key_file = "radio.key";
            if (!ashore.empty()) it.gprs_options.radio_key_file = "gprs.key";
            it.boat_process().restart();
            it.gprs_process().restart();
            auto& seen = it.watch_gprs();
            gprs_sea::asked answer;
            REQUIRE(it.until([&] { return seen.state.has_value(); }));
            it.world.run_for(20s);
            it.command(set_mode(7, sailing_mode::hold), 30s, answer);
            REQUIRE(it.until([&] { return answer.has_value(); }));
            bool same = ashore == key_text();
            bool obeyed = *answer && (*answer)->state == telecommand_stage::acknowledged;
            CHECK(obeyed == same);
            CHECK((it.boat().pilot().mode() == sailing_mode::hold) == same);
            CHECK(seen.telemetry.empty() == !same);
        }
}
