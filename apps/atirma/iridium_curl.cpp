#include "iridium_curl.hpp"

namespace atirma {
namespace {

/// The transfers go last.
template <class Interface, class Client>
struct owning : Interface {
    template <class Options>
    owning(ise::loop& on, Options options) : transfers(on), client(transfers, std::move(options)) {}
    curl_transfers transfers;
    Client client;
};

struct owning_http final : owning<ise::http_client, curl_http_client> {
    using owning::owning;
    ise::task<ise::result<ise::http_answer>> exchange(ise::http_exchange what, ise::duration within) override {
        return client.exchange(std::move(what), within);
    }
};

struct owning_mailbox final : owning<mailbox, imap_mailbox> {
    using owning::owning;
    ise::task<ise::result<std::vector<stored_mail>>> fetch(std::size_t most) override { return client.fetch(most); }
    ise::task<ise::result<void>> done(std::uint32_t uid) override { return client.done(uid); }
    ise::task<ise::result<void>> wait(ise::duration at_most) override { return client.wait(at_most); }
};

struct owning_sender final : owning<mail_sender, smtp_sender> {
    using owning::owning;
    ise::task<ise::result<void>> send(mail_message what) override { return client.send(std::move(what)); }
};

} // namespace

std::unique_ptr<ise::http_client> make_curl_http_client(ise::loop& on, curl_http_options options) {
    return std::make_unique<owning_http>(on, std::move(options));
}

std::unique_ptr<mailbox> make_imap_mailbox(ise::loop& on, imap_options options) {
    return std::make_unique<owning_mailbox>(on, std::move(options));
}

std::unique_ptr<mail_sender> make_smtp_sender(ise::loop& on, smtp_options options) {
    return std::make_unique<owning_sender>(on, std::move(options));
}

} // namespace atirma
