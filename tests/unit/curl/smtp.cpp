#include "scripted_server.hpp"

#include <components/curl/smtp_sender.hpp>

#include <support/catch.hpp>

#include <map>

namespace smtp_test {

using namespace atirma;
using namespace curl_test;
using namespace std::chrono_literals;

namespace {

/// A small SMTP server: its answers by the first word of a command. Falls silent at QUIT.
struct smtp_server {
    std::map<std::string, std::string> answers{
        {"EHLO", "250-localhost\r\n250-AUTH PLAIN\r\n250 SIZE 1000000\r\n"},
        {"AUTH", "235 welcome\r\n"},
        {"MAIL", "250 ok\r\n"},
        {"RCPT", "250 ok\r\n"},
        {"DATA", "354 go on\r\n"},
        {".", "250 taken\r\n"},
    };
    std::string content;

    ise::task<> talk(visitor& who) {
        co_await who.say("220 localhost ESMTP\r\n");
        for (bool in_data = false;;) {
            auto line = co_await who.next_line();
            if (who.ended) co_return;
            if (in_data && line != ".") {
                content += line + "\n";
                continue;
            }
            auto order = in_data ? line : line.substr(0, line.find_first_of(" :"));
            in_data = order == "DATA";
            auto found = answers.find(order);
            if (found == answers.end()) {
                co_await who.silence();
                co_return;
            }
            if (found->second == "!") co_return;
            co_await who.say(found->second);
        }
    }
};

struct shore {
    ise_test::real_parties all;
    ise_test::party& here = all.add("shore");
    curl_transfers transfers{here.on};
    smtp_server words;
    scripted_server server{all, here, [this](visitor& who) { return words.talk(who); }, "server"};

    smtp_options options() const {
        smtp_options made;
        made.server = server.at("smtps");
        made.user = "shore";
        made.password = "secret";
        made.ca_file = certificates::made().file("server.pem");
        made.within = 10s;
        return made;
    }
    ise::result<void> send(mail_message what = a_mail()) { return send(options(), std::move(what)); }
    ise::result<void> send(smtp_options how, mail_message what = a_mail()) {
        smtp_sender sender(transfers, std::move(how));
        return all.run(here, sender.send(std::move(what)));
    }
    static mail_message a_mail() {
        mail_message made;
        made.from = "shore@example.org";
        made.to = {"data@sbd.iridium.com"};
        made.subject = "300034012345678";
        made.text = "one\r\n.\r\n..\r\n";
        made.attachments.push_back({"c1.sbd", std::vector<std::byte>(270, std::byte{0x2e})});
        return made;
    }
};

} // namespace

TEST_CASE("a mail is handed over whole, and nobody waits for the answer to the goodbye") {
    shore s;
    REQUIRE(s.send());
    std::string heard;
    for (const auto& line : s.server.visitors.front().heard) heard += line + "\n";
    CHECK(heard.find("MAIL FROM:<shore@example.org>") != std::string::npos);
    CHECK(heard.find("RCPT TO:<data@sbd.iridium.com>") != std::string::npos);
    CHECK(s.words.content.find("Subject: 300034012345678\n") != std::string::npos);
    s.all.run_until([&] { return s.server.visitors.front().ended; });
    CHECK(s.server.visitors.front().heard.size() > 5);
}

TEST_CASE("what the server refuses for good, for now, or for the login, is told apart") {
    struct fault {
        std::string where, answer;
        ise::errc code;
    };
    auto one = GENERATE(values<fault>({
        {"RCPT", "550 5.1.1 no such user\r\n", ise::errc::refused},
        {"RCPT", "451 4.3.0 try again\r\n", ise::errc::unreachable},
        {"MAIL", "553 no\r\n", ise::errc::refused},
        {"DATA", "554 no\r\n", ise::errc::refused},
        {".", "552 too large\r\n", ise::errc::refused},
        {".", "452 disk full\r\n", ise::errc::unreachable},
        {"AUTH", "535 no\r\n", ise::errc::unauthorized},
    }));
    CAPTURE(one.where, one.answer);
    shore s;
    s.words.answers[one.where] = one.answer;
    auto sent = s.send();
    REQUIRE_FALSE(sent);
    CHECK(sent.error().code() == one.code);
    CHECK(sent.error().executed() == ise::execution::not_executed);
    if (one.where != "AUTH")
        CHECK(sent.error().message().find(one.answer.substr(0, one.answer.size() - 2)) != std::string::npos);
}

TEST_CASE("a server that goes away leaves no doubt but after the last byte") {
    struct fault {
        std::string where;
        ise::execution done;
    };
    auto one = GENERATE(values<fault>({{"MAIL", ise::execution::not_executed},
                                       {"DATA", ise::execution::not_executed},
                                       {".", ise::execution::unknown}}));
    CAPTURE(one.where);
    shore s;
    s.words.answers[one.where] = "!";
    auto sent = s.send();
    REQUIRE_FALSE(sent);
    CHECK(sent.error().code() == ise::errc::peer_lost);
    CHECK(sent.error().executed() == one.done);
    CHECK(s.server.visitors.size() == 1);
}

TEST_CASE("a server that falls silent is given up, and it is said whether it may have the mail") {
    auto where = GENERATE(as<std::string>(), "EHLO", "MAIL", ".");
    CAPTURE(where);
    shore s;
    s.words.answers.erase(where);
    auto options = s.options();
    options.within = where == "." ? 5s : 300ms; // the last one must be reached
    auto sent = s.send(options);
    REQUIRE_FALSE(sent);
    CHECK(sent.error().code() == ise::errc::timed_out);
    CHECK(sent.error().executed() == (where == "." ? ise::execution::unknown : ise::execution::not_executed));
}

TEST_CASE("no password and no mail without TLS") {
    shore s;
    scripted_server plain(s.all, s.here, [&](visitor& who) { return s.words.talk(who); });
    auto options = s.options();
    options.server = plain.at("smtp");
    CHECK(s.send(options).error().code() == ise::errc::unreachable);
    options.clear_text = true;
    CHECK(s.send(options));
}

TEST_CASE("mails that cannot be are not sent, and servers that are none are refused") {
    shore s;
    mail_message to_nobody = shore::a_mail();
    to_nobody.to.clear();
    CHECK(s.send(to_nobody).error().code() == ise::errc::invalid_argument);
    CHECK(s.server.visitors.empty());
    auto options = s.options();
    options.server = "mail.example";
    CHECK_THROWS_AS(smtp_sender(s.transfers, options), ise::error);
}

} // namespace smtp_test
