#include <components/curl/imap_mailbox.hpp>

#include <components/curl/imap_session.hpp>
#include <components/mail/imap_text.hpp>
#include <components/mail/mime.hpp>

#include <ise/core/sleep.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {

imap_mailbox::imap_mailbox(curl_transfers& on, imap_options options) : on_(on), options_(std::move(options)) {
    if (!options_.server.starts_with("imap://") && !options_.server.starts_with("imaps://"))
        throw ise::error(
            ise::errc::invalid_argument,
            fmt::format("\"{}\" is not a mail server to read from: imaps://mail.example, or imap://mail.example:143",
                        options_.server));
    folder_ = imap_quoted(options_.folder).value();
    done_folder_ = imap_quoted(options_.done_folder).value();
}
imap_mailbox::~imap_mailbox() = default;

namespace {

/// Ends a session that was left in the middle of something: by an error, or because the task was given up.
class unless_done {
public:
    explicit unless_done(std::unique_ptr<imap_session>& of) : session_(of) {}
    unless_done(const unless_done&) = delete;
    unless_done& operator=(const unless_done&) = delete;
    ~unless_done() {
        if (!done_) session_.reset();
    }
    void done() noexcept { done_ = true; }

private:
    std::unique_ptr<imap_session>& session_;
    bool done_ = false;
};

/// For a mailbox a lost session is one that could not be reached: nothing is lost by trying again.
template <class T>
ise::result<T> lost_is_unreachable(ise::result<T> outcome) {
    if (outcome || outcome.error().code() != ise::errc::peer_lost) return outcome;
    return ise::failure(ise::errc::unreachable, outcome.error().message());
}

mail_message unreadable(std::string why) {
    mail_message made;
    made.text = std::move(why);
    return made;
}

} // namespace

ise::task<ise::result<void>> imap_mailbox::connected() {
    if (session_ && session_->lost()) session_.reset();
    if (session_) co_return ise::result<void>();
    auto made = co_await imap_session::open(on_, options_, folder_);
    if (!made) co_return made.error();
    session_ = std::move(*made);
    co_return ise::result<void>();
}

ise::task<ise::result<std::vector<stored_mail>>> imap_mailbox::fetch(std::size_t most) {
    unless_done guard(session_);
    auto found = co_await fetch_now(most);
    if (found) guard.done();
    co_return lost_is_unreachable(std::move(found));
}

ise::task<ise::result<std::vector<stored_mail>>> imap_mailbox::fetch_now(std::size_t most) {
    auto there = co_await connected();
    if (!there) co_return there.error();
    session_->forget_news();
    auto what = options_.when_done == imap_done::seen ? "UID SEARCH UNSEEN UNDELETED" : "UID SEARCH UNDELETED";
    auto answer = co_await session_->command(what);
    if (!answer) co_return answer.error();
    if (!answer->ok) co_return session_->refusal("to search", *answer);
    std::vector<std::uint32_t> uids;
    for (const auto& reply : answer->replies)
        if (auto some = imap_found(reply.text)) uids.insert(uids.end(), some->begin(), some->end());
    std::sort(uids.begin(), uids.end());
    uids.erase(std::unique(uids.begin(), uids.end()), uids.end());
    if (uids.size() > most) uids.resize(most);
    std::vector<stored_mail> found;
    for (auto uid : uids) {
        auto one = co_await fetch_one(uid);
        if (!one) co_return one.error();
        if (*one) found.push_back(std::move(**one));
    }
    validity_ = session_->validity();
    co_return found;
}

