#include <components/mail/mime.hpp>

#include <support/catch.hpp>

#include <fmt/format.h>

namespace mime_test {

using namespace atirma;

namespace {

constexpr std::string_view gateway_mail =
    "Return-Path: <sbdservice@sbd.iridium.com>\r\n"
    "Date: Tue, 13 Aug 2002 16:51:10 +0000\r\n"
    "From: \"Iridium SBD\" <sbdservice@sbd.iridium.com>\r\n"
    "To: boat@example.org, Second <other@example.org>\r\n"
    "Subject: SBD Msg From Unit: 300034010124740\r\n"
    "MIME-Version: 1.0\r\n"
    "Content-Type: multipart/mixed; boundary=\"SBD.Boundary.605592468\"\r\n"
    "\r\n"
    "--SBD.Boundary.605592468\r\n"
    "Content-Type: text/plain; charset=\"us-ascii\"\r\n"
    "\r\n"
    "MOMSN: 23\r\n"
    "Message is Attached.\r\n"
    "--SBD.Boundary.605592468\r\n"
    "Content-Type: application/x-zip-compressed; name=\"300034010124740_000023.sbd\"\r\n"
    "Content-Disposition: attachment; filename=\"300034010124740_000023.sbd\"\r\n"
    "Content-Transfer-Encoding: base64\r\n"
    "\r\n"
    "AAECAwQF\r\n"
    "/w==\r\n"
    "--SBD.Boundary.605592468--\r\n";

std::string replaced(std::string_view in, std::string_view what, std::string_view by) {
    std::string made(in);
    auto at = made.find(what);
    REQUIRE(at != std::string::npos);
    return made.replace(at, what.size(), by);
}

std::vector<std::byte> raw(std::initializer_list<int> values) {
    std::vector<std::byte> made;
    for (int v : values) made.push_back(static_cast<std::byte>(v));
    return made;
}

mail_message a_mail() {
    mail_message made;
    made.from = "shore@example.org";
    made.to = {"data@sbd.iridium.com"};
    made.subject = "300034010124740";
    return made;
}

} // namespace

TEST_CASE("a multipart mail is read with its sender, receivers, text and decoded attachment") {
    auto mail = read_mail(gateway_mail);
    REQUIRE(mail);
    CHECK(mail->from == "sbdservice@sbd.iridium.com");
    CHECK(mail->to == std::vector<std::string>{"boat@example.org", "other@example.org"});
    CHECK(mail->subject == "SBD Msg From Unit: 300034010124740");
    CHECK(mail->text == "MOMSN: 23\r\nMessage is Attached.");
    REQUIRE(mail->attachments.size() == 1);
    CHECK(mail->attachments[0].name == "300034010124740_000023.sbd");
    CHECK(mail->attachments[0].content == raw({0, 1, 2, 3, 4, 5, 255}));
}

TEST_CASE("a mail with single line feeds is read like one with carriage returns") {
    std::string text(gateway_mail);
    std::erase(text, '\r');
    auto mail = read_mail(text);
    REQUIRE(mail);
    CHECK(mail->attachments.at(0).content.size() == 7);
}

TEST_CASE("encoded words, quoted-printable and other charsets come out as UTF-8") {
    auto mail = read_mail("From: a@b.c\r\n"
                          "Subject: =?iso-8859-1?Q?Posici=F3n?= =?utf-8?B?IOKAkyBiYWhpYQ==?=\r\n"
                          "Content-Type: text/plain; charset=iso-8859-1\r\n"
                          "Content-Transfer-Encoding: quoted-printable\r\n\r\n"
                          "Ma=F1ana, a very =\r\nlong line\r\n");
    REQUIRE(mail);
    CHECK(mail->subject == "Posici\xc3\xb3n \xe2\x80\x93 bahia");
    CHECK(mail->text == "Ma\xc3\xb1"
                        "ana, a very long line\r\n");
}

TEST_CASE("an attachment with broken base64 is refused, not guessed") {
    auto broken = GENERATE(as<std::string>(), "AAECAwQ", "AAEC*wQF", "AA=CAwQF", "=AECAwQF");
    CAPTURE(broken);
    auto mail = read_mail(replaced(gateway_mail, "AAECAwQF\r\n/w==", broken));
    REQUIRE_FALSE(mail);
    CHECK(mail.error().code() == ise::errc::malformed);
    CHECK(mail.error().message().find("300034010124740_000023.sbd") != std::string::npos);
}

TEST_CASE("a mail that ends in the middle of its parts is refused") {
    auto cut = gateway_mail.substr(0, gateway_mail.find("/w=="));
    auto mail = read_mail(cut);
    REQUIRE_FALSE(mail);
    CHECK(mail.error().code() == ise::errc::malformed);
}

TEST_CASE("what is no mail is refused") {
    for (std::string text : {std::string(), std::string("\r\n\r\n"), std::string("nonsense"), std::string(5000, '\0'),
                             std::string(5000, '\xff'), std::string("Subject: nobody sent it\r\n\r\nx"),
                             std::string("From: not an address\r\n\r\nx")}) {
        auto mail = read_mail(text);
        REQUIRE_FALSE(mail);
        CHECK(mail.error().code() == ise::errc::malformed);
    }
}

TEST_CASE("a mail beyond the limits is refused before it costs memory") {
    mime_limits small;
    small.max_bytes = 100;
    CHECK(read_mail(gateway_mail, small).error().code() == ise::errc::too_large);
    small = mime_limits();
    small.max_parts = 1;
    CHECK(read_mail(gateway_mail, small).error().code() == ise::errc::too_large);
}

TEST_CASE("parts in parts without end are refused") {
    std::string text = "From: a@b.c\r\n";
    for (int depth = 0; depth < 5000; ++depth)
        text += "Content-Type: multipart/mixed; boundary=b" + std::to_string(depth) + "\r\n\r\n--b" +
                std::to_string(depth) + "\r\n";
    CHECK_FALSE(read_mail(text));
}

TEST_CASE("what is written is read back the same") {
    auto mail = a_mail();
    mail.to.push_back("second@example.org");
    mail.subject = "Gr\xc3\xbc\xc3\x9f"
                   "e \xe2\x9b\xb5";
    mail.text = "First line\r\n.\r\n..two dots, ma\xc3\xb1"
                "ana\r\n" +
                std::string(3000, 'x') + "\r\n";
    for (std::size_t size :
         {std::size_t{0}, std::size_t{1}, std::size_t{2}, std::size_t{3}, std::size_t{270}, std::size_t{5000}}) {
        mail_attachment one;
        one.name = fmt::format("m{}.sbd", size);
        for (std::size_t i = 0; i < size; ++i) one.content.push_back(static_cast<std::byte>(i * 7));
        mail.attachments.push_back(one);
    }
    mail_stamp stamp;
    stamp.sent_at = std::chrono::sys_days(std::chrono::year(2017) / 9 / 4) + std::chrono::hours(8);
    stamp.random = 0x1234;
    auto text = write_mail(mail, stamp);
    REQUIRE(text);
    CHECK(text->find("Date: Mon, 04 Sep 2017 08:00:00 +0000\r\n") != std::string::npos);
    std::size_t longest = 0;
    for (std::size_t at = 0; at < text->size();) {
        auto end = text->find('\n', at);
        REQUIRE(end != std::string::npos);
        REQUIRE((*text)[end - 1] == '\r');
        longest = std::max(longest, end - at);
        at = end + 1;
    }
    CHECK(longest <= 998);
    for (char c : *text) REQUIRE(static_cast<unsigned char>(c) < 128);

    auto again = read_mail(*text);
    REQUIRE(again);
    CHECK(again->from == mail.from);
    CHECK(again->to == mail.to);
    CHECK(again->subject == mail.subject);
    CHECK(again->text == mail.text);
    REQUIRE(again->attachments.size() == mail.attachments.size());
    for (std::size_t i = 0; i < mail.attachments.size(); ++i) {
        CHECK(again->attachments[i].name == mail.attachments[i].name);
        CHECK(again->attachments[i].content == mail.attachments[i].content);
    }
    CHECK(write_mail(mail, stamp).value() == *text); // a replay writes the same bytes
}

TEST_CASE("no header can be smuggled into a mail") {
    auto bad_from = a_mail(), bad_to = a_mail(), nobody = a_mail(), bad_subject = a_mail(), bad_name = a_mail(),
         bad_text = a_mail();
    bad_from.from = "a@b.c\r\nBcc: x@y.z";
    bad_to.to = {"a@b.c>\r\nRCPT TO:<x@y.z"};
    nobody.to.clear();
    bad_subject.subject = "one\nX-Two: 2";
    bad_name.attachments.push_back({"a\r\nb.sbd", raw({1})});
    bad_text.text = "\xff\xfe";
    for (const auto& mail : {bad_from, bad_to, nobody, bad_subject, bad_name, bad_text}) {
        auto text = write_mail(mail, mail_stamp());
        REQUIRE_FALSE(text);
        CHECK(text.error().code() == ise::errc::invalid_argument);
    }
}

} // namespace mime_test
