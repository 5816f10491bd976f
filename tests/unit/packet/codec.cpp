#include "examples.hpp"

#include <ise/packet/archive.hpp>
#include <ise/packet/schema.hpp>
#include <support/catch.hpp>

#include <array>
#include <unordered_set>

namespace codec_test {

using namespace example;
using ise_test::Contains;

TEST_CASE("every kind of field comes back as it was sent") {
    everything sent = filled();
    ise::bytes first = ise::encode(sent);
    auto got = ise::decode<everything>(first);
    CHECK(got.waypoints == sent.waypoints);
    CHECK(got.names == sent.names);
    CHECK(got.choice == sent.choice);
    CHECK(got.flags == sent.flags);
    CHECK(got.at == sent.at);
    CHECK(got.matrix[1][0] == 3);
    CHECK(ise::encode(got) == first);
}

TEST_CASE("the bytes and the fingerprint are these, from every compiler") {
    CHECK(hex(ise::encode(position{28.25, -15.5, 2.5F, 270, -12, 12600})) ==
          "0000000000403c400000000000002fc0000020400e01f4ff3831");
    CHECK(hex(ise::encode(filled())) ==
          "0178ff01000000000000000000003f00000000000000c0010400000076656c61020000000100000061000000000000f03f00"
          "0000000000004002000000626300000000000008400000000000001040020000000000803f00002040030000000100010200"
          "000001ffffff2c01010000000200000003000000040000000104000000686f6d650000000000003c400000000000002ec001"
          "060000007365636f6e6402000000040000006761696e000000000000e03f040000007472696d000000000000f0bf03000000"
          "0001010000007a010201000000780200010000007903000000010203fbffffff0171000000000000d03fdc05000000000000"
          "01e0b4ca515805006666666666263c406666666666e62ec000000040000000000000");
    CHECK(ise::schema_of<position>().fingerprint() == 0xc91b31cb3b2d65b8u);
    CHECK(ise::schema_of<everything>().fingerprint() == 0xb4faae4fd147a83bu);
}

TEST_CASE("unordered containers are written in one order") {
    std::unordered_set<std::string> a, b;
    for (int i = 0; i < 200; ++i) a.insert(std::to_string(i));
    for (int i = 199; i >= 0; --i) b.insert(std::to_string(i));
    b.rehash(4096);
    CHECK(ise::encode(a) == ise::encode(b));
    CHECK(ise::decode<std::unordered_set<std::string>>(ise::encode(a)) == a);
}

TEST_CASE("decode_into leaves nothing of what was there") {
    everything there = filled();
    ise::decode_into(there, ise::encode(everything{}));
    CHECK(ise::encode(there) == ise::encode(everything{}));
}

TEST_CASE("a buffer keeps its room when it is cleared") {
    ise::buffer out;
    ise::encode(filled(), out);
    auto capacity = out.capacity();
    auto* where = out.data();
    out.clear();
    ise::encode(filled(), out);
    CHECK(out.capacity() == capacity);
    CHECK(out.data() == where);
    out.append(std::uint32_t{0});
    out.patch_u32(out.size() - 4, 0x01020304);
    CHECK(hex(out.view().last(4)) == "04030201");
}

TEST_CASE("every prefix of a packet, and a byte too many, is refused") {
    ise::bytes whole = ise::encode(filled());
    for (std::size_t size = 0; size < whole.size(); ++size) {
        // Its own memory: ASan watches the end.
        ise::bytes cut(whole.begin(), whole.begin() + static_cast<std::ptrdiff_t>(size));
        auto got = ise::try_decode<everything>(cut);
        REQUIRE_FALSE(got.has_value());
        REQUIRE(got.error().code() == ise::errc::malformed);
        REQUIRE_THAT(got.error().message(), Contains("everything."));
    }
    whole.push_back(std::byte{0});
    CHECK(ise::try_decode<everything>(whole).error().message() == "everything: 1 byte too many behind its last field");
}

TEST_CASE("a flipped bit gives another packet or an error, nothing else") {
    ise::bytes whole = ise::encode(filled());
    std::size_t refused = 0;
    for (std::size_t bit = 0; bit < whole.size() * 8; ++bit) {
        ise::bytes flipped = whole;
        flipped[bit / 8] ^= static_cast<std::byte>(1u << bit % 8);
        auto got = ise::try_decode<everything>(flipped);
        if (!got) ++refused;
        else CHECK(ise::encode(*got).size() == whole.size());
    }
    CHECK(refused > 0);
}

namespace {
struct log_book {
    std::int32_t number = 0;
    std::vector<waypoint> waypoints;
    std::string name;
};
} // namespace

TEST_CASE("lengths that lie are one clear error that names type and field, and allocate nothing") {
    ise::bytes twelve(12, std::byte{0xff});
    CHECK(ise::try_decode<log_book>(twelve).error().message() ==
          "log_book.waypoints: claims 4294967295 elements of at least 20 bytes, 4 bytes are left");
    log_book book;
    book.waypoints.resize(4);
    ise::bytes lying = ise::encode(book);
    lying[8 + 3 * 20 + 3] = std::byte{0x7f}; // the length of the last name
    CHECK(ise::try_decode<log_book>(lying).error().message() ==
          "log_book.waypoints[3].name: claims 2130706432 bytes, 20 are left");
    CHECK(failure_of([&] { ise::decode<log_book>(lying); }).code() == ise::errc::malformed);
}

TEST_CASE("elements without size and fat elements are bounded too") {
    ise::bytes many(4, std::byte{0xff});
    auto got = ise::try_decode<std::vector<empty>>(many);
    REQUIRE_FALSE(got.has_value());
    CHECK(got.error().code() == ise::errc::too_large);
    CHECK_THAT(got.error().message(), Contains("at most 65536 are accepted in one packet (max_zero_size_elements)"));

    struct fat {
        std::optional<std::array<double, 4096>> table;
    };
    ise::buffer out;
    out.append(std::uint32_t{1} << 20);
    ise::bytes zeros(std::size_t{1} << 20);
    out.append(zeros);
    auto too_fat = ise::try_decode<std::vector<fat>>(out.view());
    REQUIRE_FALSE(too_fat.has_value());
    CHECK(too_fat.error().code() == ise::errc::too_large);
    CHECK_THAT(too_fat.error().message(), Contains("268435456 bytes that one packet may take (max_total_bytes)"));
}

TEST_CASE("arrays of no elements have no bytes, in a list and alone") {
    using none = std::array<std::uint32_t, 0>;
    std::vector<none> three(3);
    const auto raw = ise::encode(three);
    CHECK(raw.size() == 4);
    CHECK(ise::decode<std::vector<none>>(raw).size() == 3);
    struct alone {
        none nothing;
    };
    CHECK(ise::encode(alone()).empty());
    CHECK_FALSE(ise::try_decode<alone>(ise::bytes(1)).has_value());
}

TEST_CASE("keys that were chosen to have the same hash are refused before they take long") {
    std::unordered_set<std::uint64_t> honest;
    for (std::uint64_t key = 0; key < 100'000; ++key) honest.insert(key * 64);
    CHECK(ise::decode<std::unordered_set<std::uint64_t>>(ise::encode(honest)) == honest);
    using map = std::unordered_map<std::uint64_t, std::uint8_t>;
    map grown;
    for (std::uint64_t key = 0; key < 30'000; ++key) grown[key] = 1;
    std::map<std::uint64_t, std::uint8_t> alike; // the same bytes as of an unordered one
    for (std::uint64_t key = 0; key < 30'000; ++key) alike[key * grown.bucket_count()] = 1;
    const auto raw = ise::encode(alike);
    const auto got = ise::try_decode<map>(raw);
    REQUIRE_FALSE(got.has_value());
    CHECK(got.error().code() == ise::errc::too_large);
    CHECK_THAT(got.error().message(), Contains("too many keys with the same hash"));
}

TEST_CASE("flags other than 0 and 1, unknown alternatives and doubled keys are refused") {
    auto message = [](auto result) { return result.has_value() ? std::string("accepted") : result.error().message(); };
    ise::bytes two{std::byte{2}};
    CHECK_THAT(message(ise::try_decode<bool>(two)), Contains("must be 0 or 1, not 2"));
    CHECK_THAT(message(ise::try_decode<std::optional<int>>(two)), Contains("must be 0 or 1, not 2"));
    CHECK_THAT(message(ise::try_decode<std::variant<int, char>>(two)), Contains("alternative 2, only 0 to 1"));
    ise::bytes doubled = ise::encode(std::vector<std::uint8_t>{7, 7});
    CHECK_THAT(message(ise::try_decode<std::set<std::uint8_t>>(doubled)), Contains("[1]: is there twice"));
    ise::bytes unknown{std::byte{200}};
    CHECK(ise::decode<mode>(unknown) == static_cast<mode>(200)); // stays a number
}

// --- cereal -------------------------------------------------------------------------------------------------------
namespace {
class sealed {
public:
    int opened = 0;
    bool operator==(const sealed&) const = default;
    std::string note = "new";

private:
    friend class cereal::access;
    template <class Archive>
    void serialize(Archive& archive) {
        archive(cereal::make_nvp("opened", opened), note);
    }
};

struct split { // save and load apart
    std::uint16_t doubled = 0;
    template <class Archive>
    void save(Archive& archive) const {
        archive(static_cast<std::uint16_t>(doubled * 2));
    }
    template <class Archive>
    void load(Archive& archive) {
        std::uint16_t twice = 0;
        archive(twice);
        doubled = static_cast<std::uint16_t>(twice / 2);
    }
};

struct tree { // recursive: only its own functions know when it ends
    std::int32_t value = 0;
    std::vector<tree> children;
    template <class Archive>
    void save(Archive& archive) const {
        archive(value, static_cast<std::uint32_t>(children.size()));
        for (const auto& child : children) child.save(archive);
    }
    template <class Archive>
    void load(Archive& archive) {
        std::uint32_t count = 0;
        archive(value, count);
        for (std::uint32_t i = 0; i < count; ++i) children.emplace_back().load(archive);
    }
};

struct parcel {
    std::int32_t number = 1;
    sealed letter;
    std::vector<sealed> more;
    split part;
    tree family;
};
} // namespace
} // namespace codec_test

template <>
struct ise::opaque_type<codec_test::tree> {
    static constexpr std::string_view name = "test/tree";
    static constexpr std::uint32_t version = 2;
};

namespace codec_test {

TEST_CASE("types with a cereal serialize of their own travel inside packets") {
    parcel sent;
    sent.letter.opened = 5;
    sent.more.resize(2);
    sent.more[1].note = "old";
    sent.part.doubled = 21;
    sent.family.children.resize(2);
    sent.family.children[1].value = 9;
    auto got = ise::decode<parcel>(ise::encode(sent));
    CHECK(got.letter == sent.letter);
    CHECK(got.more == sent.more);
    CHECK(got.part.doubled == 21);
    CHECK(got.family.children.at(1).value == 9);
    CHECK(ise::schema_of<parcel>().text() ==
          "struct parcel{number:i32=01000000,letter:struct sealed{opened:i32,field_1:string=030000006e6577},"
          "more:vector<struct sealed{opened:i32,field_1:string=030000006e6577}>,part:struct split{field_0:u16},"
          "family:opaque<test/tree,2>=080000000000000000000000}");
}

TEST_CASE("an opaque type's bytes that end early or late are refused") {
    tree sent;
    sent.children.resize(3);
    ise::bytes good = ise::encode(sent);
    for (std::size_t size = 0; size < good.size(); ++size)
        CHECK_FALSE(ise::try_decode<tree>(ise::bytes_view(good).first(size)).has_value());
    good[8] = std::byte{1}; // fewer children than bytes
    CHECK_THAT(ise::try_decode<tree>(good).error().message(), Contains("another number of bytes"));
}

} // namespace codec_test
