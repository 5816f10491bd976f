#include "mail_host.hpp"

#include <components/curl/imap_mailbox.hpp>
#include <components/curl/smtp_sender.hpp>
#include <components/iridium_mail/mail_format.hpp>

#include <support/catch.hpp>
#include <support/real_parties.hpp>

using namespace atirma;
using namespace std::chrono_literals;

namespace {

/// Says why there is nothing to test, where there is not.
bool skipped() {
    auto why = mail_host::missing();
    if (why) WARN("skipped: " << *why);
    return why.has_value();
}

struct shore {
    ise_test::real_parties all;
    ise_test::party& here = all.add("shore");
    mail_host host;
    curl_transfers transfers{here.on};

    shore() { host.start(); }

    imap_options reading() const {
        imap_options made;
        made.server = host.imaps();
        made.user = "boat";
        made.password = "secret";
        made.ca_file = host.certificate();
        return made;
    }
    smtp_options sending() const {
        smtp_options made;
        made.server = host.smtps();
        made.user = "shore";
        made.password = "secret";
        made.ca_file = host.certificate();
        return made;
    }
    ise::result<void> send(const smtp_options& how, mail_message what) {
        smtp_sender sender(transfers, how);
        return all.run(here, sender.send(std::move(what)));
    }
    /// Waits until as many mails are there.
    std::vector<stored_mail> receive(imap_mailbox& from, std::size_t count) {
        for (;;) {
            auto found = all.run(here, from.fetch(100));
            REQUIRE(wrong(found) == "");
            if (found->size() >= count) return *found;
            REQUIRE(wrong(all.run(here, from.wait(30s))) == "");
        }
    }
    template <class T>
    static std::string wrong(const ise::result<T>& outcome) {
        return outcome ? std::string() : outcome.error().message();
    }
};

mail_message session_mail(std::uint16_t momsn) {
    iridium_mail::mo_session session;
    session.imei = "300034012345678";
    session.momsn = momsn;
    session.session_at = std::chrono::sys_days(std::chrono::year(2026) / 11 / 21);
    for (int i = 0; i < 340; ++i) session.payload.push_back(static_cast<std::byte>(i * 7));
    session.size = 340;
    return iridium_mail::make_mo_mail(session, "boat@example.org");
}

} // namespace

TEST_CASE("a message of the boat comes through real mail servers byte for byte") {
    if (skipped()) return;
    shore s;
    auto starts_tls = s.sending();
    starts_tls.server = s.host.smtp();
    imap_mailbox box(s.transfers, s.reading());
    REQUIRE(shore::wrong(s.send(s.sending(), session_mail(1))) == "");
    REQUIRE(s.receive(box, 1).size() == 1); // servers deliver in any order
    REQUIRE(shore::wrong(s.send(starts_tls, session_mail(2))) == "");
    auto mails = s.receive(box, 2);
    REQUIRE(mails.size() == 2);
    for (std::size_t i = 0; i < 2; ++i) {
        auto read = iridium_mail::read_gateway_mail(mails[i].message);
        REQUIRE(shore::wrong(read) == "");
        CHECK(*read == *iridium_mail::read_gateway_mail(session_mail(static_cast<std::uint16_t>(i + 1))));
    }
    // Not marked by reading; once one is done it does not come again, also over STARTTLS.
    CHECK(s.all.run(s.here, box.fetch(1)).value().size() == 1);
    REQUIRE(s.all.run(s.here, box.done(mails[0].uid)));
    auto over_tls = s.reading();
    over_tls.server = s.host.imap();
    imap_mailbox other(s.transfers, over_tls);
    auto left = s.receive(other, 1);
    REQUIRE(left.size() == 1);
    CHECK(left[0].uid == mails[1].uid);
}

TEST_CASE("a mail that is done is removed, or put away, as asked") {
    if (skipped()) return;
    shore s;
    s.host.put("boat", "From: a@b.c\r\nSubject: one\r\n\r\nx\r\n");
    s.host.put("boat", "From: a@b.c\r\nSubject: two\r\n\r\nx\r\n");
    auto removing = s.reading(), moving = s.reading();
    removing.when_done = imap_done::removed;
    moving.when_done = imap_done::moved;
    imap_mailbox first(s.transfers, removing), second(s.transfers, moving);
    auto mails = s.receive(first, 2);
    REQUIRE(s.all.run(s.here, first.done(mails[0].uid)));
    CHECK(s.host.count("boat") == 1);
    mails = s.receive(second, 1);
    REQUIRE(shore::wrong(s.all.run(s.here, second.done(mails[0].uid))) == "");
    CHECK(s.host.count("boat") == 0);
    CHECK(s.host.count("boat", "Done") == 1);
}

