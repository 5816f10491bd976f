#pragma once
#include <components/boat/telecommand_tracker.hpp>
#include <components/mail/mail.hpp>
#include <ise/http/http_client.hpp>

#include <ise/core/endpoint.hpp>
#include <ise/core/loop.hpp>

#include <memory>

namespace atirma {

/// A message to the boat, for whichever way to the gateway.
struct mt_message {
    std::uint32_t id = 0; ///< of the telecommand
    std::string imei;
    ise::bytes raw;
};

/// One way of giving messages to the gateway. Used on one loop, one message at a time; outlives its tasks.
class mt_path {
public:
    virtual ~mt_path() = default;
    /// Never throws but when it is cancelled; all that can go wrong is an outcome. Cancellation: terminal, outcome
    /// unknown.
    virtual ise::task<link_outcome> give(mt_message what) = 0;
    /// "http://…", for people.
    virtual std::string where() const = 0;
};

struct rockblock_account {
    std::string url = "https://core.rock7.com/rockblock/MT";
    std::string username;
    std::string password;
};

/// By RockBLOCK's web service.
std::unique_ptr<mt_path> make_rockblock_path(std::shared_ptr<ise::http_client> client, rockblock_account account);
/// By DirectIP.
std::unique_ptr<mt_path> make_directip_path(ise::loop& on, ise::endpoint gateway);

/// By mail; the gateway's word about it comes back by mail, naming the attachment: see `telecommand_of_attachment`.
std::unique_ptr<mt_path> make_mail_path(std::shared_ptr<mail_sender> sender, std::string from, std::string gateway);
/// "c17.sbd": 17. Nothing for other names.
std::optional<std::uint32_t> telecommand_of_attachment(std::string_view name);

/// What RockBLOCK's answer says about a submission.
link_outcome outcome_of_rockblock(const ise::result<ise::http_answer>& answer);

} // namespace atirma
