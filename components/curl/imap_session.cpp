#include <components/curl/imap_session.hpp>

#include <components/curl/curl_channel.hpp>
#include <components/curl/curl_easy.hpp>
#include <components/mail/imap_text.hpp>

#include <fmt/format.h>

#include <array>

namespace atirma {
namespace {

imap_limits limits_for(const imap_options& options) {
    imap_limits made;
    made.max_literal_bytes = options.max_mail_bytes + 1024;
    return made;
}

} // namespace

imap_session::imap_session(curl_transfers& on, std::unique_ptr<curl_channel> channel, const imap_options& options)
    : on_(on), channel_(std::move(channel)), within_(options.within), replies_(limits_for(options)) {}
imap_session::~imap_session() = default;

ise::failure imap_session::broken(const std::string& what) const {
    return ise::failure(ise::errc::io_failed, fmt::format("{}: {}", channel_->server(), what));
}

ise::failure imap_session::refusal(std::string_view doing, const answer& what) const {
    return broken(fmt::format("the server refuses {}: {}", doing, imap_shown(what.text)));
}

ise::task<ise::result<std::unique_ptr<imap_session>>> imap_session::open(curl_transfers& on,
                                                                         const imap_options& options,
                                                                         std::string quoted_folder) {
    auto easy = std::make_unique<curl_easy>(options.server, "imap,imaps", options.ca_file);
    easy->set(CURLOPT_USERNAME, options.user);
    easy->set(CURLOPT_PASSWORD, options.password);
    easy->set(CURLOPT_USE_SSL, static_cast<long>(options.clear_text ? CURLUSESSL_TRY : CURLUSESSL_ALL));
    auto channel = co_await curl_channel::open(on, std::move(easy), options.within);
    if (!channel) {
        // For a mailbox there is no difference: it was not reached, and may be tried again.
        auto code = channel.error().code() == ise::errc::peer_lost ? ise::errc::unreachable : channel.error().code();
        co_return ise::failure(code, channel.error().message());
    }
    std::unique_ptr<imap_session> made(new imap_session(on, std::move(*channel), options));

    auto capable = co_await made->command("CAPABILITY");
    if (!capable) co_return capable.error();
    for (const auto& reply : capable->replies)
        for (const char* name : {"IDLE", "MOVE", "UIDPLUS"})
            if (imap_has_capability(reply.text, name)) made->capabilities_.insert(name);
    auto selected = co_await made->command("SELECT " + quoted_folder);
    if (!selected) co_return selected.error();
    if (!selected->ok) co_return made->refusal(fmt::format("the folder {}", quoted_folder), *selected);
    for (const auto& reply : selected->replies)
        if (auto value = imap_code(reply.text, "UIDVALIDITY")) made->validity_ = imap_number(*value).value_or(0);
    made->news_ = true; // everything is new
    co_return made;
}

void imap_session::hear(const imap_reply& reply) {
    if (reply.what != imap_reply::kind::untagged) return;
    if (auto count = imap_exists(reply.text)) {
        news_ = news_ || *count > exist_;
        exist_ = *count;
    } else if (auto blank = reply.text.find(' '); blank != std::string::npos &&
                                                  imap_begins(std::string_view(reply.text).substr(blank), "EXPUNGE") &&
                                                  exist_ > 0) {
        --exist_;
    }
}

ise::task<ise::result<imap_reply>> imap_session::next(ise::time_point until) {
    std::array<char, 16384> piece;
    for (;;) {
        auto reply = replies_.next();
        if (!reply) co_return broken(reply.error().message());
        if (*reply) {
            hear(**reply);
            co_return std::move(**reply);
        }
        auto got = co_await channel_->read_some(piece, until);
        if (!got) co_return got.error();
        replies_.push(ise::as_bytes(std::string_view(piece.data(), *got)));
    }
}

ise::task<ise::result<imap_session::answer>> imap_session::command(std::string text) {
    auto until = ise::saturating_add(on_.on().now(), within_);
    auto tag = fmt::format("I{}", ++commands_);
    auto sent = co_await channel_->write(fmt::format("{} {}\r\n", tag, text), until);
    if (!sent) co_return sent.error();
    answer made;
    for (std::size_t held = 0;;) {
        auto reply = co_await next(until);
        if (!reply) co_return reply.error();
        if (reply->what == imap_reply::kind::tagged) {
            if (reply->tag != tag)
                co_return broken(fmt::format("an answer to \"{}\" that nobody asked for", imap_shown(reply->tag)));
            made.ok = imap_begins(reply->text, "OK");
            if (!made.ok && !imap_begins(reply->text, "NO"))
                co_return broken(fmt::format("the server does not understand \"{}\": {}", imap_shown(text),
                                             imap_shown(reply->text)));
            made.text = std::move(reply->text);
            co_return made;
        }
        if (imap_begins(reply->text, "BYE"))
            co_return ise::failure(
                ise::errc::peer_lost,
                fmt::format("{}: the server says goodbye: {}", channel_->server(), imap_shown(reply->text)),
                ise::execution::unknown);
        held += reply->text.size() + 64;
        if (held > (4u << 20)) co_return broken("an answer without end");
        made.replies.push_back(std::move(*reply));
    }
}

ise::task<ise::result<void>> imap_session::idle(ise::duration at_most) {
    // A server may end the session of one that idles for half an hour (RFC 2177).
    auto end = ise::saturating_add(on_.on().now(), std::min<ise::duration>(at_most, std::chrono::minutes(25)));
    auto begin_within = ise::saturating_add(on_.on().now(), within_);
    auto tag = fmt::format("I{}", ++commands_);
    auto sent = co_await channel_->write(tag + " IDLE\r\n", begin_within);
    if (!sent) co_return sent;
    for (bool idling = false; !(idling && news_);) {
        auto reply = co_await next(idling ? end : begin_within);
        if (!reply && idling && reply.error().code() == ise::errc::timed_out) break;
        if (!reply) co_return reply.error();
        if (reply->what == imap_reply::kind::continuation) idling = true;
        if (reply->what == imap_reply::kind::tagged)
            co_return broken(fmt::format("IDLE ends by itself: {}", imap_shown(reply->text)));
        if (imap_begins(reply->text, "BYE"))
            co_return ise::failure(ise::errc::peer_lost, fmt::format("{}: the server says goodbye: {}",
                                                                     channel_->server(), imap_shown(reply->text)));
    }
    auto end_within = ise::saturating_add(on_.on().now(), within_);
    auto over = co_await channel_->write("DONE\r\n", end_within);
    if (!over) co_return over;
    for (;;) {
        auto reply = co_await next(end_within);
        if (!reply) co_return reply.error();
        if (reply->what == imap_reply::kind::tagged) co_return ise::result<void>();
    }
}

bool imap_session::lost() {
    std::array<char, 4096> piece;
    for (;;) {
        auto got = channel_->try_read(piece);
        if (!got) return true;
        if (*got == 0) break;
        replies_.push(ise::as_bytes(std::string_view(piece.data(), *got)));
    }
    for (;;) {
        auto reply = replies_.next();
        if (!reply) return true;
        if (!*reply) return false;
        if (imap_begins((*reply)->text, "BYE")) return true;
        hear(**reply);
    }
}

} // namespace atirma
