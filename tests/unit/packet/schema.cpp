#include "examples.hpp"

#include <ise/packet/adapt.hpp>
#include <ise/packet/fingerprint.hpp>
#include <ise/packet/schema.hpp>
#include <support/catch.hpp>

namespace schema_test {

using namespace example;
using ise_test::Contains;

namespace {
struct renamed_type { // waypoint under another name, with other defaults
    std::string name = "?";
    double latitude_deg = 1;
    double longitude_deg = 2;
};
struct renamed_field {
    std::string label;
    double latitude_deg = 0;
    double longitude_deg = 0;
};
struct outer_a {
    waypoint first;
    waypoint second{"x", 1, 2};
};

std::string refusal(std::string_view text, const ise::schema_limits& limits = {}) {
    auto parsed = ise::schema::parse(text, limits);
    return parsed.has_value() ? std::string("accepted") : parsed.error().message();
}
} // namespace

TEST_CASE("a fingerprint follows fields, not the names of types nor defaults") {
    auto wanted = ise::schema_of<waypoint>().fingerprint();
    CHECK(ise::schema_of<renamed_type>().fingerprint() == wanted);
    CHECK(ise::schema_of<renamed_field>().fingerprint() != wanted);
    CHECK_FALSE(ise::schema_of<renamed_type>() == ise::schema_of<waypoint>());
    CHECK(ise::fingerprint_of("") == 0xefd01f60ba992926u);
    CHECK(ise::schema_of<waypoint>().fingerprint() ==
          ise::fingerprint_of("struct{name:string,latitude_deg:f64,longitude_deg:f64}"));
}

TEST_CASE("a schema's text is parsed into the same schema") {
    for (const ise::schema& made : {ise::schema_of<everything>(), ise::schema_of<empty>(), ise::schema_of<outer_a>(),
                                    ise::schema_of<std::vector<std::optional<std::chrono::duration<double>>>>()}) {
        auto parsed = ise::schema::parse(made.text());
        INFO(made.text());
        REQUIRE(parsed.has_value());
        CHECK(*parsed == made);
        CHECK(parsed->fingerprint() == made.fingerprint());
        CHECK(parsed->name() == made.name());
    }
}

TEST_CASE("a schema reads well") {
    CHECK(ise::schema_of<outer_a>().pretty() == "struct outer_a {\n"
                                                "  first: struct waypoint {\n"
                                                "    name: string\n"
                                                "    latitude_deg: f64\n"
                                                "    longitude_deg: f64\n"
                                                "  }\n"
                                                "  second: struct waypoint {\n"
                                                "    name: string\n"
                                                "    latitude_deg: f64\n"
                                                "    longitude_deg: f64\n"
                                                "  }\n"
                                                "}");
    CHECK_THAT(ise::schema_of<outer_a>().text(),
               Contains("second:struct waypoint{name:string,latitude_deg:f64,longitude_deg:f64}="
                        "0100000078000000000000f03f0000000000000040"));
}

TEST_CASE("a schema text that is none says where and what was expected") {
    CHECK(refusal("struct{a:i32") == "schema text, character 12: expected '}', found the end");
    CHECK_THAT(refusal("struct{a:i33}"), Contains("character 9: expected a type, found 'i33}'"));
    CHECK_THAT(refusal("struct{a:i32,a:i32}"), Contains("a field name of its own"));
    CHECK_THAT(refusal("struct{a:i32=0102}"), Contains("needs 4 bytes, 2 are left"));
    CHECK_THAT(refusal("array<i32,01>"), Contains("without leading zeros"));
    CHECK_THAT(refusal("enum:u8{a=256}"), Contains("range"));
    CHECK_THAT(refusal("enum:f32{a=1}"), Contains("integer type"));
    CHECK_THAT(refusal("duration<i64,1/0>"), Contains("positive period"));
    CHECK_THAT(refusal("i32 "), Contains("expected the end"));
    CHECK_THAT(refusal("struct{a\xcf:i32}"), Contains("a name in UTF-8"));
    CHECK_THAT(refusal(""), Contains("found the end"));
    std::string whole = ise::schema_of<everything>().text();
    for (std::size_t size = 0; size < whole.size(); ++size)
        REQUIRE_FALSE(ise::schema::parse(std::string_view(whole).substr(0, size)).has_value());
}

TEST_CASE("arrays without bytes cost nothing, whatever they are of and however long") {
    const std::string empty = "array<array<array<string,0>,268435456>,268435456>";
    const auto many = ise::schema::parse("struct p{a:" + empty + "=}"); // its default is checked
    REQUIRE(many);
    const auto former = ise::schema::parse("struct p{}").value();
    const auto later = ise::schema::parse("struct p{a:" + empty + "}").value();
    CHECK(ise::adapter(later, former)(ise::bytes_view()).empty());
    CHECK(ise::adapter(former, later)(ise::bytes_view()).empty());
}

TEST_CASE("a hostile schema text is bounded in every direction, and each limit is told by its name") {
    auto repeated = [](std::string_view piece, std::size_t times) {
        std::string text;
        for (std::size_t i = 0; i < times; ++i) text += piece;
        return text;
    };
    auto beyond = [](const std::string& limit) { return Contains("are accepted (" + limit + ")"); };
    CHECK_THAT(refusal(repeated("vector<", 100000)),
               Contains("700000 bytes, at most 262144") && beyond("max_text_bytes"));
    CHECK_THAT(refusal(repeated("vector<", 1000)),
               Contains("nested too deep: levels, at most 64") && beyond("max_depth"));
    CHECK_THAT(refusal("tuple<" + repeated("i8,", 2000) + "i8>"), Contains("at most 1024") && beyond("max_members"));
    CHECK_THAT(refusal("struct{" +
                       [] {
                           std::string many;
                           for (int i = 0; i < 2000; ++i) many += "f" + std::to_string(i) + ":i8,";
                           return many;
                       }() +
                       "z:i8}"),
               Contains("too many fields, at most 1024") && beyond("max_members"));
    CHECK_THAT(refusal("enum:i32{" +
                       [] {
                           std::string many;
                           for (int i = 0; i < 5000; ++i)
                               many += "e" + std::to_string(i) + "=" + std::to_string(i) + ",";
                           return many;
                       }() +
                       "z=-1}"),
               Contains("too many enumerators, at most 4096") && beyond("max_enumerators"));
    CHECK_THAT(refusal("array<array<array<u64,200000000>,200000000>,200000000>"),
               Contains("too big") && beyond("max_min_size"));
    CHECK_THAT(refusal("array<struct{},18446744073709551615>"), Contains("too long") && beyond("max_array_length"));
    CHECK_THAT(refusal("struct{" + std::string(1000, 'n') + ":i8}"),
               Contains("at most 256") && beyond("max_name_bytes"));
    std::string fields = "struct{";
    for (int i = 0; i < 900; ++i) fields += "f" + std::to_string(i) + ":tuple<i8,i8,i8,i8,i8>,";
    CHECK_THAT(refusal(fields + "z:i8}"), Contains("too many types") && beyond("max_types"));
    ise::schema_limits small;
    small.max_text_bytes = 10;
    CHECK_THAT(refusal("struct{a:i32}", small), Contains("at most 10 are accepted (max_text_bytes)"));
}

} // namespace schema_test
