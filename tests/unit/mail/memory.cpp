#include <components/mail/memory_mail.hpp>

#include <support/catch.hpp>
#include <support/sim_parties.hpp>

namespace memory_test {

using namespace atirma;
using namespace std::chrono_literals;

namespace {

mail_message to(std::string whom, std::string subject = "x") {
    mail_message made;
    made.from = "shore@example.org";
    made.to = {std::move(whom)};
    made.subject = std::move(subject);
    return made;
}

struct post_office {
    ise_test::sim_parties all;
    ise_test::party& shore = all.add("shore");
    memory_mail server;
    std::unique_ptr<mail_sender> sender = server.open_sender(shore.on);
    std::unique_ptr<mailbox> box = server.open_mailbox(shore.on, "boat@example.org");

    ise::result<void> send(mail_message what) { return all.run(shore, sender->send(std::move(what))); }
    std::vector<stored_mail> fetch(std::size_t most = 100) { return all.run(shore, box->fetch(most)).value(); }
};

} // namespace

TEST_CASE("a mail that was sent is fetched until it is done") {
    post_office here;
    REQUIRE(here.send(to("Boat@Example.ORG", "one")));
    REQUIRE(here.send(to("boat@example.org", "two")));
    REQUIRE(here.send(to("else@example.org")));
    auto found = here.fetch();
    REQUIRE(found.size() == 2);
    CHECK(here.fetch(1).at(0).message.subject == "one");
    REQUIRE(here.all.run(here.shore, here.box->done(found[0].uid)));
    found = here.fetch();
    REQUIRE(found.size() == 1);
    CHECK(found[0].message.subject == "two");
    CHECK(here.server.waiting("boat@example.org").size() == 1);
}

TEST_CASE("whoever waits for mail is woken by the next one, and at the latest when the time is over") {
    post_office here;
    here.fetch();
    auto began = here.all.world.now();
    REQUIRE(here.all.run(here.shore, here.box->wait(30s)));
    CHECK(here.all.world.now() - began == 30s);

    here.all.world.after(5s, [&] { here.server.deliver(to("boat@example.org")); });
    began = here.all.world.now();
    REQUIRE(here.all.run(here.shore, here.box->wait(30s)));
    CHECK(here.all.world.now() - began == 5s);
    REQUIRE(here.all.run(here.shore, here.box->wait(30s))); // not fetched yet: at once
    CHECK(here.all.world.now() - began == 5s);
}

TEST_CASE("a mail on its way arrives although its sender has gone") {
    post_office here;
    here.server.options.later = [&](ise::duration after, std::function<void()> action) {
        here.all.world.after(after, std::move(action));
    };
    here.server.options.transit = 20s;
    REQUIRE(here.send(to("boat@example.org")));
    here.sender.reset();
    CHECK(here.fetch().empty());
    here.all.world.run_for(20s);
    CHECK(here.fetch().size() == 1);
}

TEST_CASE("the server in memory fails as a real one does") {
    post_office here;
    here.server.options.refused["bad@example.org"] = "550 no such user";
    auto refused = here.send(to("bad@example.org"));
    REQUIRE_FALSE(refused);
    CHECK(refused.error().code() == ise::errc::refused);
    CHECK(refused.error().message().find("550 no such user") != std::string::npos);
    CHECK(here.send(mail_message()).error().code() == ise::errc::invalid_argument);

    here.server.options.max_mails = 1;
    REQUIRE(here.send(to("boat@example.org")));
    CHECK(here.send(to("boat@example.org")).error().code() == ise::errc::refused);

    here.server.options.accepts_logins = false;
    CHECK(here.send(to("boat@example.org")).error().code() == ise::errc::unauthorized);
    here.server.options.reachable = false;
    CHECK(here.send(to("boat@example.org")).error().code() == ise::errc::unreachable);
    CHECK(here.all.run(here.shore, here.box->fetch(1)).error().code() == ise::errc::unreachable);
    CHECK(here.all.run(here.shore, here.box->done(1)).error().code() == ise::errc::unreachable);
    CHECK(here.all.run(here.shore, here.box->wait(1s)).error().code() == ise::errc::unreachable);
}

TEST_CASE("waiting for mail can be given up") {
    post_office here;
    here.fetch();
    auto waiting = ise_test::start(here.shore.on, here.box->wait(1h));
    here.all.world.run_for(1s);
    waiting->cancel.emit(asio::cancellation_type::terminal);
    REQUIRE(here.all.run_until([&] { return waiting->done; }));
    CHECK(waiting->code() == ise::errc::cancelled);
}

} // namespace memory_test
