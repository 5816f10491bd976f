#include <components/iridium_mail/mail_fields.hpp>
#include <components/iridium_mail/mail_format.hpp>
#include <components/mail/mime.hpp>

#include <support/catch.hpp>

namespace format_test {

using namespace atirma;
using namespace atirma::iridium_mail;
using namespace std::chrono_literals;

namespace {

std::vector<std::byte> bytes_of(std::size_t count) {
    std::vector<std::byte> made;
    for (std::size_t i = 0; i < count; ++i) made.push_back(static_cast<std::byte>(i));
    return made;
}

/// The example of the gateway's documentation.
mail_message documented() {
    mail_message made;
    made.from = "sbdservice@sbd.iridium.com";
    made.to = {"boat@example.org"};
    made.subject = "SBD Msg From Unit: 300034010124740";
    made.text = "MOMSN: 23\r\nMTMSN: 0\r\nTime of Session (UTC): Tue Aug 13 16:51:04 2002\r\nSession Status: 00 - "
                "TRANSFER OK\r\n"
                "Message Size (bytes): 351\r\n\r\nUnit Location: Lat = 59.372463 Long = 75.309806\r\nCEPradius = "
                "3\r\n\r\nMessage is Attached.\r\n";
    made.attachments.push_back({"300034010124740_000023.sbd", bytes_of(351)});
    return made;
}

void replace(std::string& in, std::string_view what, std::string_view by) {
    auto at = in.find(what);
    REQUIRE(at != std::string::npos);
    in.replace(at, what.size(), by);
}

mo_session session_in(const mail_message& mail) {
    auto read = read_gateway_mail(mail);
    REQUIRE(read);
    REQUIRE(std::holds_alternative<mo_session>(*read));
    return std::get<mo_session>(*read);
}

ise::failure refusal(const mail_message& mail) {
    auto read = read_gateway_mail(mail);
    REQUIRE_FALSE(read);
    return read.error();
}

bool says(const ise::failure& why, std::string_view what) { return why.message().find(what) != std::string::npos; }

} // namespace

TEST_CASE("a mail of the gateway is a session of a unit") {
    auto session = session_in(documented());
    CHECK(session.imei == "300034010124740");
    CHECK(session.momsn == 23);
    CHECK(session.mtmsn == 0);
    CHECK(session.session_at == std::chrono::sys_days(std::chrono::year(2002) / 8 / 13) + 16h + 51min + 4s);
    CHECK(session.status == session_status::ok);
    CHECK(session.size == 351);
    CHECK(session.latitude_deg == Approx(59.372463));
    CHECK(session.longitude_deg == Approx(75.309806));
    CHECK(session.cep_km == Approx(3));
    CHECK(session.payload == bytes_of(351));
}

TEST_CASE("the lines of the location may be absent, and line ends single") {
    auto mail = documented();
    replace(mail.text, "Unit Location: Lat = 59.372463 Long = 75.309806\r\nCEPradius = 3\r\n", "");
    std::erase(mail.text, '\r');
    auto session = session_in(mail);
    CHECK_FALSE(session.latitude_deg);
    CHECK_FALSE(session.longitude_deg);
    CHECK_FALSE(session.cep_km);
    CHECK(session.payload.size() == 351);
}

TEST_CASE("a mailbox check is a session without a message") {
    auto mail = documented();
    replace(mail.text, "351", "0");
    replace(mail.text, "MTMSN: 0", "MTMSN: 4711");
    mail.attachments.clear();
    auto session = session_in(mail);
    CHECK(session.size == 0);
    CHECK(session.payload.empty());
    CHECK(session.mtmsn == 4711);
}

TEST_CASE("a session that failed is told without a message") {
    auto status = GENERATE(as<std::string>(), "10 - TIMEOUT", "12 - MO TOO LARGE", "13 - INCOMPLETE TRANSFER",
                           "14 - PROTOCOL ERROR", "15 - ACCESS DENIAL", "40");
    auto mail = documented();
    replace(mail.text, "00 - TRANSFER OK", status);
    mail.attachments.clear();
    auto session = session_in(mail);
    CHECK(static_cast<int>(session.status) == std::stoi(status));
    CHECK_FALSE(has_arrived(session.status));
    CHECK(session.payload.empty());
}

TEST_CASE("a message arrives whole although the one for the unit was too large") {
    auto mail = documented();
    replace(mail.text, "00 - TRANSFER OK", "01 - MT MESSAGE TOO LARGE");
    CHECK(session_in(mail).payload.size() == 351);
}

TEST_CASE("mails of other senders are not read, whatever they say") {
    auto mail = documented();
    mail.from = "sbdservice@sbd.iridium.com.example.org";
    CHECK(refusal(mail).code() == ise::errc::unauthorized);
    mail.from = "SBDservice@SBD.Iridium.com";
    CHECK(read_gateway_mail(mail));
    CHECK(read_gateway_mail(mail, "gateway@example.org").error().code() == ise::errc::unauthorized);
}

TEST_CASE("a field that cannot be is named") {
    struct change {
        std::string what, by, named;
    };
    auto one = GENERATE(values<change>({
        {"MOMSN: 23", "MOMSN: 65536", "momsn"},
        {"MOMSN: 23", "MOMSN: -1", "momsn"},
        {"MOMSN: 23", "MOMSN: 0x17", "momsn"},
        {"MOMSN: 23\r\n", "", "momsn"},
        {"MTMSN: 0", "MOMSN: 24\r\nMTMSN: 0", "twice"},
        {"Tue Aug 13 16:51:04 2002", "Tue Aug 32 16:51:04 2002", "Aug 32"},
        {"Tue Aug 13 16:51:04 2002", "Tue Feb 30 16:51:04 2002", "Feb 30"},
        {"Tue Aug 13 16:51:04 2002", "2002-08-13 16:51:04", "2002-08-13"},
        {"Tue Aug 13 16:51:04 2002", "Tue Aug 13 24:51:04 2002", "24:51"},
        {"00 - TRANSFER OK", "TRANSFER OK", "status"},
        {"00 - TRANSFER OK", "900 - NO", "status"},
        {"59.372463", "95.372463", "95.372463"},
        {"75.309806", "nan", "nan"},
        {"Lat = 59.372463 Long = 75.309806", "nowhere", "nowhere"},
        {"CEPradius = 3", "CEPradius = -3", "-3"},
        {"Message Size (bytes): 351", "Message Size (bytes): 350", "351"},
        {"Message Size (bytes): 351", "Message Size (bytes): 5000", "5000"},
    }));
    CAPTURE(one.what, one.by);
    auto mail = documented();
    replace(mail.text, one.what, one.by);
    auto why = refusal(mail);
    CHECK(why.code() == ise::errc::malformed);
    CHECK(says(why, one.named));
}

TEST_CASE("a message that is missing, or there twice, is refused") {
    auto mail = documented();
    mail.attachments[0].name = "picture.png";
    CHECK(says(refusal(mail), "no attachment"));
    mail = documented();
    mail.attachments.push_back(mail.attachments[0]);
    CHECK(says(refusal(mail), "more than one"));
    mail = documented();
    mail.attachments[0].name = "A.SBD";
    CHECK(read_gateway_mail(mail));
}

TEST_CASE("subjects that are none of the gateway's are refused") {
    for (std::string subject :
         {"", "Hello", "SBD Msg From Unit:", "SBD Msg From Unit: 12345", "SBD Msg From Unit: 30003401012474x",
          "SBD Msg From Unit: 3000340101247401", "SBD Mobile-Terminated Message Queued for Unit"}) {
        auto mail = documented();
        mail.subject = subject;
        CAPTURE(subject);
        CHECK(refusal(mail).code() == ise::errc::malformed);
    }
}

TEST_CASE("the gateway tells that a message is queued") {
    mail_message mail;
    mail.from = std::string(gateway_sender);
    mail.subject = "SBD Mobile-Terminated Message Queued for Unit 300034012345678";
    mail.text = "The following mobile-terminated message was queued for delivery:\r\n\r\nIMEI: "
                "300034012345678\r\nTime: Mon Sep 22 22:10:52 2008\r\n"
                "Attachment Filename: c17.sbd\r\nAttachment Size: 10 bytes\r\n\r\nThe MTMSN is 1, and the message is "
                "number 3 in the queue.\r\n";
    auto read = read_gateway_mail(mail);
    REQUIRE(read);
    const auto& result = std::get<disposition>(*read);
    CHECK(result.queued);
    CHECK(result.imei == "300034012345678");
    CHECK(result.attachment == "c17.sbd");
    CHECK(result.mtmsn == 1);
    CHECK(result.queue_position == 3u);
    mail.text.clear(); // the subject alone is enough
    CHECK(std::get<disposition>(read_gateway_mail(mail).value()).imei == "300034012345678");
}

TEST_CASE("the gateway tells why a message is not queued") {
    mail_message mail;
    mail.from = std::string(gateway_sender);
    mail.subject = "Error: SBD Mobile-Terminated Message Not Queued for Unit 300034012345678";
    mail.text =
        "IMEI: 300034012345678\r\nAttachment Filename: c17.sbd\r\nReason: MT message queue full (max of 50).\r\n";
    auto result = std::get<disposition>(read_gateway_mail(mail).value());
    CHECK_FALSE(result.queued);
    CHECK(result.imei == "300034012345678");
    CHECK(result.attachment == "c17.sbd");
    CHECK(result.reason == "MT message queue full (max of 50).");
    mail.subject = "Error: Message Not Queued";
    mail.text = "The unit is not known to this gateway.\r\n";
    result = std::get<disposition>(read_gateway_mail(mail).value());
    CHECK(result.imei.empty());
    CHECK(result.reason == "The unit is not known to this gateway.");
}

TEST_CASE("a mail for units has their IMEIs as its subject and one attachment a message") {
    auto mail = make_mt_mail("shore@example.org", {"300034012345678", "300034012345679"},
                             {{"c1.sbd", bytes_of(270)}, {"c2.sbd", bytes_of(1)}});
    REQUIRE(mail);
    CHECK(mail->to == std::vector<std::string>{"data@sbd.iridium.com"});
    CHECK(mail->subject == "300034012345678 300034012345679");
    REQUIRE(mail->attachments.size() == 2);
    auto order = read_mt_mail(*mail);
    REQUIRE(order);
    CHECK(order->imeis.size() == 2);
    CHECK(order->messages[0].payload == bytes_of(270));
}

TEST_CASE("a mail for units that the gateway would refuse is not made") {
    std::string unit = "300034012345678";
    mt_message fine{"c1.sbd", bytes_of(10)};
    auto refused = [](std::vector<std::string> units, std::vector<mt_message> messages) {
        auto made = make_mt_mail("shore@example.org", units, messages);
        REQUIRE_FALSE(made);
        CHECK(made.error().code() == ise::errc::invalid_argument);
    };
    refused({}, {fine});
    refused({"300034012345671", "300034012345672", "300034012345673", "300034012345674", "300034012345675"}, {fine});
    refused({unit, unit}, {fine});
    refused({"30003401234567"}, {fine});
    refused({unit}, {});
    refused({unit}, {{"c1.sbd", bytes_of(0)}});
    refused({unit}, {{"c1.sbd", bytes_of(271)}});
    refused({unit}, {{"c1.txt", bytes_of(1)}});
    refused({unit}, {{"c\r\n1.sbd", bytes_of(1)}});
    refused({unit}, {{std::string(78, 'x') + ".sbd", bytes_of(1)}});
}

TEST_CASE("what the emulated gateway writes is read back the same") {
    auto session = session_in(documented());
    CHECK(session_in(make_mo_mail(session, "boat@example.org")) == session);
    session.latitude_deg = session.longitude_deg = session.cep_km = std::nullopt;
    session.payload.clear();
    session.size = 0;
    session.session_at = std::chrono::sys_days(std::chrono::year(2026) / 1 / 2) + 3h;
    CHECK(session_in(make_mo_mail(session, "boat@example.org")) == session);

    disposition result;
    result.imei = "300034012345678";
    result.attachment = "c17.sbd";
    result.reason = "queue full";
    CHECK(std::get<disposition>(read_gateway_mail(make_disposition_mail(result, "shore@example.org")).value()) ==
          result);
    result.queued = true;
    result.reason.clear();
    result.mtmsn = 300;
    result.queue_position = 50;
    CHECK(std::get<disposition>(read_gateway_mail(make_disposition_mail(result, "shore@example.org")).value()) ==
          result);
}

TEST_CASE(
    "iridium mail: a mail is the gateway's where one's own server found it to be, whatever others and its sender say") {
    auto genuine = [](std::vector<std::string> results) {
        return check_authentication(results, "mx.shore.example", "sbd.iridium.com").has_value();
    };
    CHECK(genuine({"mx.shore.example; dkim=pass header.d=iridium.com header.s=a; spf=fail smtp.mailfrom=x@y.example"}));
    CHECK(genuine(
        {"MX.shore.example 1;\r\n\tspf=pass (sender is (really) allowed) smtp.mailfrom=sbdservice@sbd.iridium.com"}));
    CHECK(genuine({"mx.shore.example; dmarc=pass (p=NONE) header.from=sbd.iridium.com"}));
    CHECK(genuine(
        {"elsewhere.example; none", "mx.shore.example; dkim=pass header.i=@sbd.iridium.com header.d=sbd.iridium.com"}));
    for (const char* other :
         {"mx.shore.example; none", "mx.shore.example", "mx.shore.example; dkim=fail header.d=iridium.com",
          "evil.example; dkim=pass header.d=iridium.com", "mx.shore.example.evil; dkim=pass header.d=iridium.com",
          "mx.shore.example; dkim=pass header.d=com", "mx.shore.example; dkim=pass header.d=um.com",
          "mx.shore.example; dkim=pass header.d=evil.example", "mx.shore.example; (dkim=pass header.d=iridium.com)",
          "mx.shore.example; spf=pass smtp.mailfrom=\"a; dkim=pass header.d=iridium.com; b\"@evil.example",
          "mx.shore.example; spf=pass smtp.mailfrom=\"a\\\"; dkim=pass header.d=iridium.com\"@evil.example",
          "mx.shore.example; spf=pass smtp.mailfrom=\"x@sbd.iridium.com\"@evil.example",
          "mx.shore.example; dmarc=pass header.from=evil.example; dkim=none", ""})
        CHECK_FALSE(genuine({other}));
    CHECK_FALSE(genuine({}));
    // One's own server writes above what came along.
    CHECK_FALSE(genuine({"mx.shore.example; dkim=none", "mx.shore.example; dkim=pass header.d=iridium.com"}));
    auto why = check_authentication({}, "mx.shore.example", "sbd.iridium.com");
    CHECK(why.error().code() == ise::errc::unauthorized);
}

TEST_CASE("iridium mail: what a sender encodes in its address says nothing in the name of one's own server") {
    auto genuine = [](const std::string& result) {
        auto mail = read_mail("Authentication-Results: " + result +
                              "\r\nFrom: sbdservice@sbd.iridium.com\r\nTo: boat@shore.example\r\nSubject: SBD Msg\r\n"
                              "\r\nMOMSN: 1\r\n");
        REQUIRE(mail);
        return check_authentication(mail->authentication_results, "mx.shore.example", "sbd.iridium.com").has_value();
    };
    CHECK(genuine("mx.shore.example;\r\n dkim=pass\r\n\theader.d=iridium.com"));
    for (const char* sender : {"=?utf-8?q?x=3Bdkim=3Dpass_header.d=3Diridium.com_?=@evil.example",
                               "x=?utf-8?b?O2RraW09cGFzcyBoZWFkZXIuZD1pcmlkaXVtLmNvbSA=?=@evil.example",
                               "\"=?utf-8?q?x=22=3Bdkim=3Dpass_header.d=3Diridium.com_=22?=\"@evil.example"}) {
        CAPTURE(sender);
        CHECK_FALSE(genuine(std::string("mx.shore.example; spf=pass smtp.mailfrom=") + sender));
        CHECK_FALSE(genuine(std::string("mx.shore.example; spf=pass\r\n smtp.mailfrom=") + sender + "; dkim=none"));
    }
}

} // namespace format_test