TEST_CASE("new mail ends the waiting") {
    if (skipped()) return;
    shore s;
    s.host.put("boat", "From: a@b.c\r\nSubject: one\r\n\r\nx\r\n");
    imap_mailbox box(s.transfers, s.reading());
    auto mails = s.receive(box, 1);
    REQUIRE(s.all.run(s.here, box.done(mails[0].uid)));
    REQUIRE(s.all.run(s.here, box.fetch(10)).value().empty());
    auto waiting = ise_test::start(s.here.on, box.wait(24h)); // IDLE ends by itself or not at all
    REQUIRE(shore::wrong(s.send(s.sending(), session_mail(3))) == "");
    s.all.run_until([&] { return waiting->done; });
    REQUIRE(shore::wrong(waiting->get()) == "");
    CHECK(s.receive(box, 1).size() == 1);
    REQUIRE(s.all.run(s.here, box.wait(1ms))); // nothing new: the time is over
}

TEST_CASE("wrong passwords, certificates and receivers are told apart") {
    if (skipped()) return;
    shore s;
    auto reading = s.reading();
    reading.password = "wrong";
    imap_mailbox refused(s.transfers, reading);
    CHECK(s.all.run(s.here, refused.fetch(1)).error().code() == ise::errc::unauthorized);
    auto sending = s.sending();
    sending.password = "wrong";
    CHECK(s.send(sending, session_mail(1)).error().code() == ise::errc::unauthorized);

    reading = s.reading();
    reading.ca_file = s.host.other_certificate();
    imap_mailbox distrusting(s.transfers, reading);
    CHECK(s.all.run(s.here, distrusting.fetch(1)).error().code() == ise::errc::unreachable);
    sending = s.sending();
    sending.ca_file = s.host.other_certificate();
    CHECK(s.send(sending, session_mail(1)).error().code() == ise::errc::unreachable);

    auto elsewhere = session_mail(1);
    elsewhere.to = {"boat@elsewhere.example"};
    auto sent = s.send(s.sending(), elsewhere);
    REQUIRE_FALSE(sent);
    CHECK(sent.error().code() == ise::errc::refused);
    CHECK(sent.error().message().find("550") != std::string::npos);
    reading = s.reading();
    reading.folder = "Nowhere";
    imap_mailbox nowhere(s.transfers, reading);
    CHECK(s.all.run(s.here, nowhere.fetch(1)).error().code() == ise::errc::io_failed);
    CHECK(s.host.count("boat") == 0);
}

TEST_CASE("servers that are killed and come back lose nothing") {
    if (skipped()) return;
    shore s;
    s.host.put("boat", "From: a@b.c\r\nSubject: one\r\n\r\nx\r\n");
    imap_mailbox box(s.transfers, s.reading());
    auto mails = s.receive(box, 1);
    REQUIRE(s.all.run(s.here, box.wait(1ms))); // a session lies open
    auto waiting = ise_test::start(s.here.on, box.wait(24h));
    s.all.run_until([&] {
        s.host.kill();
        return true;
    });
    s.all.run_until([&] { return waiting->done; });
    CHECK(waiting->get().error().code() == ise::errc::unreachable);
    CHECK(s.all.run(s.here, box.fetch(1)).error().code() == ise::errc::unreachable);
    auto sent = s.send(s.sending(), session_mail(1));
    REQUIRE_FALSE(sent);
    CHECK(sent.error().code() == ise::errc::unreachable);
    CHECK(sent.error().executed() == ise::execution::not_executed);
    s.host.start();
    auto again = s.receive(box, 1);
    CHECK(again[0].uid == mails[0].uid);
    CHECK(s.all.run(s.here, box.done(mails[0].uid)));
}

TEST_CASE("huge mails and nonsense in the mailbox stop nobody") {
    if (skipped()) return;
    shore s;
    auto options = s.reading();
    options.max_mail_bytes = 100'000;
    s.host.put("boat", "From: a@b.c\r\nSubject: huge\r\n\r\n" + std::string(3'000'000, 'x') + "\r\n");
    s.host.put("boat", std::string("\x00\xff\xfe nonsense {10}\r\nI1 OK\r\n* BYE\r\n", 40));
    s.host.put("boat", "");
    s.host.put("boat", "From: a@b.c\r\nSubject: fine\r\n\r\nx\r\n");
    imap_mailbox box(s.transfers, options);
    auto mails = s.receive(box, 4);
    REQUIRE(mails.size() == 4);
    CHECK(mails[0].message.from.empty());
    CHECK(mails[0].message.text.find("100000") != std::string::npos);
    CHECK(mails[1].message.from.empty());
    CHECK(mails[2].message.from.empty());
    CHECK(mails[3].message.subject == "fine");
    for (const auto& one : mails) REQUIRE(s.all.run(s.here, box.done(one.uid)));
    CHECK(s.all.run(s.here, box.fetch(10)).value().empty());
}
