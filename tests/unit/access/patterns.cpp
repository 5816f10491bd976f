// Patterns of paths, services and identities.
#include <ise/access/pattern.hpp>
#include <support/catch.hpp>

#include <string>

namespace patterns_test {

using ise::access::pattern;
using ise_test::Contains;

namespace {

bool matches(const std::string& of, const std::string& text) { return pattern::parse(of).value().matches(text); }

std::string objection(const std::string& of) {
    auto made = pattern::parse(of);
    return made ? std::string() : made.error().message();
}

} // namespace

TEST_CASE("access: a pattern without a wildcard is the text itself") {
    CHECK(matches("atirma/boat", "atirma/boat"));
    CHECK_FALSE(matches("atirma/boat", "atirma/boat2"));
    CHECK_FALSE(matches("atirma/boat", "atirma/boa"));
    CHECK_FALSE(matches("atirma/boat", ""));
    CHECK(pattern::parse("atirma/boat").value().plain());
    CHECK_FALSE(pattern::parse("atirma/*").value().plain());
}

TEST_CASE("access: * stays within a segment, ** does not") {
    CHECK(matches("atirma/*", "atirma/boat"));
    CHECK_FALSE(matches("atirma/*", "atirma/shore/xbee"));
    CHECK_FALSE(matches("atirma/*", "atirma"));
    CHECK(matches("atirma/**", "atirma/shore/xbee"));
    CHECK_FALSE(matches("atirma/**", "atirma"));
    CHECK(matches("**", "atirma/shore/xbee"));
    CHECK(matches("*-proxy", "xbee-proxy"));
    CHECK_FALSE(matches("*-proxy", "shore/xbee-proxy"));
    CHECK(matches("**/xbee", "atirma/shore/xbee"));
    CHECK(matches("atirma/*/xbee", "atirma/shore/xbee"));
    CHECK_FALSE(matches("atirma/*/xbee", "atirma/shore/far/xbee"));
    CHECK(matches("atirma/**/xbee", "atirma/shore/far/xbee"));
    CHECK(matches("a**b*c", "axx/yybzzc"));
    CHECK_FALSE(matches("a**b*c", "axx/yybz/zc"));
    CHECK(matches("a**b*c", "axbx/bzzc"));
    CHECK(matches("ise://atirma/operator/*", "ise://atirma/operator/ana"));
    CHECK_FALSE(matches("ise://atirma/operator/*", "ise://atirma/operator/ana/key"));
    CHECK_FALSE(matches("ise://*/web", "ise://atirma/x/web"));
}

TEST_CASE("access: braces are one of several") {
    CHECK(matches("{telecommand,authority}", "telecommand"));
    CHECK(matches("{telecommand,authority}", "authority"));
    CHECK_FALSE(matches("{telecommand,authority}", "telecommand,authority"));
    CHECK(matches("atirma/{boat,shore/*}/{a,b}", "atirma/shore/x/b"));
    CHECK(matches("x{,y}", "x"));
    CHECK(pattern::parse("{a,b}{c,d}").value().alternatives().size() == 4);
    CHECK_THAT(objection("{a,b"), Contains("a '{' without its '}'"));
    CHECK_THAT(objection("a}"), Contains("a '}' without its '{'"));
    CHECK_THAT(objection("{a,{b}}"), Contains("braces within braces"));
    CHECK_THAT(objection("{a,b}{a,b}{a,b}{a,b}{a,b}{a,b}{a,b}"), Contains("unfold to more than 64"));
    CHECK_THAT(objection(""), Contains("empty"));
    CHECK_THAT(objection(std::string(513, 'a')), Contains("512 are allowed"));
}

TEST_CASE("access: a pattern full of wildcards is decided at once") {
    std::string stars, text(400, 'a');
    for (int at = 0; at < 100; ++at) stars += "a*";
    for (int at = 0; at < 20; ++at) stars += "**a";
    CHECK_FALSE(matches(stars + "b", text));
}

} // namespace patterns_test
