#pragma once
#include <components/curl/curl_transfers.hpp>
#include <components/curl/imap_options.hpp>
#include <components/mail/imap_replies.hpp>

#include <memory>
#include <set>
#include <string>
#include <vector>

namespace atirma {

class curl_channel;

/// One login at an IMAP server with a folder selected. After any error but one with `is_refusal` it is of no use any
/// more; the same holds when a task of it was given up. Lifetime: `curl_transfers` outlives it.
class imap_session {
public:
    /// Connects, logs in and selects. Errors: unreachable, unauthorized, timed_out, io_failed. Cancellation: terminal.
    static ise::task<ise::result<std::unique_ptr<imap_session>>> open(curl_transfers& on, const imap_options& options,
                                                                      std::string quoted_folder);
    ~imap_session();

    struct answer {
        std::vector<imap_reply> replies; ///< untagged, in order
        std::string text;                ///< of the tagged one: "OK done"
        bool ok = false;                 ///< else the server has refused: NO
    };
    /// One command and its answer. Errors: peer_lost, timed_out, io_failed (the server breaks the protocol).
    ise::task<ise::result<answer>> command(std::string text);
    /// Waits by IDLE until the server tells of new mail, or for `at_most`.
    ise::task<ise::result<void>> idle(ise::duration at_most);
    /// Whether the server has hung up meanwhile.
    bool lost();

    bool has(const std::string& capability) const { return capabilities_.contains(capability); }
    std::uint32_t validity() const noexcept { return validity_; }
    /// Whether mail came since `forget_news()`.
    bool news() const noexcept { return news_; }
    void forget_news() noexcept { news_ = false; }
    ise::failure refusal(std::string_view doing, const answer& what) const;

private:
    imap_session(curl_transfers& on, std::unique_ptr<curl_channel> channel, const imap_options& options);
    ise::task<ise::result<imap_reply>> next(ise::time_point until);
    void hear(const imap_reply& reply);
    ise::failure broken(const std::string& what) const;

    curl_transfers& on_;
    std::unique_ptr<curl_channel> channel_;
    ise::duration within_;
    imap_replies replies_;
    std::set<std::string> capabilities_;
    std::uint32_t validity_ = 0;
    std::uint32_t exist_ = 0;
    bool news_ = false;
    unsigned commands_ = 0;
};

} // namespace atirma
