#include <ise/core/result.hpp>

#include <support/catch.hpp>

#include <memory>
#include <stdexcept>

namespace result_test {

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

TEST_CASE("a result is copied, moved and assigned as what it holds, and destroys it once") {
    auto shared = std::make_shared<int>(3);
    auto lost = [] {
        return ise::result<std::shared_ptr<int>>(
            ise::failure(ise::errc::peer_lost, "gone with the wind, and far away"));
    };
    {
        ise::result<std::shared_ptr<int>> first = shared;
        auto copy = first;
        CHECK(shared.use_count() == 3);
        auto moved = std::move(first);
        CHECK(shared.use_count() == 3);
        copy = lost();
        CHECK(shared.use_count() == 2);
        CHECK(copy.error().message() == "gone with the wind, and far away");
        auto failed = copy;
        CHECK(failed.error().code() == ise::errc::peer_lost);
        copy = moved;
        CHECK(**copy == 3);
        failed = std::move(copy);
        auto& same = moved;
        moved = same;
        CHECK(*moved == shared);
        CHECK(shared.use_count() == 3);
    }
    CHECK(shared.use_count() == 1);
    STATIC_REQUIRE_FALSE(std::is_copy_constructible_v<ise::result<std::unique_ptr<int>>>);
    STATIC_REQUIRE(std::is_nothrow_move_constructible_v<ise::result<std::unique_ptr<int>>>);
}

namespace {
struct heavy {
    heavy() = default;
    heavy(const heavy&) = default;
    heavy(heavy&& other) : throws(other.throws) {
        if (throws) throw std::runtime_error("too heavy");
    }
    bool throws = false;
};
} // namespace

TEST_CASE("a result whose value could not be moved in has none, and can be assigned again") {
    ise::result<heavy> to = ise::failure(ise::errc::refused, "no");
    ise::result<heavy> from = heavy();
    from->throws = true;
    CHECK_THROWS_AS(to = from, std::runtime_error);
    REQUIRE_FALSE(to.has_value());
    CHECK(to.error().code() == ise::errc::cancelled);
    to = ise::result<heavy>(heavy());
    CHECK(to.has_value());
}

TEST_CASE("an error code of ISE compares with its enumerator and names itself") {
    std::error_code code = ise::errc::peer_lost;
    CHECK(code == ise::errc::peer_lost);
    CHECK(code.message() == "peer_lost");
    CHECK(std::string(code.category().name()) == "ise");
}

} // namespace result_test
