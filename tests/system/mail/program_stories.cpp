// Iridium by mail, end to end: the programs as processes, and real mail servers between them and the gateway.
#include "mail_host.hpp"

#include <components/boat/telecommand.hpp>
#include <components/boat/telemetry.hpp>
#include <components/curl/imap_mailbox.hpp>
#include <components/curl/smtp_sender.hpp>
#include <components/iridium_mail/mail_format.hpp>

#include <support/catch.hpp>
#include <support/program.hpp>
#include <support/real_parties.hpp>

#include <fmt/format.h>

#include <csignal>
#include <filesystem>
#include <functional>
#include <memory>
#include <unistd.h>

using ise_test::Contains;
using ise_test::program;
using ise_test::ran;
using ise_test::run_program;
using ise_test::start_options;
using namespace atirma;
using namespace std::chrono_literals;

namespace {

constexpr const char* imei = "300034012345678";

/// The shore as an operator starts it, and Iridium's gateway, which is played here: a mailbox and a sender.
class mail_shore {
public:
    mail_shore() {
        host_.start();
        variables_.variables = {{"ATIRMA_MAIL_PASSWORD", "secret"}, {"ATIRMA_ROCKBLOCK_PASSWORD", ""}};
        names_ = std::make_unique<program>(
            std::vector<std::string>{"ise_name_server", "--listen", "tcp://127.0.0.1:0", "--fresh"}, variables_);
        auto listening = names_->read_line();
        REQUIRE_THAT(listening, Contains("tcp://"));
        variables_.variables.emplace_back("ISE_NAME_SERVER", listening.substr(listening.find("tcp://")));
        start_proxy();
    }
    ~mail_shore() {
        proxy_.reset();
        names_.reset();
        std::filesystem::remove_all(folder_);
    }
    mail_shore(const mail_shore&) = delete;
    mail_shore& operator=(const mail_shore&) = delete;

    void start_proxy() {
        std::filesystem::create_directories(folder_);
        proxy_ = std::make_unique<program>(std::vector<std::string>{"atirma",
                                                                    "run",
                                                                    "--log-level",
                                                                    "error",
                                                                    "iridium-proxy",
                                                                    "--imei",
                                                                    imei,
                                                                    "--webhook",
                                                                    "",
                                                                    "--database",
                                                                    folder_ + "/iridium.db",
                                                                    "--imap",
                                                                    host_.imaps(),
                                                                    "--smtp",
                                                                    host_.smtps(),
                                                                    "--mail-user",
                                                                    "boat",
                                                                    "--mail-from",
                                                                    "boat@example.org",
                                                                    "--mail-to",
                                                                    "shore@example.org",
                                                                    "--send-by",
                                                                    "mail",
                                                                    "--mail-unchecked",
                                                                    "--ca-file",
                                                                    host_.certificate()},
                                           variables_);
        auto line = proxy_->read_line();
        INFO(line);
        REQUIRE_THAT(line, Contains("started"));
    }
    void kill_proxy() {
        proxy_->signal(SIGKILL);
        proxy_->wait();
    }

    /// Somebody who waits for so many packets.
    std::unique_ptr<program> listener(int packets) {
        return std::make_unique<program>(std::vector<std::string>{"ise", "--wait", "--timeout", "120s", "echo",
                                                                  "--count", std::to_string(packets),
                                                                  "atirma/shore/iridium", "telemetry"},
                                         variables_);
    }
    ran telecommand(std::uint32_t id) {
        return run_program({"ise", "--wait", "--timeout", "5s", "call", "atirma/shore/iridium", "telecommand",
                            fmt::format(R"({{"id":{},"command":{{"kind":"ping"}},"valid_s":3600}})", id)},
                           variables_);
    }
    std::string account() {
        return run_program({"ise", "--wait", "--timeout", "60s", "echo", "--count", "1", "atirma/shore/iridium",
                            "iridium_account"},
                           variables_)
            .out;
    }
    bool until(const std::function<bool()>& done) {
        auto limit = std::chrono::steady_clock::now() + std::chrono::minutes(3); // only what is broken takes that long
        while (!done())
            if (std::chrono::steady_clock::now() > limit) return false;
        return true;
    }

