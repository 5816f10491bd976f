#include <ise/core/result.hpp>

#include <support/catch.hpp>

TEST_CASE("a result holds a value or throws the failure in its place") {
    ise::result<int> good = 7;
    REQUIRE(good.has_value());
    CHECK(good.value() == 7);

    ise::result<int> bad = ise::failure(ise::errc::timed_out, "no answer from boat", ise::execution::unknown);
    REQUIRE_FALSE(bad.has_value());
    CHECK(bad.error().code() == ise::errc::timed_out);
    CHECK(bad.error().executed() == ise::execution::unknown);
    CHECK_THROWS_AS(bad.value(), ise::error);
}

TEST_CASE("an error code of ISE compares with its enumerator and names itself") {
    std::error_code code = ise::errc::peer_lost;
    CHECK(code == ise::errc::peer_lost);
    CHECK(code.message() == "peer_lost");
    CHECK(std::string(code.category().name()) == "ise");
}
