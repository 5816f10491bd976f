#include <components/mail/memory_mail.hpp>

#include <ise/core/sleep.hpp>
#include <ise/core/waiter.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

std::string lower(std::string text) {
    for (char& c : text)
        if (c >= 'A' && c <= 'Z') c = static_cast<char>(c - 'A' + 'a');
    return text;
}

} // namespace

class memory_mail::box final : public mailbox {
public:
    box(ise::loop& on, memory_mail& server, const std::string& address)
        : on_(on), server_(server), folder_(server.folder_of(address)), new_mail_(on) {
        folder_.open.insert(this);
    }
    ~box() override { folder_.open.erase(this); }

    ise::task<ise::result<std::vector<stored_mail>>> fetch(std::size_t most) override {
        co_await ise::sleep_for(on_, server_.options.answer_after);
        if (auto why = server_.trouble()) co_return *why;
        std::vector<stored_mail> found;
        for (const auto& [uid, mail] : folder_.mails) {
            if (found.size() == most) break;
            found.push_back(stored_mail{uid, mail});
        }
        seen_ = folder_.next_uid - 1;
        co_return found;
    }

    ise::task<ise::result<void>> done(std::uint32_t uid) override {
        co_await ise::sleep_for(on_, server_.options.answer_after);
        if (auto why = server_.trouble()) co_return *why;
        if (folder_.mails.erase(uid) != 0) ++server_.done_;
        co_return ise::result<void>();
    }

    ise::task<ise::result<void>> wait(ise::duration at_most) override {
        if (auto why = server_.trouble()) co_return *why;
        if (folder_.next_uid - 1 != seen_) co_return ise::result<void>();
        ise::timer late(on_, [this] { new_mail_.resume({}); });
        late.arm(ise::saturating_add(on_.now(), at_most));
        co_await new_mail_.wait(); // throws what it was resumed with
        co_return ise::result<void>();
    }

    void on_delivery() { new_mail_.resume({}); }

private:
    ise::loop& on_;
    memory_mail& server_;
    folder& folder_;
    ise::waiter<std::error_code> new_mail_;
    std::uint32_t seen_ = 0; // the last fetch saw the mails up to this one
};

class memory_mail::sender final : public mail_sender {
public:
    sender(ise::loop& on, memory_mail& server) : on_(on), server_(server) {}

    ise::task<ise::result<void>> send(mail_message what) override {
        co_await ise::sleep_for(on_, server_.options.answer_after);
        if (auto why = server_.take(what)) co_return *why;
        co_return ise::result<void>();
    }

private:
    ise::loop& on_;
    memory_mail& server_;
};

memory_mail::memory_mail(memory_mail_options with)
    : options(std::move(with)), self_(std::make_shared<memory_mail*>(this)) {}
memory_mail::~memory_mail() { *self_ = nullptr; }

std::unique_ptr<mailbox> memory_mail::open_mailbox(ise::loop& on, std::string address) {
    return std::make_unique<box>(on, *this, address);
}
std::unique_ptr<mail_sender> memory_mail::open_sender(ise::loop& on) { return std::make_unique<sender>(on, *this); }

memory_mail::folder& memory_mail::folder_of(const std::string& address) { return folders_[lower(address)]; }

std::optional<ise::failure> memory_mail::trouble() const {
    if (!options.reachable) return ise::failure(ise::errc::unreachable, "the mail server is not reached");
    if (!options.accepts_logins)
        return ise::failure(ise::errc::unauthorized,
                            "the mail server does not accept the login: look at user and password");
    return std::nullopt;
}

std::optional<ise::failure> memory_mail::take(const mail_message& what) {
    if (auto why = trouble()) return why;
    if (what.to.empty()) return ise::failure(ise::errc::invalid_argument, "a mail without a recipient");
    for (const auto& address : what.to) {
        auto known = options.refused.find(lower(address));
        if (known != options.refused.end())
            return ise::failure(ise::errc::refused,
                                fmt::format("the mail server refuses mail for {}: {}", address, known->second));
        if (folder_of(address).mails.size() >= options.max_mails)
            return ise::failure(ise::errc::refused,
                                fmt::format("the mail server refuses mail for {}: 552 mailbox full", address));
    }
    if (!options.later || options.transit <= ise::duration::zero()) {
        deliver(what);
    } else {
        options.later(options.transit, [weak = std::weak_ptr(self_), what] {
            auto self = weak.lock();
            if (self && *self) (*self)->deliver(what);
        });
    }
    return std::nullopt;
}

bool memory_mail::deliver(const mail_message& what) {
    bool all = true;
    for (const auto& address : what.to) {
        auto& into = folder_of(address);
        if (into.mails.size() >= options.max_mails) {
            all = false;
            continue;
        }
        into.mails.emplace(into.next_uid++, what);
        ++delivered_;
        for (auto* reader : into.open) reader->on_delivery();
    }
    return all;
}

std::vector<stored_mail> memory_mail::waiting(const std::string& address) const {
    std::vector<stored_mail> found;
    auto known = folders_.find(lower(address));
    if (known == folders_.end()) return found;
    for (const auto& [uid, mail] : known->second.mails) found.push_back(stored_mail{uid, mail});
    return found;
}

} // namespace atirma