ise::task<ise::result<std::optional<stored_mail>>> imap_mailbox::fetch_one(std::uint32_t uid) {
    // One byte more than is taken, so that a mail beyond the limit is seen and not cut. PEEK: it is marked when it is
    // done.
    auto answer = co_await session_->command(
        fmt::format("UID FETCH {} (UID BODY.PEEK[]<0.{}>)", uid, options_.max_mail_bytes + 1));
    if (!answer) co_return answer.error();
    if (!answer->ok) co_return session_->refusal(fmt::format("the mail {}", uid), *answer);
    for (auto& reply : answer->replies) {
        if (imap_fetched_uid(reply.text) != uid || reply.literals.size() > 1) continue;
        if (reply.literals.empty() && reply.text.find("BODY[") == std::string::npos) continue; // only its flags
        stored_mail made;
        made.uid = uid;
        auto raw = reply.literals.empty() ? std::string() : std::move(reply.literals[0]);
        mime_limits limits;
        limits.max_bytes = options_.max_mail_bytes;
        auto mail = read_mail(raw, limits);
        if (mail) made.message = std::move(*mail);
        else if (raw.size() > limits.max_bytes)
            made.message = unreadable(fmt::format("a mail of more than {} bytes", limits.max_bytes));
        else made.message = unreadable(mail.error().message());
        co_return std::optional<stored_mail>(std::move(made));
    }
    co_return std::optional<stored_mail>(); // somebody has removed it meanwhile
}

ise::task<ise::result<void>> imap_mailbox::done(std::uint32_t uid) {
    unless_done guard(session_);
    auto outcome = co_await mark(uid);
    if (outcome) guard.done();
    co_return lost_is_unreachable(std::move(outcome));
}

ise::task<ise::result<void>> imap_mailbox::mark(std::uint32_t uid) {
    auto there = co_await connected();
    if (!there) co_return there;
    if (validity_ != session_->validity())
        co_return ise::failure(
            ise::errc::io_failed,
            fmt::format("the folder {} was made anew: the number {} says nothing any more, fetch again",
                        options_.folder, uid));
    if (options_.when_done == imap_done::moved) {
        auto away = co_await put_away(uid);
        if (!away || session_->has("MOVE")) co_return away;
    }
    auto flags = options_.when_done == imap_done::seen ? "\\Seen" : "\\Seen \\Deleted";
    auto marked = co_await session_->command(fmt::format("UID STORE {} +FLAGS.SILENT ({})", uid, flags));
    if (!marked) co_return marked.error();
    if (!marked->ok) co_return session_->refusal(fmt::format("to mark the mail {}", uid), *marked);
    if (options_.when_done == imap_done::seen) co_return ise::result<void>();
    std::string expunge = "EXPUNGE";
    if (session_->has("UIDPLUS")) expunge = fmt::format("UID EXPUNGE {}", uid); // and nobody else's
    auto gone = co_await session_->command(expunge);
    if (!gone) co_return gone.error();
    if (!gone->ok) co_return session_->refusal(fmt::format("to remove the mail {}", uid), *gone);
    co_return ise::result<void>();
}

ise::task<ise::result<void>> imap_mailbox::put_away(std::uint32_t uid) {
    auto order = fmt::format("UID {} {} {}", session_->has("MOVE") ? "MOVE" : "COPY", uid, done_folder_);
    for (bool first = true;; first = false) {
        auto moved = co_await session_->command(order);
        if (!moved) co_return moved.error();
        if (moved->ok) co_return ise::result<void>();
        if (!first || !imap_code(moved->text, "TRYCREATE"))
            co_return session_->refusal(fmt::format("to move the mail {} to {}", uid, done_folder_), *moved);
        auto made = co_await session_->command("CREATE " + done_folder_);
        if (!made) co_return made.error();
        if (!made->ok) co_return session_->refusal("to make the folder " + done_folder_, *made);
    }
}

ise::task<ise::result<void>> imap_mailbox::wait(ise::duration at_most) {
    unless_done guard(session_);
    auto outcome = co_await watch(at_most);
    if (outcome) guard.done();
    co_return lost_is_unreachable(std::move(outcome));
}

ise::task<ise::result<void>> imap_mailbox::watch(ise::duration at_most) {
    auto end = ise::saturating_add(on_.on().now(), at_most);
    auto there = co_await connected();
    if (!there) co_return there;
    while (!session_->news()) {
        auto left = end - on_.on().now();
        if (left <= ise::duration::zero()) co_return ise::result<void>();
        if (session_->has("IDLE")) {
            auto idled = co_await session_->idle(left);
            if (!idled) co_return idled;
            continue;
        }
        co_await ise::sleep_for(on_.on(), std::min(left, options_.poll_period));
        auto asked = co_await session_->command("NOOP");
        if (!asked) co_return asked.error();
    }
    co_return ise::result<void>();
}

} // namespace atirma
