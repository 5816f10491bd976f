#include <components/iridium/at.hpp>
#include <components/iridium/bundle.hpp>
#include <components/iridium/directip.hpp>
#include <components/iridium/rockblock.hpp>
#include <components/iridium/text.hpp>

#include <support/catch.hpp>
#include <support/shared_data.hpp>

#include <fmt/format.h>
#include <nlohmann/json.hpp>

#include <fstream>
#include <iterator>
#include <set>

namespace formats_test {

using namespace atirma::iridium;
using namespace std::chrono;
using namespace std::chrono_literals;

namespace {

ise::bytes bytes_of(std::string_view text) {
    auto raw = ise::as_bytes(text);
    return {raw.begin(), raw.end()};
}

std::string whole_file(const std::filesystem::path& path) {
    std::ifstream in(path, std::ios::binary);
    return {std::istreambuf_iterator<char>(in), {}};
}

constexpr auto form_of = "imei=300234010753370&momsn=7&transmit_time=22-02-01%2022%3A22%3A40&data=00ff";

mo_message sample() {
    mo_message m;
    m.imei = "300234010753370";
    m.momsn = 65535;
    m.mtmsn = 12;
    m.session_time = sys_seconds(1'500'000'000s);
    m.session_status = 2;
    m.cdr = 77;
    m.where = estimate{-28.15, -15.45, 12};
    m.data = bytes_of("hello");
    return m;
}

} // namespace

TEST_CASE("iridium: hex, base64url and forms are read back, and refused where they are none") {
    CHECK(to_hex(bytes_of("Hi!")) == "486921");
    CHECK(from_hex("486921", 3).value() == bytes_of("Hi!"));
    CHECK(from_hex("", 3).value().empty());
    CHECK(from_hex("48692", 10).error().code() == ise::errc::malformed);
    CHECK(from_hex("4g", 10).error().code() == ise::errc::malformed);
    CHECK(from_hex("00000000", 3).error().code() == ise::errc::too_large);
    for (std::string_view text : {"", "f", "fo", "foo", "foob", "\xff\xfe"})
        CHECK(from_base64url(to_base64url(text)).value() == text);
    CHECK(to_base64url("foob") == "Zm9vYg");
    CHECK(to_base64url("\xff\xfe") == "__4");
    CHECK_FALSE(from_base64url("a"));
    CHECK_FALSE(from_base64url("a+b/"));
    auto fields = parse_form("a=b+c&empty&x=%41%2f&x=last&").value();
    CHECK(fields.at("a") == "b c");
    CHECK(fields.at("empty").empty());
    CHECK(fields.at("x") == "last");
    CHECK_FALSE(parse_form("a=%4"));
    CHECK_FALSE(parse_form("a=%zz"));
    std::string many;
    for (int i = 0; i < 65; ++i) many += fmt::format("f{}=1&", i);
    CHECK(parse_form(many).error().code() == ise::errc::too_large);
}

TEST_CASE("iridium: both notations of a transmit time are read, nothing else") {
    auto at = sys_days(2022y / 2 / 1) + 22h + 22min + 40s;
    CHECK(parse_transmit_time("22-02-01 22:22:40").value() == at);
    CHECK(parse_transmit_time("2022-02-01T22:22:40Z").value() == at);
    CHECK(parse_transmit_time("2022-02-01T22:22:40.125Z").value() == at);
    CHECK(format_transmit_time(at) == "22-02-01 22:22:40");
    for (auto wrong : {"", "22-02-01", "22-02-30 22:22:40", "22-13-01 22:22:40", "22-02-01 24:22:40",
                       "22-02-01 22:22:40Z", "2022-02-01T22:22:40", "2022-02-01 22:22:40", "22-02-01T22:22:40Z",
                       "22/02/01 22:22:40", "2022-02-01T22:22:40.Z", "20ab-02-01T22:22:40Z"})
        CHECK_FALSE(parse_transmit_time(wrong));
}

TEST_CASE("iridium: RockBLOCK's deliveries of the shared data are understood") {
    auto file = ise_test::shared_data("iridium_vectors.json");
    if (!file) {
        WARN("the shared test data is not here: skipped");
        return;
    }
    auto vectors = nlohmann::json::parse(whole_file(*file));
    for (const auto& one : vectors["mo_delivery"]) {
        auto read = parse_mo_delivery(one["body"].get<std::string>());
        REQUIRE(read);
        const auto& expected = one["expect"];
        CHECK(read->message.momsn == expected["momsn"].get<int>());
        CHECK(read->message.session_time == parse_transmit_time(expected["utc"].get<std::string>()).value());
        CHECK(ise::as_text(read->message.data) == expected["payload_ascii"].get<std::string>());
        if (expected.contains("imei")) CHECK(read->message.imei == expected["imei"].get<std::string>());
        CHECK(read->message.where);
    }
    for (const auto& text : vectors["mt_submission"]["replies"]) {
        auto read = parse_mt_reply(text.get<std::string>());
        REQUIRE(read);
        CHECK(encode_mt_reply(*read) == text.get<std::string>());
    }
    for (const auto& [code, text] : vectors["mt_submission"]["error_codes"].items())
        CHECK(explain_mt_failure(std::stoi(code)).find("not name") == std::string_view::npos);
    for (const auto& one : vectors["directip"]) {
        if (!one.contains("hex")) continue;
        auto raw = from_hex(one["hex"].get<std::string>(), 4096).value();
        auto meaning = one["expect"].get<std::string>();
        if (meaning.starts_with("MO confirmation")) CHECK(parse_mo_confirmation(raw).value());
        if (!meaning.starts_with("guide table 6-10")) continue;
        auto read = parse_directip_mo(raw);
        REQUIRE(read);
        CHECK(read->cdr == 1234567u);
        CHECK(read->imei == "300034010123450");
        CHECK(read->momsn == 54321);
        CHECK(read->mtmsn == 12345);
        CHECK(read->session_time == sys_days(2005y / 12 / 30) + 13h + 45min + 5s);
        REQUIRE(read->data.size() == 70);
        CHECK(encode_directip_mo(*read) == raw);
    }
}

TEST_CASE("iridium: DirectIP messages of the shared data are understood or refused") {
    auto real = ise_test::shared_data("directip_0-mo.sbd"), invalid = ise_test::shared_data("directip_1-invalid.sbd");
    auto confirmed = ise_test::shared_data("directip_mt_confirmation.isbd");
    if (!real || !invalid || !confirmed) {
        WARN("the shared test data is not here: skipped");
        return;
    }
    auto read = parse_directip_mo(bytes_of(whole_file(*real)));
    REQUIRE(read);
    CHECK(read->cdr == 1894516585u);
    CHECK(read->imei == "300234063904190");
    CHECK(read->momsn == 75);
    CHECK(read->mtmsn == 0);
    CHECK(read->session_time == sys_days(2015y / 7 / 9) + 18h + 15min + 8s);
    CHECK(ise::as_text(read->data) == "test message from pete");
    CHECK_FALSE(parse_directip_mo(bytes_of(whole_file(*invalid))));
    auto parsed = parse_mt_confirmation(bytes_of(whole_file(*confirmed)));
    REQUIRE(parsed);
    CHECK(parsed->client_id == 1111);
    CHECK(parsed->status == 42);
    CHECK(encode_mt_confirmation(*parsed) == bytes_of(whole_file(*confirmed)));
}

TEST_CASE("iridium: a location element holds degrees and thousandths of minutes") {
    auto header = encode_directip_mo(sample());
    // 33° 10.311' N, 118° 32.518' W, 65536 km, in place of the sample's location.
    auto element = from_hex("03000b01212847767f0600010000", 64).value();
    std::copy(element.begin(), element.end(), header.begin() + 3 + 31);
    auto read = parse_directip_mo(header).value();
    REQUIRE(read.where);
    CHECK(read.where->latitude_deg == Approx(33 + 10.311 / 60));
    CHECK(read.where->longitude_deg == Approx(-(118 + 32.518 / 60)));
    CHECK(read.where->cep_km == 65536);
}

TEST_CASE("iridium: DirectIP survives a round trip, and every cut of it is refused") {
    auto whole = encode_directip_mo(sample());
    auto read = parse_directip_mo(whole);
    REQUIRE(read);
    CHECK(read->where->latitude_deg == Approx(-28.15).margin(1e-4));
    read->where = sample().where;
    CHECK(*read == sample());
    for (std::size_t size = 0; size < whole.size(); ++size)
        CHECK_FALSE(parse_directip_mo(ise::bytes_view(whole).first(size)));
    directip_mt mt;
    mt.client_id = 9999;
    mt.imei = imei_bytes("300234010753370");
    mt.flags = flush_queue | send_ring_alert | update_location | high_priority | assign_mtmsn;
    mt.payload = bytes_of("x");
    auto submitted = encode_directip_mt(mt);
    CHECK(to_hex(ise::bytes_view(submitted).subspan(3, 7)) == "4100150000270f");
    CHECK(parse_directip_mt(submitted).value() == mt);
    for (std::size_t size = 0; size < submitted.size(); ++size)
        CHECK_FALSE(parse_directip_mt(ise::bytes_view(submitted).first(size)));
    CHECK_FALSE(parse_mo_confirmation(encode_mo_confirmation(false)).value());
    ise::bytes endless{std::byte{1}, std::byte{0xff}, std::byte{0xff}};
    CHECK(directip_length(endless).error().code() == ise::errc::too_large);
    CHECK_FALSE(*directip_length(ise::bytes_view(endless).first(2)));
}

TEST_CASE("iridium: a delivery is read from form and JSON alike, and survives a round trip") {
    mo_delivery sent;
    sent.message = sample();
    sent.message.mtmsn = 0;
    sent.message.session_status = 0;
    sent.message.cdr.reset();
    sent.serial = 16949;
    sent.device_type = "ROCKBLOCK";
    sent.jwt = "a.b.c";
    for (const auto& body : {encode_mo_form(sent), encode_mo_json(sent)}) {
        auto read = parse_mo_delivery(body);
        REQUIRE(read);
        CHECK(read->message == sent.message);
        CHECK(read->serial == 16949);
        CHECK(read->jwt == "a.b.c");
        CHECK(read->device_type == "ROCKBLOCK");
    }
    // As the newer service posts it.
    auto tracker =
        parse_mo_delivery(R"({"momsn":"5","data":"","serial":1,"iridium_latitude":"50.1","iridium_longitude":8.5,)"
                          R"("imei":"300234010753370","transmit_time":"2019-01-31T14:00:13Z","extra":{"x":[1]}})");
    REQUIRE(tracker);
    CHECK(tracker->message.momsn == 5);
    CHECK(tracker->message.data.empty());
    CHECK(tracker->message.where->latitude_deg == 50.1);
}

TEST_CASE("iridium: a delivery says which of its fields is wrong") {
    REQUIRE(parse_mo_delivery(form_of));
    auto with = [](std::string_view what, std::string_view instead) {
        std::string body = form_of;
        body.replace(body.find(what), what.size(), instead);
        auto read = parse_mo_delivery(body);
        return read ? std::string("taken") : read.error().message();
    };
    CHECK(with("imei=300234010753370", "x=1").find("imei") != std::string::npos);
    CHECK(with("300234010753370", "30023401075337").find("15 digits") != std::string::npos);
    CHECK(with("300234010753370", "30023401075337a").find("15 digits") != std::string::npos);
    CHECK(with("momsn=7", "momsn=65536").find("momsn") != std::string::npos);
    CHECK(with("momsn=7", "momsn=-1").find("momsn") != std::string::npos);
    CHECK(with("momsn=7", "momsn=").find("momsn") != std::string::npos);
    CHECK(with("22-02-01", "tomorrow").find("transmit_time") != std::string::npos);
    CHECK(with("data=00ff", "data=00f").find("data") != std::string::npos);
    CHECK(with("data=00ff", "data=zz").find("data") != std::string::npos);
    CHECK(with("data=00ff", "dota=00ff").find("data") != std::string::npos);
    CHECK(with("data=00ff", "data=00ff&iridium_latitude=91&iridium_longitude=0").find("iridium_latitude") !=
          std::string::npos);
    CHECK(with("data=00ff", "data=00ff&iridium_latitude=nan&iridium_longitude=0").find("iridium_latitude") !=
          std::string::npos);
    CHECK_FALSE(parse_mo_delivery("{\"imei\":"));
    CHECK_FALSE(parse_mo_delivery("{]"));
    CHECK_FALSE(parse_mo_delivery(std::string(60000, '{')));
    CHECK_FALSE(parse_mo_delivery(""));
    auto big = std::string(form_of) + std::string(2 * max_mo_bytes, '0');
    CHECK(parse_mo_delivery(big).error().code() == ise::errc::too_large);
}

TEST_CASE("iridium: each FAILED code has its own words, and says whether trying again helps") {
    std::set<std::string_view> words;
    for (int code : {10, 11, 12, 13, 14, 15, 16, 99}) words.insert(explain_mt_failure(code));
    CHECK(words.size() == 8);
    for (int code : {10, 11, 12, 13, 14, 15, 16}) CHECK_FALSE(mt_failure_passes(code));
    CHECK(mt_failure_passes(99));
    CHECK(mt_failure_passes(50));
    auto reply = parse_mt_reply("FAILED,13,Your account has insufficient credit\r\n").value();
    CHECK_FALSE(reply.accepted);
    CHECK(reply.code == 13);
    CHECK(reply.text == "Your account has insufficient credit");
    CHECK(parse_mt_reply("OK,4114651\n").value().reference == "4114651");
    for (auto wrong : {"", "<html>", "FAILED", "FAILED,x,y", "OKAY,1"}) CHECK_FALSE(parse_mt_reply(wrong));
    mt_submission what;
    what.imei = "300234010753370";
    what.username = "joe & co";
    what.password = "bl0gs=+";
    what.data = "48656c";
    what.flush = true;
    auto read = parse_mt_submission(encode_mt_submission(what)).value();
    CHECK(read.username == what.username);
    CHECK(read.password == what.password);
    CHECK(read.flush);
}

TEST_CASE("iridium: a session's result is read as the modem writes it") {
    auto read = parse_sbdix("+SBDIX: 0, 23, 1, 4, 12, 3").value();
    CHECK(read.mo_arrived());
    CHECK(read.momsn == 23);
    CHECK(read.mt_length == 12);
    CHECK(read.mt_queued == 3);
    CHECK(parse_sbdix(encode_sbdix(read)).value() == read);
    CHECK_FALSE(parse_sbdix("+SBDIX:32,23,2,0,0,0").value().mo_arrived());
    for (auto wrong :
         {"", "+SBDIX", "+SBDIX: 0, 1, 2, 3, 4", "+SBDIX: 0, 1, 2, 3, 4, 5, 6", "+SBDIX: a, 1, 2, 3, 4, 5", "+CSQ:5"})
        CHECK_FALSE(parse_sbdix(wrong));
    CHECK(line_sum(bytes_of("hello")) == 0x214);
}

TEST_CASE("iridium: packets go together as far as a message holds, and come apart again") {
    std::vector<ise::bytes> packets{ise::bytes(100, std::byte{1}), ise::bytes(100, std::byte{2}),
                                    ise::bytes(100, std::byte{3}), ise::bytes(100, std::byte{4})};
    std::size_t taken = 0;
    auto message = bundle(packets, max_mo_bytes, taken);
    CHECK(taken == 3);
    CHECK(message.size() <= max_mo_bytes);
    auto apart = unbundle(message).value();
    REQUIRE(apart.size() == 3);
    CHECK(apart[2] == packets[2]);
    message = bundle(std::span(packets).first(1), max_mo_bytes, taken);
    CHECK(message == packets[0]);
    CHECK(unbundle(message).value().front() == packets[0]);
    CHECK(bundle({}, 340, taken).empty());
    CHECK(taken == 0);
    CHECK_FALSE(unbundle({}));
    for (std::string_view wrong : {"B", "B\x05ok",
                                   "B\x01"
                                   "a\x02"})
        CHECK_FALSE(unbundle(ise::as_bytes(wrong)));
    CHECK_FALSE(unbundle(ise::as_bytes(std::string_view("B\0", 2))));
    CHECK_FALSE(unbundle(ise::as_bytes(std::string_view("B\x02"
                                                        "ab\0",
                                                        5))));
}

} // namespace formats_test
