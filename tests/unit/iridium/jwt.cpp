#include <components/iridium/jwt.hpp>
#include <components/iridium/text.hpp>

#include <support/catch.hpp>
#include <support/rsa_keys.hpp>

#include <nlohmann/json.hpp>

namespace jwt_test {

using namespace atirma::iridium;
using ise_test::rsa_keys;

namespace {

const rsa_keys& ours() {
    static const rsa_keys made;
    return made;
}

constexpr auto posted =
    "imei=300234010753370&momsn=7&transmit_time=22-02-01 22:22:40&serial=14680&device_type=ROCKBLOCK&"
    "iridium_latitude=28.1530&iridium_longitude=-15.4480&iridium_cep=3.0&data=00ff";
const auto received = std::chrono::sys_days(std::chrono::year(2022) / 2 / 1) + std::chrono::hours(23);

/// What the gateway signs of that post, with changes: a null takes a claim away.
std::string claims(const nlohmann::json& changes = nlohmann::json::object()) {
    auto made = nlohmann::json::parse(R"({"iss":"Rock 7","imei":"300234010753370","momsn":7,"data":"00FF",
        "transmit_time":"2022-02-01T22:22:40Z","serial":14680,"device_type":"ROCKBLOCK",
        "iridium_latitude":28.153,"iridium_longitude":"-15.4480","iridium_cep":3})");
    made.merge_patch(changes);
    return made.dump();
}

mo_delivery delivery(std::string signed_claims, const std::string& secret = ours().secret,
                     std::string_view body = posted) {
    auto made = parse_mo_delivery(body).value();
    made.jwt = sign_jwt(secret, signed_claims).value();
    return made;
}

std::string why(const ise::result<void>& outcome) { return outcome ? "accepted" : outcome.error().message(); }

} // namespace

TEST_CASE("iridium: a token of the configured key that signs this message is accepted") {
    auto key = jwt_key::parse(ours().open).value();
    CHECK(why(key.verify(delivery(claims()), received)) == "accepted");
    CHECK(key.verify(
        delivery(claims(
            {{"momsn", "7"}, {"transmit_time", "22-02-01 22:22:40"}, {"serial", nullptr}, {"device_type", nullptr}})),
        received));
    auto until = received.time_since_epoch() / std::chrono::seconds(1);
    CHECK(key.verify(delivery(claims({{"exp", until + 1}, {"nbf", until - 1}})), received));
    // Without a position, which the gateway need not tell.
    CHECK(key.verify(
        delivery(claims({{"iridium_latitude", nullptr}, {"iridium_longitude", nullptr}, {"iridium_cep", nullptr}}),
                 ours().secret,
                 "imei=300234010753370&momsn=7&transmit_time=22-02-01 "
                 "22:22:40&serial=14680&device_type=ROCKBLOCK&data=00ff"),
        received));
}

TEST_CASE("iridium: a post of which anything is altered is refused, and so is one whose token leaves anything out") {
    auto key = jwt_key::parse(ours().open).value();
    std::string post = posted;
    for (auto [field, other] : {std::pair("imei=300234010753370", "imei=300234010753371"),
                                {"momsn=7", "momsn=8"},
                                {"22:22:40", "22:22:41"},
                                {"28.1530", "28.1531"},
                                {"-15.4480", "-15.4481"},
                                {"cep=3.0", "cep=1.0"},
                                {"00ff", "00fe"},
                                {"serial=14680", "serial=1"},
                                {"ROCKBLOCK", "OTHER"},
                                {"&iridium_cep=3.0", ""},
                                {"iridium_latitude=28.1530&", ""}}) {
        auto altered = post;
        altered.replace(altered.find(field), std::string(field).size(), other);
        INFO(altered);
        CHECK(why(key.verify(delivery(claims(), ours().secret, altered), received)).find("it signs another") !=
              std::string::npos);
    }
    for (auto claim :
         {"imei", "momsn", "transmit_time", "data", "iridium_latitude", "iridium_longitude", "iridium_cep"})
        CHECK(why(key.verify(delivery(claims({{claim, nullptr}})), received))
                  .find(std::string("does not sign ") + claim) != std::string::npos);
    CHECK(why(key.verify(delivery("{}"), received)).find("does not sign imei") != std::string::npos);
    auto at = received.time_since_epoch() / std::chrono::seconds(1);
    CHECK(why(key.verify(delivery(claims({{"exp", at - 301}})), received)).find("expired") != std::string::npos);
    CHECK(why(key.verify(delivery(claims({{"nbf", at + 301}})), received)).find("not valid yet") != std::string::npos);
}

TEST_CASE("iridium: a token of another key, for another message, of another algorithm, or none is refused") {
    auto key = jwt_key::parse(ours().open).value();
    static const rsa_keys stranger;
    CHECK(why(key.verify(delivery(claims(), stranger.secret), received)).find("signature") != std::string::npos);
    CHECK(why(key.verify(delivery(claims({{"transmit_time", 17}})), received)).find("transmit_time") !=
          std::string::npos);
    CHECK(why(key.verify(delivery("[]"), received)).find("claims") != std::string::npos);
    auto none = delivery("{}");
    none.jwt.clear();
    CHECK(why(key.verify(none, received)).find("there is none") != std::string::npos);

    auto good = delivery("{}").jwt;
    auto unsigned_one = to_base64url(R"({"alg":"none"})") + "." + to_base64url("{}") + ".";
    auto by_secret = to_base64url(R"({"alg":"HS256"})") + good.substr(good.find('.'));
    for (const auto& wrong :
         {std::string("a.b"), std::string("a.b.c.d"), std::string(".."), std::string("%.%.%"), unsigned_one, by_secret,
          good.substr(0, good.size() - 4), good + "AA", std::string(20000, 'a')}) {
        auto result = key.verify(wrong);
        REQUIRE_FALSE(result);
        CHECK(result.error().code() == ise::errc::unauthorized);
    }
    for (std::size_t at = 0; at < good.size(); at += 7) { // any changed letter
        auto changed = good;
        changed[at] = changed[at] == 'A' ? 'B' : 'A';
        CHECK_FALSE(key.verify(changed));
    }
}

TEST_CASE("iridium: what is no public key is refused when it is configured") {
    CHECK(jwt_key::parse("").error().code() == ise::errc::invalid_argument);
    CHECK(jwt_key::parse("-----BEGIN PUBLIC KEY-----\nAAAA\n-----END PUBLIC KEY-----\n").error().code() ==
          ise::errc::invalid_argument);
    CHECK_FALSE(jwt_key::parse(ours().secret));
}

} // namespace jwt_test
