#include "examples.hpp"

#include <ise/packet/archive.hpp>
#include <ise/packet/bounded.hpp>
#include <ise/packet/json.hpp>

#include <support/catch.hpp>

#include <cereal/archives/binary.hpp>
#include <cereal/archives/portable_binary.hpp>
#include <cereal/archives/xml.hpp>
#include <cereal/types/list.hpp>
#include <cereal/types/memory.hpp>

// Debian's rapidjson 1.1.0, which its cereal uses, does not compile with clang from 19 on.
#if !defined(__clang__) || __clang_major__ < 19
    #include <cereal/archives/json.hpp>
    #define ISE_TEST_CEREAL_JSON
#endif

#include <cmath>
#include <limits>
#include <list>
#include <memory>
#include <sstream>
#include <unordered_set>

namespace cereal_test {

using namespace example;
using ise_test::Contains;

namespace {

struct xml {
    using output = cereal::XMLOutputArchive;
    using input = cereal::XMLInputArchive;
};
struct portable_binary {
    using output = cereal::PortableBinaryOutputArchive;
    using input = cereal::PortableBinaryInputArchive;
};
struct binary {
    using output = cereal::BinaryOutputArchive;
    using input = cereal::BinaryInputArchive;
};
#ifdef ISE_TEST_CEREAL_JSON
struct json {
    using output = cereal::JSONOutputArchive;
    using input = cereal::JSONInputArchive;
};
    #define ISE_TEST_ARCHIVES json, xml, portable_binary, binary
#else
    #define ISE_TEST_ARCHIVES xml, portable_binary, binary
#endif

template <class Archive, class T>
std::string saved(const T& value) {
    std::ostringstream stream;
    {
        typename Archive::output archive(stream);
        archive(value);
    }
    return stream.str();
}

template <class Archive, class T>
T loaded(const std::string& text) {
    std::istringstream stream(text);
    typename Archive::input archive(stream);
    T value{};
    archive(value);
    return value;
}

/// What comes back is what was sent if both have the same bytes on the wire.
template <class Archive, class T>
void check_round_trip(const T& sent) {
    auto got = loaded<Archive, T>(saved<Archive>(sent));
    CHECK(ise::to_json(got) == ise::to_json(sent));
    CHECK(ise::encode(got) == ise::encode(sent));
}

enum class below : std::int8_t { least = -1, most = 1 };

/// What `everything` lacks, and values at the edges.
struct edges {
    char none = 0;
    char blank = ' ';
    char name[4] = {'a', 0, 'b', 0};
    std::vector<char> letters{'<', '\0', ' '};
    std::string text = " a<\"&>\n\t ";
    std::int64_t lowest = std::numeric_limits<std::int64_t>::min();
    std::uint64_t highest = std::numeric_limits<std::uint64_t>::max();
    double not_a_number = std::nan("");
    double infinite = -std::numeric_limits<double>::infinity();
    double smallest = std::numeric_limits<double>::denorm_min();
    double largest = std::numeric_limits<double>::max();
    double third = 1.0 / 3;
    float tenth = 0.1F;
    ise::bounded<double, 0, 360, "degrees"> heading = 90;
    ise::bounded<std::uint8_t, 0, 9> digit = 7;
    std::optional<std::optional<int>> absent_inside = std::optional<int>();
    std::unordered_set<std::string> words{"a", "b"};
    std::map<below, waypoint> by_enum{{below::least, {"w", 1, 2}}};
    std::array<waypoint, 2> both{};
    std::variant<empty, std::vector<mode>> choice = std::vector{mode::manual, static_cast<mode>(99)};
    std::tuple<> nothing;
    std::chrono::duration<float> span{1.5F};
    std::chrono::system_clock::time_point at{std::chrono::nanoseconds(-1)};
};

struct only_a_base : position {};

} // namespace

TEMPLATE_TEST_CASE("every packet goes through every archive of cereal, and comes back", "", ISE_TEST_ARCHIVES) {
    check_round_trip<TestType>(filled());
    check_round_trip<TestType>(everything());
    check_round_trip<TestType>(edges());
    check_round_trip<TestType>(empty());
    check_round_trip<TestType>(only_a_base{{1, 2, 3, 4, 5, 6}});
    check_round_trip<TestType>(std::vector<waypoint>{{"a", 1, 2}, {"b", 3, 4}});
}

namespace {
struct by_hand { // as `waypoint`, in the words of cereal's users
    std::string name;
    double latitude_deg = 0;
    double longitude_deg = 0;
    template <class Archive>
    void serialize(Archive& archive) {
        archive(CEREAL_NVP(name), CEREAL_NVP(latitude_deg), CEREAL_NVP(longitude_deg));
    }
};
} // namespace

TEMPLATE_TEST_CASE("a plain struct is what a serialize by hand would make of it", "", ISE_TEST_ARCHIVES) {
    const auto text = saved<TestType>(waypoint{"buoy", 28.5, -15});
    CHECK(text == saved<TestType>(by_hand{"buoy", 28.5, -15}));
    CHECK(loaded<TestType, by_hand>(text).latitude_deg == 28.5);
}

namespace {
struct beside { // no packet of ISE's: a list, and a packet in it
    std::list<waypoint> all;
    template <class Archive>
    void serialize(Archive& archive) {
        archive(all);
    }
};
struct spelled { // its functions are in namespace cereal, where cereal's manual puts them
    int number = 3;
};
struct as_number {
    int number = 4;
};
struct befriending {
    int number = 5;

private:
    friend class cereal::access;
    template <class Archive>
    void serialize(Archive& archive) {
        archive(cereal::make_nvp("hidden", number));
    }
};
struct versioned {
    int number = 6;
};
struct at_once {
    int number = 7;
};
struct guests {
    befriending secret;
    versioned old;
    at_once whole;
    spelled first;
    as_number second;
    std::vector<as_number> more{{}, {}};
};
} // namespace
} // namespace cereal_test

