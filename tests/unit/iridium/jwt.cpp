#include <components/iridium/jwt.hpp>
#include <components/iridium/text.hpp>

#include <support/catch.hpp>
#include <support/rsa_keys.hpp>

using namespace atirma::iridium;
using ise_test::rsa_keys;

namespace {

const rsa_keys& ours() {
    static const rsa_keys made;
    return made;
}

mo_delivery delivery(std::string claims, const std::string& secret = ours().secret) {
    auto made = parse_mo_delivery("imei=300234010753370&momsn=7&transmit_time=22-02-01 22:22:40&data=00ff").value();
    made.jwt = sign_jwt(secret, claims).value();
    return made;
}

std::string why(const ise::result<void>& outcome) { return outcome ? "accepted" : outcome.error().message(); }

} // namespace

TEST_CASE("iridium: a token of the configured key that signs this message is accepted") {
    auto key = jwt_key::parse(ours().open).value();
    CHECK(key.verify(delivery("{}")));
    CHECK(key.verify(delivery(
        R"({"iss":"Rock 7","imei":"300234010753370","momsn":7,"data":"00FF","transmit_time":"22-02-01 22:22:40"})")));
    CHECK(key.verify(delivery(R"({"momsn":"7","transmit_time":"2022-02-01T22:22:40Z"})")));
}

TEST_CASE("iridium: a token of another key, for another message, of another algorithm, or none is refused") {
    auto key = jwt_key::parse(ours().open).value();
    static const rsa_keys stranger;
    CHECK(why(key.verify(delivery("{}", stranger.secret))).find("signature") != std::string::npos);
    CHECK(why(key.verify(delivery(R"({"imei":"300234010753371"})"))).find("another imei") != std::string::npos);
    CHECK(why(key.verify(delivery(R"({"momsn":8})"))).find("another momsn") != std::string::npos);
    CHECK(why(key.verify(delivery(R"({"data":"00fe"})"))).find("other data") != std::string::npos);
    CHECK(why(key.verify(delivery(R"({"transmit_time":17})"))).find("transmit_time") != std::string::npos);
    CHECK(why(key.verify(delivery("[]"))).find("claims") != std::string::npos);
    auto none = delivery("{}");
    none.jwt.clear();
    CHECK(why(key.verify(none)).find("there is none") != std::string::npos);

    auto good = delivery("{}").jwt;
    auto unsigned_one = to_base64url(R"({"alg":"none"})") + "." + to_base64url("{}") + ".";
    auto by_secret = to_base64url(R"({"alg":"HS256"})") + good.substr(good.find('.'));
    for (const auto& wrong :
         {std::string("a.b"), std::string("a.b.c.d"), std::string(".."), std::string("%.%.%"), unsigned_one, by_secret,
          good.substr(0, good.size() - 4), good + "AA", std::string(20000, 'a')}) {
        auto told = key.verify(wrong);
        REQUIRE_FALSE(told);
        CHECK(told.error().code() == ise::errc::unauthorized);
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
