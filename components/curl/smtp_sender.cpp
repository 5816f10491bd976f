#include <components/curl/smtp_sender.hpp>

#include <components/curl/curl_channel.hpp>
#include <components/curl/curl_easy.hpp>
#include <components/mail/imap_text.hpp>
#include <components/mail/mime.hpp>
#include <components/mail/smtp_text.hpp>

#include <ise/core/environment.hpp>

#include <fmt/format.h>

#include <array>

namespace atirma {

/// libcurl makes the connection, encrypts it and logs in. The mail itself it would hand over with blocking waits for
/// the server's answers, also in its multi interface: so that is done here.
class smtp_sender::dialogue {
public:
    dialogue(curl_channel& channel, ise::time_point until) : channel_(channel), until_(until) {}
    ise::task<ise::result<void>> hand_over(mail_message what, std::string content);

private:
    ise::task<ise::result<void>> ask(std::string order);

    curl_channel& channel_;
    ise::time_point until_;
    smtp_replies replies_;
};

smtp_sender::smtp_sender(curl_transfers& on, smtp_options options) : on_(on), options_(std::move(options)) {
    if (!options_.server.starts_with("smtp://") && !options_.server.starts_with("smtps://"))
        throw ise::error(
            ise::errc::invalid_argument,
            fmt::format("\"{}\" is not a mail server to send by: smtps://mail.example, or smtp://mail.example:587",
                        options_.server));
}

ise::task<ise::result<void>> smtp_sender::send(mail_message what) {
    auto& world = on_.on().env();
    mail_stamp stamp;
    stamp.sent_at = world.wall();
    stamp.random = world.random();
    auto text = write_mail(what, stamp);
    if (!text) co_return text.error();

    auto until = ise::saturating_add(on_.on().now(), options_.within);
    auto easy = std::make_unique<curl_easy>(options_.server, "smtp,smtps", options_.ca_file);
    if (!options_.user.empty()) {
        easy->set(CURLOPT_USERNAME, options_.user);
        easy->set(CURLOPT_PASSWORD, options_.password);
        easy->set(CURLOPT_SASL_IR, 1L); // a login in one step: any server takes it (RFC 4954), unlike IMAP's
    }
    easy->set(CURLOPT_USE_SSL, static_cast<long>(options_.clear_text ? CURLUSESSL_TRY : CURLUSESSL_ALL));
    auto channel = co_await curl_channel::open(on_, std::move(easy), options_.within);
    // Nobody has heard of the mail yet.
    if (!channel) co_return ise::failure(channel.error().code(), channel.error().message());
    dialogue with(**channel, until);
    auto outcome = co_await with.hand_over(what, smtp_content(*text));
    co_return outcome;
}

ise::task<ise::result<void>> smtp_sender::dialogue::hand_over(mail_message what, std::string content) {
    std::vector<std::string> orders{fmt::format("MAIL FROM:<{}>", what.from)};
    for (const auto& to : what.to) orders.push_back(fmt::format("RCPT TO:<{}>", to));
    orders.push_back("DATA");
    for (const auto& order : orders) {
        auto answered = co_await ask(order + "\r\n");
        if (!answered) co_return answered;
    }
    auto sent = co_await channel_.write(std::move(content), until_);
    if (!sent) co_return ise::failure(sent.error().code(), sent.error().message()); // without its end it is no mail
    auto taken = co_await ask(".\r\n");
    if (!taken) co_return taken;
    auto ignored = co_await channel_.write("QUIT\r\n", until_); // whatever comes of it, the mail is taken
    co_return ise::result<void>();
}

/// One step: 5xx is never, 4xx not now.
ise::task<ise::result<void>> smtp_sender::dialogue::ask(std::string order) {
    bool last = order == ".\r\n";
    auto doubt = [last](const ise::failure& why) {
        return ise::failure(why.code(), why.message(), last ? ise::execution::unknown : ise::execution::not_executed);
    };
    auto sent = co_await channel_.write(order, until_);
    if (!sent) co_return doubt(sent.error());
    std::array<char, 4096> piece;
    for (;;) {
        auto reply = replies_.next();
        if (!reply)
            co_return doubt(
                ise::failure(ise::errc::io_failed, fmt::format("{}: {}", channel_.server(), reply.error().message())));
        if (*reply) {
            auto said = imap_shown((*reply)->text);
            if ((*reply)->is_good()) co_return ise::result<void>();
            if ((*reply)->is_final())
                co_return ise::failure(ise::errc::refused,
                                       fmt::format("{} does not take the mail: {}", channel_.server(), said));
            co_return ise::failure(ise::errc::unreachable, fmt::format("{} does not take the mail now, try later: {}",
                                                                       channel_.server(), said));
        }
        auto got = co_await channel_.read_some(piece, until_);
        if (!got) co_return doubt(got.error());
        replies_.push(ise::as_bytes(std::string_view(piece.data(), *got)));
    }
}

} // namespace atirma