namespace cereal {
template <class Archive>
void save(Archive& archive, const cereal_test::spelled& value) {
    archive(make_nvp("doubled", 2 * value.number));
}
template <class Archive>
void load(Archive& archive, cereal_test::spelled& value) {
    int doubled = 0;
    archive(make_nvp("doubled", doubled));
    value.number = doubled / 2;
}
template <class Archive>
std::string save_minimal(const Archive&, const cereal_test::as_number& value) {
    return "n" + std::to_string(value.number);
}
template <class Archive>
void load_minimal(const Archive&, cereal_test::as_number& value, const std::string& text) {
    value.number = std::stoi(text.substr(1));
}
template <class Archive>
void serialize(Archive& archive, cereal_test::versioned& value, std::uint32_t version) {
    if (version == 0) archive(make_nvp("of_version_0", value.number));
}
template <class Archive>
void serialize(Archive& archive, cereal_test::at_once& value) {
    archive(make_nvp("at_once", value.number));
}
} // namespace cereal

namespace cereal_test {

TEMPLATE_TEST_CASE("functions that an author wrote for cereal win over reflection", "", ISE_TEST_ARCHIVES) {
    beside list;
    list.all = {{"a", 1, 2}, {"b", 3, 4}};
    CHECK(loaded<TestType, beside>(saved<TestType>(list)).all == list.all);
    guests sent;
    sent.secret.number = 6;
    sent.old.number = sent.whole.number = 8;
    sent.first.number = 21;
    sent.more[1].number = -5;
    check_round_trip<TestType>(sent);
}

TEST_CASE("the names of fields are those of the elements in XML, and an enum is its number") {
    const auto text = saved<xml>(filled());
    CHECK_THAT(text, Contains("<latitude_deg>28</latitude_deg>") && Contains("<helm>1</helm>"));
    CHECK_THAT(saved<xml>(guests()), Contains("<hidden>5</hidden>") && Contains("<of_version_0>6</of_version_0>") &&
                                         Contains("<at_once>7</at_once>") && Contains("<doubled>6</doubled>") &&
                                         Contains("<second>n4</second>"));
}

TEST_CASE("XML that is cut or lacks a field is an exception that says so") {
    auto text = saved<xml>(waypoint{"buoy", 28.5, -15});
    CHECK_THROWS(loaded<xml, waypoint>(text.substr(0, text.size() / 2)));
    text.replace(text.find("<longitude_deg>"), 15, "<longitude_rad>");
    text.replace(text.find("</longitude_deg>"), 16, "</longitude_rad>");
    CHECK_THROWS_WITH((loaded<xml, waypoint>(text)), Contains("longitude_deg"));
}

TEST_CASE("a number outside of its range is refused by cereal's archives, too") {
    auto text = saved<xml>(edges());
    text.replace(text.find("<heading>90<"), 12, "<heading>361<");
    CHECK_THROWS_WITH((loaded<xml, edges>(text)), Contains("361 is outside of 0 to 360 (degrees)"));
}

#ifdef ISE_TEST_CEREAL_JSON
TEST_CASE("JSON by cereal has the fields by their names, and reads them in any order") {
    CHECK(saved<json>(waypoint{"buoy", 28.5, -15}) == R"({
    "value0": {
        "name": "buoy",
        "latitude_deg": 28.5,
        "longitude_deg": -15.0
    }
})");
    auto got = loaded<json, waypoint>(R"({"value0": {"longitude_deg": -15, "name": "buoy", "latitude_deg": 28.5}})");
    CHECK(got == waypoint{"buoy", 28.5, -15});
}

