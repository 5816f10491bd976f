#include <components/iridium/rockblock.hpp>
#include <components/iridium/text.hpp>
#include <components/iridium_proxy/mt_path.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

constexpr ise::duration post_time = std::chrono::seconds(20);

class rockblock_path final : public mt_path {
public:
    rockblock_path(std::shared_ptr<ise::http_client> client, rockblock_account account)
        : client_(std::move(client)), account_(std::move(account)) {}

    ise::task<link_outcome> give(mt_message what) override {
        iridium::mt_submission submission;
        submission.imei = std::move(what.imei);
        submission.username = account_.username;
        submission.password = account_.password;
        submission.data = iridium::to_hex(what.raw);
        ise::http_exchange request;
        request.method = "POST";
        request.url = account_.url;
        request.headers.emplace_back("Content-Type", "application/x-www-form-urlencoded");
        request.body = iridium::encode_mt_submission(submission);
        auto answer = co_await client_->exchange(std::move(request), post_time);
        co_return outcome_of_rockblock(answer);
    }

    std::string where() const override { return account_.url; }

private:
    std::shared_ptr<ise::http_client> client_;
    rockblock_account account_;
};

} // namespace

link_outcome outcome_of_rockblock(const ise::result<ise::http_answer>& answer) {
    using kind = link_outcome::kind;
    if (!answer) {
        auto code = answer.error().code();
        bool sent_nothing = code == ise::errc::unreachable || code == ise::errc::invalid_argument;
        return make_outcome(sent_nothing ? kind::later : kind::unknown,
                            "the gateway was not reached: " + answer.error().message());
    }
    auto reply = iridium::parse_mt_reply(answer->body);
    if (!reply) {
        auto text = fmt::format("HTTP {}: {}", answer->status, reply.error().message());
        // A 5xx may stand before a gateway that had taken it; a 4xx says that it was not let in.
        bool nothing = answer->status >= 300 && answer->status < 500;
        return make_outcome(nothing ? kind::later : kind::unknown, std::move(text));
    }
    if (reply->accepted) {
        auto text = reply->reference.empty() ? std::string("queued at the gateway")
                                             : "queued at the gateway as " + reply->reference;
        return make_outcome(kind::accepted, std::move(text), reply->reference);
    }
    auto text = fmt::format("{} (FAILED {}: {})", iridium::explain_mt_failure(reply->code), reply->code, reply->text);
    return make_outcome(iridium::mt_failure_passes(reply->code) ? kind::later : kind::refused, std::move(text));
}

std::unique_ptr<mt_path> make_rockblock_path(std::shared_ptr<ise::http_client> client, rockblock_account account) {
    return std::make_unique<rockblock_path>(std::move(client), std::move(account));
}

} // namespace atirma
