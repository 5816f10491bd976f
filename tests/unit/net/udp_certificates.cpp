// udp whose sides show certificates: what they do and do not let in, on virtual time; and somebody between the two who
// loses, throws back and mixes what they say.
#include <ise/transport/security.hpp>
#include <ise/wire/datagram.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/sealed_datagram.hpp>

#include <support/authority.hpp>
#include <support/boat_services.hpp>
#include <support/catch.hpp>
#include <support/datagram_router.hpp>
#include <support/sim_parties.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <fstream>
#include <map>
#include <memory>
#include <random>
#include <string>
#include <vector>

namespace udp_certificates_test {

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;
using ise::wire::datagram_type;
using ise_test::Contains;

namespace {

// With the address of the router, by which the boat is called.
const std::string all_names = std::string(authority::everywhere) + ",IP:10.0.0.3";

authority& signer() {
    static authority made("the trusted one");
    return made;
}
const std::filesystem::path& boat_files() {
    static auto folder = signer().issue("boat", all_names + ",URI:ise://atirma/boat");
    return folder;
}
const std::filesystem::path& shore_files() {
    static auto folder = signer().issue("shore", "DNS:shore,URI:ise://atirma/web");
    return folder;
}

// A boat and a shore with a router between them, each with its own credentials.
struct canal {
    sim_parties sea;
    party* boat = nullptr;
    party* shore = nullptr;
    ise::remote there;
    std::unique_ptr<datagram_router> between;
    std::string who_called, serial;
    int executed = 0;

