#include "scripted_server.hpp"

#include <components/curl/imap_mailbox.hpp>

#include <support/catch.hpp>

#include <map>

namespace imap_test {

using namespace atirma;
using namespace curl_test;
using namespace std::chrono_literals;

namespace {

template <class T>
std::string wrong(const ise::result<T>& outcome) {
    return outcome ? std::string() : outcome.error().message();
}

/// A small IMAP server: its answers by the first words of a command, without the tag; `{tag}` stands for that.
struct imap_server {
    std::map<std::string, std::string> answers{
        {"CAPABILITY", "* CAPABILITY IMAP4rev1 UIDPLUS AUTH=PLAIN SASL-IR\r\n{tag} OK done\r\n"},
        {"AUTHENTICATE", "{tag} OK logged in\r\n"},
        {"SELECT", "* 1 EXISTS\r\n* OK [UIDVALIDITY 9] valid\r\n{tag} OK selected\r\n"},
        {"UID SEARCH", "* SEARCH 7\r\n{tag} OK done\r\n"},
        {"UID FETCH", "* 1 FETCH (UID 7 BODY[]<0> {28}\r\nFrom: a@b.c\r\nSubject: x\r\n\r\ny)\r\n{tag} OK done\r\n"},
        {"UID STORE", "{tag} OK done\r\n"},
        {"NOOP", "* 2 EXISTS\r\n{tag} OK done\r\n"},
    };
    std::string greeting = "* OK ready\r\n";
    std::string continued; ///< what the client sent when it was asked to go on

    ise::task<> talk(visitor& who) {
        co_await who.say(greeting);
        for (;;) {
            auto line = co_await who.next_line();
            if (who.ended) co_return;
            auto blank = line.find(' ');
            auto tag = line.substr(0, blank), order = line.substr(blank == std::string::npos ? line.size() : blank + 1);
            bool known = false;
            for (const auto& [words, answer] : answers) {
                if (!order.starts_with(words)) continue;
                known = true;
                auto text = answer;
                for (auto at = text.find("{tag}"); at != std::string::npos; at = text.find("{tag}"))
                    text.replace(at, 5, tag);
                co_await who.say(text);
                if (text == "+ \r\n") {
                    continued = co_await who.next_line();
                    co_await who.say(tag + " OK logged in\r\n");
                }
                if (text.empty()) co_await who.silence();
                if (answer.ends_with("!")) co_return; // hangs up in the middle
                break;
            }
            if (!known) co_await who.silence();
        }
    }
};

struct shore {
    ise_test::real_parties all;
    ise_test::party& here = all.add("shore");
    curl_transfers transfers{here.on};
    imap_server words;
    scripted_server server{all, here, [this](visitor& who) { return words.talk(who); }, "server"};
    imap_mailbox box{transfers, options()};

