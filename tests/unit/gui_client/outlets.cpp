// The component on the virtual world: alarms by mail and web hook, with fake sinks; and what it refuses to send.
#include <components/gui_client/gui_client.hpp>
#include <components/mail/memory_mail.hpp>

#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>

namespace outlets_test {

using namespace std::chrono_literals;
using namespace atirma;
using namespace atirma::console;

namespace {

struct kept_request {
    ise::time_point at;
    ise::http_exchange what;
};

/// A web hook that keeps what it gets, and answers as it is told.
struct fake_hook : ise::http_client {
    fake_hook(ise::loop& on, std::vector<kept_request>& posts, const int& status)
        : on_(on), posts_(posts), status_(status) {}
    ise::task<ise::result<ise::http_answer>> exchange(ise::http_exchange what, ise::duration) override {
        posts_.push_back({on_.now(), std::move(what)});
        ise::http_answer answer;
        answer.status = status_;
        if (status_ == 0) co_return ise::failure(ise::errc::unreachable, "no route to the hook");
        co_return answer;
    }

    ise::loop& on_;
    std::vector<kept_request>& posts_;
    const int& status_;
};

struct alarmed {
    ise::sim::world world{3};
    memory_mail mails;
    std::vector<kept_request> posts;
    int status = 200;
    std::shared_ptr<operator_port> port;
    std::uint64_t calls = 0;