    struct side {
        std::filesystem::path folder; // none: no certificates
        bool key = false;
    };
    ise::security_options with(const std::string& host, const side& what) {
        ise::security_options made;
        auto& to = sea.world.host(host);
        for (const char* file : {"ca.pem", "certificate.pem", "key.pem"})
            if (!what.folder.empty()) to.write_file(std::string("tls/") + file, read_all(what.folder / file));
        if (!what.folder.empty()) made.tls_folder = "tls";
        if (what.key) to.write_file("key", std::string(64, 'k'));
        if (what.key) made.key_file = "key";
        return made;
    }
    void begin(const side& of_boat, const side& of_shore, const std::string& listens = "udp+tls",
               const std::string& dials = "udp+tls") {
        boat = &sea.add("boat", {}, with("boat", of_boat));
        shore = &sea.add("shore", {}, with("shore", of_shore));
        boat->provide(helm, [this](set_mode asked, const ise::call_context& by) {
            ++executed;
            who_called = by.who;
            serial = by.verified->serial;
            return mode_set{true, asked.mode};
        });
        boat->provide(echo, [](blob given) { return given; });
        auto where = boat->listen(listens + "://10.0.0.1:7400");
        auto over = where;
        over.kind = ise::protocol::udp;
        auto& router = sea.world.host("router");
        between = std::make_unique<datagram_router>(router.start_process("router"), over);
        auto at = ise::endpoint::parse(fmt::format("{}://{}:9000", dials, router.address())).value();
        boat->services->acceptor().advertise({at});
        there = shore->at(at);
    }
    ~canal() {
        there = {};
        sea.stop();
        if (between) between->stop(sea.world);
    }
    template <class Contract, class Request>
    static ise::task<ise::result<typename Contract::response_type>> ask(ise::remote at, Contract service,
                                                                        Request request, ise::duration limit) {
        auto got = co_await at.try_call(service, request, limit);
        co_return got;
    }
    ise::result<mode_set> call(ise::duration limit = 10s) {
        return sea.run(*shore, ask(there, helm, set_mode{"hold"}, limit));
    }
    std::string warnings() const {
        std::string text;
        for (const auto& line : boat->warnings) text += line + "\n";
        return text;
    }
    // Nothing comes in, and both sides say why.
    void refused(const std::string& told_shore, const std::string& told_boat) {
        auto got = call(5s);
        REQUIRE_FALSE(got);
        CHECK_THAT(got.error().message(), Contains(told_shore));
        CHECK(got.error().executed() == ise::execution::not_executed);
        sea.world.run_for(6s);
        CHECK_THAT(warnings(), Contains(told_boat));
        CHECK(executed == 0);
        CHECK(boat->services->counts().sessions_accepted == 0);
    }
};

datagram_type kind_of(const ise::buffer& datagram) {
    return static_cast<datagram_type>(ise::wire::read_header(datagram.data()).type);
}
bool is_flight(const ise::buffer& datagram) { return kind_of(datagram) == ise::wire::sealed::flight; }
int flight_number(const ise::buffer& datagram) {
    return is_flight(datagram) ? std::to_integer<int>(datagram.data()[ise::wire::frame_header::size]) : 0;
}

const std::string refused_ours = "it refused the certificate of this side: ";

} // namespace

TEST_CASE("udp certificates: both sides are verified, messages small and big go, and nothing can be read") {
    canal at;
    at.sea.world.net().between("boat", "router").latency = 20ms;
    at.sea.world.net().between("boat", "router").loss = 0.05;
    at.begin({boat_files()}, {shore_files()});
    std::string heard;
    int plain = 0;
    auto listen = [&](ise::buffer& datagram) {
        heard += ise::as_text(datagram.view());
        plain += kind_of(datagram) == datagram_type::data;
    };
    at.between->on_question = at.between->on_answer = listen;
    auto got = at.call(30s);
    INFO((got ? "" : got.error().message()));
    REQUIRE(got);
    CHECK(at.who_called == "ise://atirma/web");
    CHECK_FALSE(at.serial.empty());
    auto session = at.shore->services->sessions().begin()->second;
    CHECK(session->peer_name().find("udp+tls://") != std::string::npos);
    CHECK(session->peer().verified.certificate == "ise://atirma/boat");
    blob big;
    big.content.resize(500'000, 7);
    auto echoed = at.sea.run(*at.shore, canal::ask(at.there, echo, big, 10min));
    INFO((echoed ? std::string() : echoed.error().message()));
    REQUIRE(echoed);
    CHECK(echoed->content == big.content);
    CHECK(plain == 0);
    CHECK(heard.find("hold") == heard.npos);
    CHECK(heard.find("ise://atirma/web") == heard.npos); // a client's certificate is encrypted
    at.between->on_question = at.between->on_answer = {};
}

TEST_CASE("udp certificates: a chain that takes several datagrams is put together again, whichever are lost") {
    canal at;
    auto folder = signer().issue_below("deep", 4);
    at.begin({boat_files()}, {folder});
    std::mt19937_64 random(5);
    int parts = 0;
    auto lose = [&](ise::buffer& datagram) {
        if (!is_flight(datagram)) return;
        parts = std::max(parts, std::to_integer<int>(datagram.data()[ise::wire::frame_header::size + 2]));
        if (random() % 3 == 0) datagram.clear();
    };
    at.between->on_question = at.between->on_answer = lose;
    auto got = at.call(60s);
    INFO((got ? "" : got.error().message()));
    CHECK(got);
    CHECK(parts > 1);
    at.between->on_question = at.between->on_answer = {};
}

TEST_CASE("udp certificates: who is not to be let in hears why, though the first refusals are lost") {
    struct met {
        std::string name;
        bool calls; // it is the caller's
        std::string to_shore, to_boat;
    };
    auto one = GENERATE(values<met>({
        {"expired", true, refused_ours + "by the clock there it has expired", "has expired"},
        {"expired", false, "has expired", refused_ours + "by the clock there it has expired"},
        {"stranger", true, refused_ours + "it was not issued by an authority", "was not issued by an authority"},
        {"elsewhere", false, "is not for '10.0.0.3'", refused_ours + "it is not for the name or address"},
    }));
    auto lost = GENERATE(0, 1, 2);
    INFO(one.name << ", " << lost << " lost");
    static authority unknown("somebody else");
    static const std::map<std::string, std::filesystem::path> folders{
        {"expired", signer().issue("expired", all_names, {"20170101000000Z", "20170801000000Z"})},
        {"stranger", unknown.issue("stranger", all_names)},
        {"elsewhere", signer().issue("elsewhere", "DNS:elsewhere")}};
    canal at;
    auto bad = folders.at(one.name);
    if (one.name == "stranger") { // it believes the boat
        std::ofstream(bad / "ca.pem") << read_all(boat_files() / "ca.pem");
    }
    at.begin({one.calls ? boat_files() : bad}, {one.calls ? bad : shore_files()});
    int refusals = 0;
    auto lose = [&](int number) {
        return [&refusals, number, lost](ise::buffer& datagram) {
            if (flight_number(datagram) == number && ++refusals <= lost) datagram.clear();
        };
    };
    at.between->on_question = lose(3); // of the caller, which finds the certificate of the other one wrong
    if (one.calls) at.between->on_question = {};
    if (one.calls) at.between->on_answer = lose(4);
    at.refused(one.to_shore, one.to_boat);
    CHECK(refusals > lost);
    at.between->on_question = at.between->on_answer = {};
}

TEST_CASE("udp certificates: unequal sides tell each other") {
    struct met {
        canal::side boat, shore;
        std::string listens, dials, to_shore, to_boat;
    };
    canal::side certified{boat_files()}, keyed, none, both{boat_files(), true};
    keyed.key = both.key = true;
    auto which = GENERATE(range(0, 5));
    const std::vector<met> all{
        {certified, none, "udp+tls", "udp", "certificates are required here", "certificates are required here"},
        {none, certified, "udp", "udp+tls", "one side has udp+tls://, the other not", "this side has no key"},
        {certified, keyed, "udp+tls", "udp", "it shows a certificate instead of the shared key (dial udp+tls://)",
         "it refused the certificate of this side"},
        {keyed, certified, "udp", "udp+tls", "TLS", "TLS without it was offered: it dials udp+tls://"},
        {both, certified, "udp+tls", "udp+tls", "a shared key is demanded", "a shared key is demanded here"},
    };
    const auto& one = all[static_cast<std::size_t>(which)];
    INFO(which << ": " << one.dials << " to " << one.listens);
    canal at;
    at.begin(one.boat, one.shore, one.listens, one.dials);
    at.refused(one.to_shore, one.to_boat);
}

TEST_CASE("udp certificates: a refusal that nobody made, after the handshake, ends nothing") {
    canal at;
    at.begin({boat_files()}, {shore_files()});
    int forged = 0;
    at.between->on_answer = [&](ise::buffer& datagram) { // in the place of the first sealed datagram
        if (kind_of(datagram) != ise::wire::sealed::data || forged++ > 2) return;
        auto to = ise::wire::read_header(datagram.data()).id;
        const std::uint8_t alert[] = {4, 0, 1, 21, 3, 3, 0, 2, 2, 45};
        datagram.clear();
        ise::wire::put_datagram(datagram, ise::wire::sealed::flight, to, std::as_bytes(std::span(alert)));
    };
    auto got = at.call(30s);
    INFO((got ? "" : got.error().message()));
    CHECK(got);
    CHECK(forged > 2);
    at.between->on_answer = {};
}

TEST_CASE("udp certificates: flights that are thrown back, or of another session, let nobody in") {
    auto tls = GENERATE(true, false);
    auto how = GENERATE(as<std::string>(), "thrown back", "of another session", "mixed");
    INFO(how << (tls ? ", certificates" : ", shared key"));
    canal at;
    canal::side keyed;
    keyed.key = true;
    const std::string scheme = tls ? "udp+tls" : "udp";
    at.begin(tls ? canal::side{boat_files()} : keyed, tls ? canal::side{shore_files()} : keyed, scheme, scheme);
    std::vector<ise::bytes> questions, answers; // of the session before, complete
    at.between->on_question = [&](ise::buffer& one) {
        if (is_flight(one) || kind_of(one) == ise::wire::sealed::data) questions.push_back(one.to_bytes());
    };
    at.between->on_answer = [&](ise::buffer& one) {
        if (is_flight(one) || kind_of(one) == ise::wire::sealed::data) answers.push_back(one.to_bytes());
    };
    REQUIRE(at.call());
    at.shore->services->sessions().begin()->second->wire().close(ise::failure(ise::errc::peer_lost, "cut"));
    at.sea.world.run_for(30s);
    const auto accepted = at.boat->services->counts().sessions_accepted;
    const auto executed = at.executed;
    std::size_t asked = 0, answered = 0;
    // Each gets, under its own id, what was said by somebody else, or by itself.
    auto replaced = [&](ise::buffer& one, const std::vector<ise::bytes>& by, std::size_t& at_which) {
        if (!is_flight(one) && kind_of(one) != ise::wire::sealed::data) return;
        auto to = ise::wire::read_header(one.data()).id;
        auto content = by[at_which++ % by.size()];
        ise::detail::store_little(content.data() + 8, to);
        one.clear();
        one.append(ise::bytes_view(content));
    };
    const bool mixed = how == "mixed", back = how == "thrown back";
    at.between->on_question = [&](ise::buffer& one) {
        if (mixed && asked % 2 == 1) return void(++asked);
        replaced(one, back ? answers : questions, asked);
    };
    at.between->on_answer = [&](ise::buffer& one) {
        if (mixed && answered % 2 == 1) return void(++answered);
        replaced(one, back ? questions : answers, answered);
    };
    CHECK_FALSE(at.call(20s));
    CHECK(asked > 0);
    CHECK(at.executed == executed);
    CHECK(at.boat->services->counts().sessions_accepted == accepted);
    at.between->on_question = at.between->on_answer = {};
}

TEST_CASE("udp certificates: without certificates of its own a side neither listens nor dials") {
    canal at;
    at.begin({boat_files()}, {});
    auto got = at.call(5s);
    REQUIRE_FALSE(got);
    CHECK_THAT(got.error().message(), Contains("takes a certificate of this side") && Contains("ISE_TLS"));
}

} // namespace udp_certificates_test
