#include <components/mail/imap_replies.hpp>
#include <components/mail/imap_text.hpp>
#include <components/mail/smtp_text.hpp>

#include <support/catch.hpp>

namespace imap_test {

using namespace atirma;
using kind = imap_reply::kind;

namespace {

std::vector<imap_reply> all(imap_replies& from) {
    std::vector<imap_reply> found;
    for (;;) {
        auto next = from.next();
        REQUIRE(next);
        if (!*next) return found;
        found.push_back(**next);
    }
}

} // namespace

TEST_CASE("replies are told apart, in pieces of any size") {
    std::string stream = "* OK [CAPABILITY IMAP4rev1] hello\r\n"
                         "+ idling\r\n+\r\n"
                         "* 5 FETCH (UID 7 BODY[]<0> {12}\r\nA1 OK {3}\r\n* X FLAGS ())\r\n"
                         "* LIST () \"/\" {3}\r\nabc {2}\r\n\r\n x\r\n"
                         "T7 NO [TRYCREATE] no such folder\r\n";
    auto piece = GENERATE(range(1, 40));
    imap_replies parser;
    std::vector<imap_reply> found;
    for (std::size_t at = 0; at < stream.size(); at += static_cast<std::size_t>(piece)) {
        parser.push(ise::as_bytes(std::string_view(stream).substr(at, static_cast<std::size_t>(piece))));
        for (auto& one : all(parser)) found.push_back(std::move(one));
    }
    REQUIRE(found.size() == 6);
    CHECK(found[0].text == "OK [CAPABILITY IMAP4rev1] hello");
    CHECK((found[1].what == kind::continuation && found[1].text == "idling"));
    CHECK((found[2].what == kind::continuation && found[2].text.empty()));
    CHECK(found[3].literals == std::vector<std::string>{"A1 OK {3}\r\n*"});
    CHECK(found[3].text == "5 FETCH (UID 7 BODY[]<0> {12} X FLAGS ())");
    CHECK(found[4].literals == std::vector<std::string>{"abc", "\r\n"});
    CHECK((found[5].what == kind::tagged && found[5].tag == "T7" && imap_begins(found[5].text, "no")));
}

TEST_CASE("a line or a literal without end is refused before it is held") {
    imap_limits limits;
    limits.max_line_bytes = 100;
    limits.max_literal_bytes = 1000;
    imap_replies line(limits), literal(limits), literals(limits), overflow(limits);
    line.push(ise::as_bytes(std::string(101, 'x')));
    literal.push(ise::as_bytes("* 1 FETCH (BODY[] {1001}\r\n"));
    literals.push(ise::as_bytes("* 1 FETCH (A {600}\r\n" + std::string(600, 'x') + " B {600}\r\n"));
    overflow.push(ise::as_bytes("* 1 FETCH (BODY[] {4294967295}\r\n"));
    for (auto* parser : {&line, &literal, &literals, &overflow}) {
        auto broken = parser->next();
        REQUIRE_FALSE(broken);
        CHECK(broken.error().code() == ise::errc::too_large);
        parser->push(ise::as_bytes("* OK\r\n"));
        CHECK_FALSE(parser->next()); // it stays broken
    }
}

TEST_CASE("what is no reply of IMAP breaks the stream") {
    for (std::string_view text : {"\r\n", " x\r\n", "HTTP/1.1\r\n", "*\r\n"}) {
        imap_replies parser;
        parser.push(ise::as_bytes(text));
        auto broken = parser.next();
        REQUIRE_FALSE(broken);
        CHECK(broken.error().code() == ise::errc::malformed);
    }
}

TEST_CASE("the words of replies") {
    CHECK(imap_found("SEARCH 3 5 4294967295") == std::vector<std::uint32_t>{3, 5, 4294967295u});
    CHECK(imap_found("search") == std::vector<std::uint32_t>{});
    CHECK_FALSE(imap_found("SEARCH 3 x"));
    CHECK_FALSE(imap_found("SEARCH 0"));
    CHECK_FALSE(imap_found("SEARCH 4294967296"));
    CHECK_FALSE(imap_found("LIST 3"));
    CHECK(imap_exists("12 EXISTS") == 12u);
    CHECK_FALSE(imap_exists("12 EXPUNGE"));
    CHECK_FALSE(imap_exists("EXISTS"));
    CHECK(imap_code("OK [UIDVALIDITY 17] UIDs valid", "uidvalidity") == "17");
    CHECK(imap_code("NO [TRYCREATE] no", "TRYCREATE") == "");
    CHECK_FALSE(imap_code("OK [UIDNEXT 17]", "UIDVALIDITY"));
    CHECK_FALSE(imap_code("OK [UIDVALIDITY 17", "UIDVALIDITY"));
    CHECK(imap_has_capability("CAPABILITY IMAP4rev1 IDLE MOVE", "move"));
    CHECK_FALSE(imap_has_capability("CAPABILITY IMAP4rev1 REMOVE", "MOVE"));
    CHECK(imap_fetched_uid("5 FETCH (UID 7 BODY[]<0> {12})") == 7u);
    CHECK(imap_fetched_uid("5 FETCH (FLAGS (\\Seen) BODY[] {12} UID 7)") == 7u);
    CHECK_FALSE(imap_fetched_uid("5 FETCH (FLAGS (\\Seen))"));
    CHECK(imap_quoted("a \"b\" \\c").value() == "\"a \\\"b\\\" \\\\c\"");
    CHECK(imap_quoted("a\r\nb").error().code() == ise::errc::invalid_argument);
    CHECK(imap_shown(std::string(300, 'x') + "\x1b").size() == 203);
}

TEST_CASE("replies of SMTP, of one line and of several") {
    smtp_replies parser;
    std::string stream = "250-localhost\r\n250-SIZE 1000\r\n250 HELP\r\n354\r\n550 5.1.1 no\n451 later\r\n";
    std::vector<smtp_reply> found;
    for (char c : stream) {
        parser.push(ise::as_bytes(std::string_view(&c, 1)));
        auto next = parser.next();
        REQUIRE(next);
        if (*next) found.push_back(**next);
    }
    REQUIRE(found.size() == 4);
    CHECK((found[0].code == 250 && found[0].is_good() && found[0].text == "250-localhost 250-SIZE 1000 250 HELP"));
    CHECK(found[1].is_good());
    CHECK((found[2].is_final() && found[2].text == "550 5.1.1 no"));
    CHECK((!found[3].is_good() && !found[3].is_final()));
    for (std::string_view text : {"25\r\n", "hello\r\n", "150 x\r\n", "600 x\r\n", "250x\r\n", "\r\n"}) {
        smtp_replies other;
        other.push(ise::as_bytes(text));
        CHECK(other.next().error().code() == ise::errc::malformed);
    }
    smtp_replies endless(100);
    endless.push(ise::as_bytes(std::string(101, '2')));
    CHECK(endless.next().error().code() == ise::errc::too_large);
}

TEST_CASE("no line of a mail ends it, and none stands alone without its carriage return") {
    CHECK(smtp_content("a\r\n.\r\n..\r\n.x\nlast") == "a\r\n..\r\n...\r\n..x\r\nlast\r\n");
    CHECK(smtp_content("").empty());
}

} // namespace imap_test
