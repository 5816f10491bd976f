#include <components/coast/coast.hpp>

#include <support/catch.hpp>

namespace coast_test {

using namespace atirma;

TEST_CASE("coast: the island is the greatest ring, closed and where it is") {
    const auto& rings = coast_rings();
    REQUIRE_FALSE(rings.empty());
    CHECK(rings.front().name == "Gran Canaria");
    CHECK(rings.front().points.size() > 500);
    for (const auto& ring : rings) {
        CHECK(ring.points.size() <= rings.front().points.size());
        CHECK(ring.points.front().latitude_deg == ring.points.back().latitude_deg);
        CHECK(ring.points.front().longitude_deg == ring.points.back().longitude_deg);
        for (const auto& p : ring.points) {
            bool near =
                p.latitude_deg > 27.6 && p.latitude_deg < 28.4 && p.longitude_deg > -16 && p.longitude_deg < -15.2;
            if (!near) FAIL("a point at " << p.latitude_deg << ", " << p.longitude_deg);
        }
    }
    CHECK(coast_attribution().find("LGPL") != std::string::npos);
    CHECK(&coast_rings() == &rings);
}

} // namespace coast_test