    alarmed() {
        gui_client_options options;
        port = options.port;
        options.outlets.at_least = severity::warning;
        options.outlets.mail_from = "console@example.org";
        options.outlets.mail_to = {"anna@example.org"};
        options.outlets.hook_url = "https://hook.example.org/boat";
        options.outlets.make_mail_sender = [this](ise::loop& on) { return mails.open_sender(on); };
        options.outlets.make_http_client = [this](ise::loop& on) -> std::unique_ptr<ise::http_client> {
            return std::make_unique<fake_hook>(on, posts, status);
        };
        world.host("desk").start_process("console", [options](ise::sim::process& here) -> std::shared_ptr<void> {
            ise::node_options quiet;
            quiet.use_names = false;
            quiet.log = {};
            auto node = std::make_shared<ise::node>(here, quiet);
            ise::component_options nowhere;
            nowhere.listens = false;
            node->start<gui_client>("", nowhere, options);
            return node;
        });
        world.run_for(15s); // it settles
        calls = port->latest()->bell.count;
    }
    /// A telecommand without a link to the boat: it fails at once, which is an alarm.
    void raise() { REQUIRE(port->act(give_command{commands::ping(), "", 60, false, false, taking::no})); }
};

} // namespace

TEST_CASE("outlets: an alarm is heard, mailed and posted within two seconds") {
    alarmed it;
    it.raise();
    auto asked = it.world.now();
    REQUIRE(it.world.run_until([&] { return it.port->latest()->bell.count > it.calls; }, 2s));
    REQUIRE(it.world.run_until([&] { return it.mails.delivered() >= 1 && it.posts.size() >= 1; },
                               2s - (it.world.now() - asked)));
    auto mail = it.mails.waiting("anna@example.org").at(0).message;
    CHECK(mail.subject.find("A-Tirma: WARNING “ping” failed") == 0);
    CHECK(mail.text.find("raised") != std::string::npos);
    CHECK(it.posts[0].what.method == "POST");
    CHECK(it.posts[0].what.url == "https://hook.example.org/boat");
    CHECK(it.posts[0].what.body.find("\"severity\":\"warning\"") != std::string::npos);
    CHECK(it.posts[0].what.body.find("no link to the boat") != std::string::npos);
}

TEST_CASE("outlets: what cannot be sent is an alarm here, and goes once it can") {
    alarmed it;
    it.status = 503;
    it.mails.options.reachable = false;
    it.raise();
    auto alarm = [&](const std::string& key) {
        auto seen = it.port->latest();
        return std::any_of(seen->alarms.begin(), seen->alarms.end(),
                           [&](auto& one) { return one.key == key && !one.over_at; });
    };
    REQUIRE(it.world.run_until([&] { return alarm("outlet:mail") && alarm("outlet:hook"); }, 10s));
    it.world.run_for(60s);
    CHECK(it.posts.size() >= 3); // repeated, less and less often
    CHECK(it.posts.size() <= 6);
    it.status = 204;
    it.mails.options.reachable = true;
    REQUIRE(it.world.run_until([&] { return it.mails.delivered() > 0 && !alarm("outlet:mail"); }, 6min));
    REQUIRE(it.world.run_until([&] { return !alarm("outlet:hook"); }, 6min));
    auto posts = it.posts.size();
    it.world.run_for(10min);
    // Its own troubles were not sent: only the event and that it was over.
    CHECK(it.posts.size() <= posts + 1);
}

TEST_CASE("outlets: an alarm that comes shortly before an older one is given up goes once it can") {
    alarmed it;
    it.status = 503;
    it.mails.options.reachable = false;
    it.raise();
    it.world.run_for(50min);
    it.raise();
    it.world.run_for(20min);
    it.mails.options.reachable = true;
    it.status = 200;
    it.posts.clear();
    REQUIRE(it.world.run_until([&] { return it.mails.delivered() > 0 && it.posts.size() >= 2; }, 6min));
    auto mail = it.mails.waiting("anna@example.org").at(0).message;
    auto raised = mail.text.find("raised");
    REQUIRE(raised != std::string::npos);
    CHECK(mail.text.find("raised", raised + 1) == std::string::npos); // the first one waited for longer than an hour
    it.world.run_for(10min);
    CHECK(it.posts.size() == 2); // raised, over
}

TEST_CASE("outlets: what the boat puts into an alarm cannot make its mail invalid") {
    alarm_outlet_options options;
    options.boat = "A-Tirma";
    alarm_event one;
    one.how = severity::critical;
    one.text = "mast\nBcc: all\xff\x1b[2J";
    auto mail = alarm_mail(options, {one});
    CHECK(mail.subject == "A-Tirma: CRITICAL mast Bcc: all\\xff [2J");
    CHECK(mail.text.find("raised: mast Bcc: all\\xff [2J\n") != std::string::npos);
}

TEST_CASE("sender: what leads over land is refused with the reason, unless the operator overrides it") {
    alarmed it;
    waypoint la_isleta{28.1640, -15.4245};
    auto last = [&] { return it.port->latest()->commands->back(); };
    give_command add;
    add.command = commands::waypoint_add{la_isleta};
    REQUIRE(it.port->act(add));
    it.world.run_for(2s);
    CHECK(last().phase == command_phase::refused);
    CHECK(last().text.find("on land; it takes an override") != std::string::npos);
    add.over_limits = true;
    REQUIRE(it.port->act(add));
    it.world.run_for(2s);
    CHECK(last().phase == command_phase::failed); // there is no link: it was not the land that stopped it
    auto commands = it.port->latest()->commands->size();
    upload_mission list;
    list.points = {{28.1530, -15.4480}, la_isleta};
    REQUIRE(it.port->act(list));
    it.world.run_for(2s);
    CHECK(it.port->latest()->upload.phase == upload_phase::failed);
    CHECK(it.port->latest()->upload.text.find("ends on land") != std::string::npos);
    CHECK(it.port->latest()->commands->size() == commands);
    sail_to there;
    there.point = la_isleta;
    REQUIRE(it.port->act(there));
    it.world.run_for(2s);
    CHECK(last().phase == command_phase::refused);
}

TEST_CASE("outlets: a hook that refuses is not asked again") {
    alarmed it;
    it.status = 404;
    it.raise();
    it.world.run_for(10min);
    CHECK(it.posts.size() <= 2); // raised, over
}

} // namespace outlets_test
