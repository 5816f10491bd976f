#include "examples.hpp"

#include <ise/packet/archive.hpp>

#include <support/catch.hpp>

#include <cereal/archives/portable_binary.hpp>
#include <cereal/types/memory.hpp>
#include <cereal/types/string.hpp>
#include <cereal/types/vector.hpp>

#include <memory>
#include <sstream>

namespace cereal_test {

using namespace example;

TEST_CASE("a plain struct goes through cereal's own archives as well") {
    waypoint sent{"buoy", 28.5, -15};
    std::stringstream stream;
    {
        cereal::PortableBinaryOutputArchive out(stream);
        out(sent);
    }
    waypoint got;
    cereal::PortableBinaryInputArchive in(stream);
    in(got);
    CHECK(got == sent);
}

namespace {
struct chain { // by pointer: only cereal knows how to follow it
    std::vector<waypoint> here;
    std::unique_ptr<chain> next;
    template <class Archive>
    void serialize(Archive& archive) {
        archive(here, next);
    }
};
} // namespace
} // namespace cereal_test

template <>
struct ise::opaque_type<cereal_test::chain> {
    static constexpr std::string_view name = "test/chain";
    static constexpr std::uint32_t version = 1;
};

namespace cereal_test {

TEST_CASE("cereal's own functions run on ISE's archive, as deep as is allowed and no deeper") {
    auto nested = [](int levels) {
        chain first;
        chain* last = &first;
        for (int i = 0; i < levels; ++i) {
            last->next = std::make_unique<chain>();
            last = last->next.get();
            last->here = {{"w", double(i), 0}};
        }
        return ise::encode(first);
    };
    auto got = ise::decode<chain>(nested(3));
    REQUIRE(got.next);
    REQUIRE(got.next->next);
    CHECK(got.next->next->here.at(0).latitude_deg == 1);

    auto deep = ise::try_decode<chain>(nested(2000));
    REQUIRE_FALSE(deep.has_value());
    CHECK(deep.error().code() == ise::errc::too_large);
    CHECK_THAT(deep.error().message(), Catch::Matchers::Contains("the 64 levels that are accepted (max_depth)"));
    ise::bytes whole = nested(3);
    for (std::size_t size = 0; size < whole.size(); ++size)
        CHECK_FALSE(ise::try_decode<chain>(ise::bytes_view(whole).first(size)).has_value());
}

} // namespace cereal_test