TEST_CASE("JSON that is cut, lacks a field or has another type is an exception that says so") {
    CHECK_THROWS_AS((loaded<json, waypoint>(R"({"value0": {"name": "buoy", "lat)")), cereal::RapidJSONException);
    CHECK_THROWS_WITH((loaded<json, waypoint>(R"({"value0": {"name": "buoy", "latitude_deg": 28.5}})")),
                      Contains("longitude_deg"));
    CHECK_THROWS_AS((loaded<json, waypoint>(R"({"value0": {"name": 7, "latitude_deg": 1, "longitude_deg": 2}})")),
                    cereal::RapidJSONException);
}
#endif

TEST_CASE("ISE's wire archive is a pair of cereal archives: the bytes are those of encode") {
    ise::buffer out;
    ise::output_archive to(out);
    to(filled(), std::int32_t{7});
    to << edges();
    auto packet = ise::encode(filled());
    CHECK(hex(out.view()) == hex(packet) + "07000000" + hex(ise::encode(edges())));

    everything got;
    std::int32_t seven = 0;
    edges last;
    ise::input_archive from(out.view());
    from(got, seven) >> last;
    CHECK(ise::encode(got) == packet);
    CHECK(seven == 7);
    CHECK(ise::encode(last) == ise::encode(edges()));
}

TEST_CASE("ISE's archive refuses bytes that lie, with the field, as decode does") {
    auto packet = ise::encode(filled());
    for (std::size_t size = 0; size < packet.size(); ++size) {
        everything got;
        ise::input_archive from(ise::bytes_view(packet).first(size));
        auto why = failure_of([&] { from(got); });
        REQUIRE(why.code() == ise::errc::malformed);
        REQUIRE(why.message() == ise::try_decode<everything>(ise::bytes_view(packet).first(size)).error().message());
    }
    ise::decode_limits few;
    few.max_total_bytes = 100;
    std::vector<std::uint64_t> many;
    auto long_one = ise::encode(std::vector<std::uint64_t>(13));
    ise::input_archive limited(long_one, few);
    CHECK(failure_of([&] { limited(many); }).code() == ise::errc::too_large);
}

namespace {
struct stubborn { // goes on where its reading failed
    std::vector<std::uint64_t> values;
    template <class Archive>
    void save(Archive& archive) const {
        archive(values);
    }
    template <class Archive>
    void load(Archive& archive) {
        try {
            archive(values);
        } catch (const std::exception&) {
            values.clear();
        }
    }
};
} // namespace

TEST_CASE("a packet that lies is refused even if the type's own load takes no notice") {
    auto lying = ise::encode(stubborn());
    lying[0] = std::byte{0xff};
    auto got = ise::try_decode<stubborn>(lying);
    REQUIRE_FALSE(got.has_value());
    CHECK_THAT(got.error().message(), Contains("claims 255 elements"));
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
    CHECK_THAT(deep.error().message(), Contains("the 64 levels that are accepted (max_depth)"));
    ise::bytes whole = nested(3);
    for (std::size_t size = 0; size < whole.size(); ++size)
        CHECK_FALSE(ise::try_decode<chain>(ise::bytes_view(whole).first(size)).has_value());
}

} // namespace cereal_test