    // The gateway.
    void mail(const ise::bytes& payload, std::uint16_t momsn, std::uint16_t mtmsn = 0) {
        iridium_mail::mo_session session;
        session.imei = imei;
        session.momsn = momsn;
        session.mtmsn = mtmsn;
        session.session_at = std::chrono::sys_days(std::chrono::year(2026) / 11 / 21) + std::chrono::seconds(momsn);
        session.payload = payload;
        session.size = static_cast<std::uint32_t>(payload.size());
        send(iridium_mail::make_mo_mail(session, "boat@example.org"));
    }
    void send(mail_message what) {
        smtp_options how;
        how.server = host_.smtps();
        how.user = "shore";
        how.password = "secret";
        how.ca_file = host_.certificate();
        smtp_sender sender(transfers_, how);
        auto sent = all_.run(here_, sender.send(std::move(what)));
        REQUIRE((sent ? std::string() : sent.error().message()) == "");
    }
    /// The next order that was mailed to it.
    iridium_mail::mt_order order() {
        imap_options how;
        how.server = host_.imaps();
        how.user = "shore";
        how.password = "secret";
        how.ca_file = host_.certificate();
        imap_mailbox box(transfers_, how);
        for (;;) {
            auto mails = all_.run(here_, box.fetch(10));
            REQUIRE((mails ? std::string() : mails.error().message()) == "");
            if (!mails->empty()) {
                REQUIRE(all_.run(here_, box.done(mails->front().uid)));
                auto read = iridium_mail::read_mt_mail(mails->front().message);
                REQUIRE((read ? std::string() : read.error().message()) == "");
                return *read;
            }
            REQUIRE(all_.run(here_, box.wait(30s)));
        }
    }
    std::size_t mails_at_the_gateway() const { return host_.count("shore"); }

private:
    mail_host host_;
    std::string folder_ =
        fmt::format("{}/ise-iridium-mail-{}", std::filesystem::temp_directory_path().string(), ::getpid());
    start_options variables_;
    std::unique_ptr<program> names_, proxy_;
    ise_test::real_parties all_;
    ise_test::party& here_ = all_.add("gateway");
    curl_transfers transfers_{here_.on};
};

ise::bytes place(std::uint32_t sequence) {
    location at;
    at.latitude_deg = 28.15;
    at.longitude_deg = -15.45;
    packet_header header;
    header.boot = 7;
    header.sequence = sequence;
    header.measured_at =
        utc_time(std::chrono::sys_days(std::chrono::year(2026) / 11 / 21)) + std::chrono::seconds(sequence);
    return encode_telemetry(header, at);
}

ise::bytes answer_to(std::uint32_t id) {
    acknowledgement ack;
    ack.header.boot = 7;
    ack.header.sequence = 900;
    ack.id = id;
    ack.kind = command_kind::ping;
    ack.text = "boot 7";
    return encode_acknowledgement(ack);
}

} // namespace

TEST_CASE("Iridium by mail as processes: positions come, a telecommand is answered, also over a killed proxy") {
    if (auto why = mail_host::missing()) {
        WARN("skipped: " << *why);
        return;
    }
    mail_shore s;
    auto somebody = s.listener(1);
    s.mail(place(1), 1);
    auto heard = somebody->wait();
    INFO(heard.err);
    CHECK_THAT(heard.out, Contains(R"("link":"iridium")") && Contains(R"("boot":7,"sequence":1)"));

    auto asked = s.telecommand(17);
    INFO(asked.err);
    CHECK_THAT(asked.out, Contains(R"("state":"pending")"));
    auto order = s.order();
    REQUIRE(order.messages.size() == 1);
    CHECK(order.imeis == std::vector<std::string>{imei});
    auto command = parse_telecommand(order.messages.front().payload);
    REQUIRE(command);
    CHECK(command->id == 17);
    iridium_mail::disposition word;
    word.queued = true;
    word.imei = imei;
    word.attachment = order.messages.front().name;
    word.mtmsn = 42;
    word.queue_position = 1;
    s.send(iridium_mail::make_disposition_mail(word, "boat@example.org"));
    std::string message;
    REQUIRE(s.until([&] {
        message = s.account();
        return message.find("queued at the gateway as 42") != std::string::npos;
    }));

    // It dies; what the boat says meanwhile lies in the mailbox, and the telecommand is not paid for twice.
    s.kill_proxy();
    s.mail(answer_to(17), 2, 42);
    s.mail(place(2), 3);
    s.start_proxy();
    auto later = s.listener(1);
    auto more = later->wait();
    INFO(more.err);
    CHECK_THAT(more.out, Contains(R"("sequence":2)"));
    REQUIRE(s.until([&] {
        asked = s.telecommand(17);
        return asked.out.find(R"("state":"acknowledged")") != std::string::npos;
    }));
    CHECK_THAT(asked.out, Contains(R"("result":"done")") && Contains("boot 7"));
    CHECK(s.mails_at_the_gateway() == 1);
}