    imap_options options() const {
        imap_options made;
        made.server = server.at("imaps");
        made.user = "boat";
        made.password = "secret";
        made.ca_file = certificates::made().file("server.pem");
        made.within = 10s;
        made.poll_period = 1ms;
        return made;
    }
    ise::result<std::vector<stored_mail>> fetch() { return all.run(here, box.fetch(10)); }
};

} // namespace

TEST_CASE("a mail is fetched without marking it, and marked when it is done") {
    shore s;
    auto found = s.fetch();
    REQUIRE(wrong(found) == "");
    REQUIRE(found->size() == 1);
    CHECK(found->at(0).uid == 7);
    CHECK(found->at(0).message.subject == "x");
    CHECK(found->at(0).message.text == "y");
    REQUIRE(s.all.run(s.here, s.box.done(7)));
    CHECK(s.server.visitors.size() == 1); // one session for all of it
    std::string heard;
    for (const auto& line : s.server.visitors.front().heard) heard += line + "\n";
    CHECK(heard.find("UID FETCH 7 (UID BODY.PEEK[]<0.1048577>)") != std::string::npos);
    CHECK(heard.find("UID STORE 7 +FLAGS.SILENT (\\Seen)") != std::string::npos);
}

TEST_CASE("a login that is refused says so, although the server then says nothing more") {
    shore s;
    s.words.answers["AUTHENTICATE"] = "{tag} NO [AUTHENTICATIONFAILED] no\r\n";
    auto found = s.fetch();
    REQUIRE_FALSE(found);
    CHECK(found.error().code() == ise::errc::unauthorized);
    CHECK(found.error().message().find("imaps://localhost") != std::string::npos);
    CHECK(found.error().message().find("secret") == std::string::npos);
}

TEST_CASE("a server that falls silent at any point is given up") {
    auto where = GENERATE(as<std::string>(), "CAPABILITY", "AUTHENTICATE", "SELECT", "UID SEARCH", "UID FETCH");
    shore s;
    auto options = s.options();
    options.within = 1s;
    s.words.answers[where] = "";
    imap_mailbox box(s.transfers, options);
    auto found = s.all.run(s.here, box.fetch(10));
    REQUIRE_FALSE(found);
    CHECK(found.error().code() == ise::errc::timed_out);
    s.all.run_until([&] { return !s.server.visitors.empty() && s.server.visitors.front().ended; }); // it was hung up on
}

TEST_CASE("a server that goes away at any point is not reached, and the next fetch works") {
    struct fault {
        std::string where, answer;
    };
    auto one = GENERATE(values<fault>({{"CAPABILITY", "!"},
                                       {"AUTHENTICATE", "!"},
                                       {"SELECT", "* 1 EXISTS\r\n!"},
                                       {"UID SEARCH", "* SEARCH 7!"},
                                       {"UID SEARCH", "* BYE too busy\r\n"},
                                       {"UID FETCH", "* 1 FETCH (UID 7 BODY[]<0> {28}\r\nFrom: a@b!"}}));
    CAPTURE(one.where, one.answer);
    shore s;
    auto whole = std::exchange(s.words.answers[one.where], one.answer);
    auto found = s.fetch();
    REQUIRE_FALSE(found);
    CHECK(found.error().code() == ise::errc::unreachable);
    s.words.answers[one.where] = whole;
    found = s.fetch();
    REQUIRE(wrong(found) == "");
    CHECK(found->size() == 1);
}

TEST_CASE("a session that the server ended while nobody looked is made anew") {
    shore s;
    REQUIRE(s.fetch());
    s.server.visitors.front().hang_up();
    REQUIRE(s.fetch());
    CHECK(s.server.visitors.size() == 2);
}

TEST_CASE("nonsense of a server is an error and nothing else") {
    struct fault {
        std::string where, answer;
    };
    auto one = GENERATE(values<fault>({
        {"SELECT", "{tag} NO no such folder\r\n"},
        {"SELECT", "{tag} BAD what\r\n"},
        {"UID SEARCH", "other OK done\r\n"},
        {"UID SEARCH", "\r\n"},
        {"UID SEARCH", "* SEARCH 1 {4000000000}\r\n"},
        {"UID FETCH", "* 1 FETCH (UID 7 BODY[]<0> {99999999}\r\n"},
        {"UID FETCH", "{tag} NO not now\r\n"},
    }));
    CAPTURE(one.where, one.answer);
    shore s;
    s.words.answers[one.where] = one.answer;
    auto found = s.fetch();
    REQUIRE_FALSE(found);
    CHECK(found.error().code() == ise::errc::io_failed);
}

TEST_CASE("a greeting that is none of IMAP's is an error") {
    shore s;
    s.words.greeting = "220 smtp.example ESMTP\r\n";
    CHECK_FALSE(s.fetch());
}

TEST_CASE("mails that cannot be read come as such") {
    shore s;
    s.words.answers["UID SEARCH"] = "* SEARCH 7\r\n{tag} OK done\r\n";
    s.words.answers["UID FETCH"] = "* 1 FETCH (UID 7 BODY[]<0> {8}\r\nnonsense)\r\n{tag} OK done\r\n";
    auto found = s.fetch();
    REQUIRE(wrong(found) == "");
    REQUIRE(found->size() == 1);
    CHECK(found->at(0).uid == 7);
    CHECK(found->at(0).message.from.empty());
    CHECK_FALSE(found->at(0).message.text.empty());

    auto options = s.options();
    options.max_mail_bytes = 2000;
    imap_mailbox box(s.transfers, options);
    s.words.answers["UID FETCH"] =
        "* 1 FETCH (UID 7 BODY[]<0> {2001}\r\n" + std::string(2001, 'x') + ")\r\n{tag} OK done\r\n";
    found = s.all.run(s.here, box.fetch(10));
    REQUIRE(wrong(found) == "");
    CHECK(found->at(0).message.text.find("2000") != std::string::npos);
}

TEST_CASE("a mail that somebody removed meanwhile is passed over") {
    shore s;
    s.words.answers["UID SEARCH"] = "* SEARCH 8 7\r\n{tag} OK done\r\n";
    s.words.answers["UID FETCH 8"] = "{tag} OK done\r\n";
    s.words.answers["UID FETCH"] = "{tag} OK done\r\n";
    auto found = s.fetch();
    REQUIRE(wrong(found) == "");
    CHECK(found->empty());
}

TEST_CASE("a number of a folder that was made anew marks nothing") {
    shore s;
    REQUIRE(s.fetch());
    s.server.visitors.front().hang_up();
    s.words.answers["SELECT"] = "* 1 EXISTS\r\n* OK [UIDVALIDITY 10] valid\r\n{tag} OK selected\r\n";
    auto marked = s.all.run(s.here, s.box.done(7));
    REQUIRE_FALSE(marked);
    CHECK(marked.error().code() == ise::errc::io_failed);
    for (const auto& line : s.server.visitors.back().heard) CHECK(line.find("STORE") == std::string::npos);
}

TEST_CASE("without IDLE the server is asked from time to time") {
    shore s;
    REQUIRE(s.fetch());
    REQUIRE(s.all.run(s.here, s.box.wait(1h))); // NOOP tells of a second mail
    s.words.answers["NOOP"] = "{tag} OK nothing\r\n";
    REQUIRE(s.fetch());
    REQUIRE(s.all.run(s.here, s.box.wait(20ms)));
}

TEST_CASE("waiting that is given up ends the session, and the next one begins anew") {
    shore s;
    s.words.answers["NOOP"] = "";
    REQUIRE(s.fetch());
    auto waiting = ise_test::start(s.here.on, s.box.wait(1h));
    s.all.run_until([&] { return s.server.visitors.front().heard.back().ends_with("NOOP"); });
    waiting->cancel.emit(asio::cancellation_type::terminal);
    s.all.run_until([&] { return waiting->done && s.server.visitors.front().ended; });
    CHECK(waiting->code() == ise::errc::cancelled);
    REQUIRE(s.fetch());
    CHECK(s.server.visitors.size() == 2);
}

TEST_CASE("without TLS no password is sent") {
    shore s;
    scripted_server plain(s.all, s.here, [&](visitor& who) { return s.words.talk(who); });
    auto options = s.options();
    options.server = plain.at("imap");
    s.words.answers["STARTTLS"] = "{tag} BAD no\r\n";
    imap_mailbox box(s.transfers, options);
    auto found = s.all.run(s.here, box.fetch(10));
    REQUIRE_FALSE(found);
    CHECK(found.error().code() == ise::errc::unreachable);
    for (const auto& line : plain.visitors.front().heard) CHECK(line.find("AUTH") == std::string::npos);

    options.clear_text = true;
    imap_mailbox trusting(s.transfers, options);
    CHECK(s.all.run(s.here, trusting.fetch(10)));
}

TEST_CASE("servers and folders that are none are refused") {
    shore s;
    auto bad_server = s.options(), bad_folder = s.options();
    bad_server.server = "https://mail.example";
    bad_folder.folder = "IN\r\nBOX";
    CHECK_THROWS_AS(imap_mailbox(s.transfers, bad_server), ise::error);
    CHECK_THROWS_AS(imap_mailbox(s.transfers, bad_folder), ise::error);
}

TEST_CASE("imap: the first answer of a login comes with the command only where the server has SASL-IR (RFC 4959)") {
    constexpr auto credentials = "AGJvYXQAc2VjcmV0"; // "\0boat\0secret"
    {
        shore s;
        s.words.answers["CAPABILITY"] = "* CAPABILITY IMAP4rev1 UIDPLUS AUTH=PLAIN\r\n{tag} OK done\r\n";
        s.words.answers["AUTHENTICATE PLAIN"] = s.words.answers["AUTHENTICATE"] = "+ \r\n";
        auto got = s.fetch();
        INFO(wrong(got));
        CHECK(got);
        CHECK(s.words.continued == credentials);
        for (const auto& line : s.server.visitors.front().heard)
            CHECK(line.find(std::string(" ") + credentials) == std::string::npos);
    }
    shore s; // has it
    CHECK(s.fetch());
    bool at_once = false;
    for (const auto& line : s.server.visitors.front().heard)
        at_once = at_once || line.ends_with(std::string("AUTHENTICATE PLAIN ") + credentials);
    CHECK(at_once);
}

} // namespace imap_test
