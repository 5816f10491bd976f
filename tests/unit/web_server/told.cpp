// What the page's component tells of the newest fix: over HTTP, and where a fix is the Iridium gateway's guess.
#include <components/iridium_proxy/services.hpp>
#include <components/web_server/web_component.hpp>

#include <ise/component/health.hpp>
#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/database/database.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>
#include <support/damaged_file.hpp>

#include <asio/ip/tcp.hpp>
#include <nlohmann/json.hpp>

#include <future>
#include <sqlite3.h>
#include <sstream>

namespace told_test {

using namespace std::chrono_literals;
using namespace atirma;

namespace {

ise::node_options nameless() {
    ise::node_options options;
    options.use_names = false;
    options.log = ise::log_sink();
    return options;
}

ise::component_options without_endpoint() {
    ise::component_options options;
    options.listens = false;
    return options;
}

nlohmann::json get(const std::string& port, const std::string& path) {
    asio::ip::tcp::iostream page("127.0.0.1", port);
    page << "GET " << path << " HTTP/1.1\r\nHost: test\r\nConnection: close\r\n\r\n" << std::flush;
    std::stringstream all;
    all << page.rdbuf();
    auto answer = all.str();
    return nlohmann::json::parse(answer.substr(answer.find("\r\n\r\n") + 4));
}

/// Publishes telemetry and offers nothing else, as the XBee proxy for whom only follows it.
class telemetry_alone final : public ise::component {
    ise::task<> run() override {
        auto packets = publish(services::telemetry);
        telemetry_packet packet;
        packet.boot = 3;
        packet.measured_at = std::chrono::floor<std::chrono::milliseconds>(wall());
        packet.received_at = packet.measured_at;
        location fix;
        fix.latitude_deg = 28.1;
        fix.longitude_deg = -15.4;
        fix.quality = fix_quality::gps;
        for (;;) {
            packet.raw = encode_telemetry({3, ++packet.sequence, packet.measured_at}, fix);
            packets(packet);
            co_await sleep(1s);
        }
    }
};

/// Keeps twenty packets, as a communication node: whoever asks with a position gets what follows it.
class node_alone final : public ise::component {
public:
    static constexpr std::uint64_t kept = 20;

private:
    ise::task<> run() override {
        auto packets = publish(services::telemetry);
        provide(services::track, [this](const track_request& request) { return page_after(request); });
        co_await sleep(24h);
    }
    track_page page_after(const track_request& request) {
        track_page made;
        auto known = request.seen.find(77);
        auto after = known == request.seen.end() ? std::uint64_t{0} : known->second;
        if (begin_ == utc_time()) begin_ = std::chrono::floor<std::chrono::milliseconds>(wall()) - 1h;
        for (auto position = after + 1; position <= kept; ++position) {
            telemetry_packet packet;
            packet.store = 77;
            packet.position = position;
            packet.boot = 3;
            packet.sequence = static_cast<std::uint32_t>(position);
            packet.measured_at = begin_ + std::chrono::seconds(position);
            packet.received_at = packet.measured_at;
            location fix;
            fix.latitude_deg = 28.1 + 0.001 * static_cast<double>(position);
            fix.longitude_deg = -15.4;
            fix.quality = fix_quality::gps;
            packet.raw = encode_telemetry({3, packet.sequence, packet.measured_at}, fix);
            made.packets.push_back(std::move(packet));
        }
        made.seen[77] = kept;
        return made;
    }
    utc_time begin_{};
};

/// Tells of one session of the boat, as the Iridium proxy does.
class proxy_alone final : public ise::component {
public:
    explicit proxy_alone(utc_time session) : session_(session) {}

private:
    ise::task<> run() override {
        auto accounts = publish(services::iridium_account);
        iridium_account account;
        account.last_session_at = session_ + 5min; // of the main modem, without a position
        account.estimate_at = session_;
        account.estimate = waypoint{28.1, -15.4};
        account.estimate_cep_km = 4;
        accounts(account);
        co_await sleep(24h);
    }
    utc_time session_;
};

/// A page of the virtual world that follows one provider.
struct followed {
    template <class Provider, class... Given>
    Provider& provide(const std::string& path, Given... given) {
        Provider* started = nullptr;
        world.host("shore").start_process("proxy", [&](ise::sim::process& here) -> std::shared_ptr<void> {
            auto node = std::make_shared<ise::node>(here, nameless());
            ise::component_options where;
            where.listen = {ise::endpoint::parse("tcp://0.0.0.0:7411").value()};
            started = &node->start<Provider>(path, where, given...);
            return node;
        });
        return *started;
    }
    /// Until it knows where the boat is.
    web_server& follow() {
        web_server* page = nullptr;
        page_process = &world.host("page").start_process("page", [&](ise::sim::process& here) -> std::shared_ptr<void> {
            web_server_options options;
            options.telemetry = {"tcp://shore:7411"};
            options.archive.file = archive;
            auto terms = nameless();
            terms.log = log.sink();
            auto node = std::make_shared<ise::node>(here, terms);
            page = &node->start<web_server>("atirma/page", without_endpoint(), options);
            return node;
        });
        REQUIRE(world.run_until([&] { return page->state().position().has_value(); }, 1min));
        return *page;
    }
    /// Rows of the archive, as another program sees them; -1 where it cannot be read.
    std::int64_t archived(const std::string& table) const {
        auto db = ise::database::open_to_read(archive);
        if (!db) return -1;
        auto rows = db->query("SELECT count(*) FROM " + table);
        return rows ? rows->at(0).integer(0) : -1;
    }
    bool has_all() const {
        auto all = static_cast<std::int64_t>(node_alone::kept);
        return archived("telemetry") == all && archived("fix") == all;
    }

    std::string archive; ///< the page's; empty: none
    damaged_file::log_lines log;
    ise::sim::world world;
    ise::sim::process* page_process = nullptr;
};

} // namespace

TEST_CASE("page: boats.json and the status name the link that the newest fix came by") {
    web_server_options options;
    options.track.boat = "Vela";
    options.archive.file = "memory:page-told";
    options.http.port = 0;
    auto disk = ise::database::open(options.archive.file, {}).value(); // lives as long as this
    auto measured = std::chrono::floor<std::chrono::milliseconds>(std::chrono::system_clock::now()) - 20s;
    {
        auto archive = track_archive::open(options.archive).value();
        REQUIRE(archive->enter("vela", "Vela"));
        for (auto [sequence, link] : {std::pair{1u, link_id::xbee}, {2u, link_id::gprs}}) {
            telemetry_packet packet;
            packet.link = link;
            packet.boot = 3;
            packet.sequence = sequence;
            packet.measured_at = measured + std::chrono::seconds(sequence);
            packet.received_at = packet.measured_at + 1s;
            location fix;
            fix.latitude_deg = 28.1;
            fix.longitude_deg = -15.4;
            fix.quality = fix_quality::gps;
            packet.raw = encode_telemetry({3, sequence, packet.measured_at}, fix);
            archive->keep("vela", packet, "location");
        }
        REQUIRE(archive->commit(measured));
    }
    std::promise<std::string> listening;
    options.on_listening = [&](const std::string& url) { listening.set_value(url); };
    ise::real_environment env;
    ise::node node(env, nameless());
    node.start<web_server>("atirma/page", without_endpoint(), options);
    auto url = listening.get_future().get();
    auto port = std::to_string(std::stoul(url.substr(url.rfind(':') + 1)));
    auto fleet = get(port, "/boats.json");
    CHECK(fleet["boats"][0]["position"]["link"] == "gprs");
    auto status = get(port, "/api/status");
    CHECK(status["position"]["link"] == "gprs");
    CHECK(status["boats"]["vela"]["position"]["link"] == "gprs");
}

TEST_CASE("page: an address that is a name is refused, and the error says what to give") {
    std::string failure;
    ise::sim::world world;
    world.host("page").start_process("page", [&](ise::sim::process& here) -> std::shared_ptr<void> {
        web_server_options options;
        options.http.address = "localhost";
        auto node = std::make_shared<ise::node>(here, nameless());
        node->start<web_server>("atirma/page", without_endpoint(), options);
        world.after(1s, [&failure, node = node.get()] {
            for (const auto& report : node->reports()) failure = report.failure;
        });
        return node;
    });
    world.run_for(2s);
    CHECK_THAT(failure,
               ise_test::Contains("\"localhost\" is not a numeric IP address") && ise_test::Contains("--address"));
}

TEST_CASE("page: where the Iridium gateway believes the boat to be is no history, and dates from the session") {
    followed at;
    auto session = std::chrono::floor<std::chrono::milliseconds>(at.world.wall_start) - 600s;
    at.provide<proxy_alone>("atirma/shore/iridium", session);
    auto& page = at.follow();
    const auto& from = page.state().position()->from;
    CHECK_FALSE(from.history);
    CHECK(from.source == "iridium");
    CHECK(from.measured_at == session);
    CHECK(from.received_at == session);
    // And so the page does not say that the boat was heard just now.
    auto result = page.state().snapshot(session + 600s).data;
    auto state = nlohmann::json::parse(result)["state"];
    CHECK(state["position"]["history"] == false);
    CHECK(state["heard"]["iridium"] == session.time_since_epoch().count());
}

TEST_CASE("page: a proxy is asked what it provides, and refuses nothing") {
    followed at;
    auto& proxy = at.provide<telemetry_alone>("atirma/shore/xbee");
    at.follow();
    at.world.run_for(1min);
    auto now = ise::health_of(proxy.services());
    CHECK(now.calls_served > 0);
    CHECK(now.calls_refused == 0);
}

TEST_CASE("page: an archive that is no database is set aside, and filled again from the communication nodes") {
    damaged_file::folder disk("page-archive");
    damaged_file::write_garbage(disk.file());
    followed at;
    at.archive = disk.file();
    at.provide<node_alone>("atirma/communication");
    at.follow();
    CHECK(at.world.run_until([&] { return at.has_all(); }, 1min));
    auto aside = disk.set_aside();
    REQUIRE(aside.size() == 1);
    CHECK_THAT(at.log.errors, ise_test::Contains(aside.front()));
}

TEST_CASE("page: an archive with a damaged page is set aside when the page meets it, and filled again") {
    damaged_file::folder disk("page-archive");
    followed at;
    at.archive = disk.file();
    at.provide<node_alone>("atirma/communication");
    SECTION("at its start") {
        at.follow();
        REQUIRE(at.world.run_until([&] { return at.has_all(); }, 1min));
        at.page_process->crash();
        at.world.run_for(1s);
        damaged_file::overwrite_pages_with(disk.file(), "location");
        at.follow();
    }
    SECTION("while it runs") {
        at.follow();
        REQUIRE(at.world.run_until([&] { return at.has_all(); }, 1min));
        sqlite3* other = nullptr;
        REQUIRE(sqlite3_open(disk.file().c_str(), &other) == SQLITE_OK);
        CHECK(sqlite3_exec(other, "PRAGMA wal_checkpoint(TRUNCATE)", nullptr, nullptr, nullptr) == SQLITE_OK);
        damaged_file::overwrite_pages_with(disk.file(), "location");
        // The page reads the file anew once another has written to it.
        CHECK(sqlite3_exec(other, "UPDATE boat SET thinned_until = 1", nullptr, nullptr, nullptr) == SQLITE_OK);
        sqlite3_close(other);
    }
    CHECK(at.world.run_until([&] { return at.has_all() && disk.set_aside().size() == 1; }, 1min));
    CHECK_THAT(at.log.errors, ise_test::Contains("set aside"));
}

} // namespace told_test
