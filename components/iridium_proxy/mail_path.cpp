#include <components/iridium/text.hpp>
#include <components/iridium_mail/mail_format.hpp>
#include <components/iridium_proxy/mt_path.hpp>

#include <fmt/format.h>

#include <limits>

namespace atirma {
namespace {

class mail_path final : public mt_path {
public:
    mail_path(std::shared_ptr<mail_sender> sender, std::string from, std::string gateway)
        : sender_(std::move(sender)), from_(std::move(from)), gateway_(std::move(gateway)) {}

    ise::task<link_outcome> give(mt_message what) override {
        std::vector<iridium_mail::mt_message> messages(1);
        messages[0].name = fmt::format("c{}.sbd", what.id);
        messages[0].payload = std::move(what.raw);
        std::vector<std::string> imeis{what.imei};
        using kind = link_outcome::kind;
        auto mail = iridium_mail::make_mt_mail(from_, imeis, messages, gateway_);
        if (!mail) co_return make_outcome(kind::refused, mail.error().message());
        auto sent = co_await sender_->send(std::move(*mail));
        if (sent)
            co_return make_outcome(kind::accepted, "mailed to the gateway, whose answer is awaited", messages[0].name);
        auto code = sent.error().code();
        bool never = code == ise::errc::refused || code == ise::errc::invalid_argument;
        bool stayed = sent.error().executed() == ise::execution::not_executed;
        co_return make_outcome(never    ? kind::refused
                               : stayed ? kind::later
                                        : kind::unknown,
                               "the mail was not taken: " + sent.error().message());
    }

    std::string where() const override { return "mailto:" + gateway_; }

private:
    std::shared_ptr<mail_sender> sender_;
    std::string from_, gateway_;
};

} // namespace

std::unique_ptr<mt_path> make_mail_path(std::shared_ptr<mail_sender> sender, std::string from, std::string gateway) {
    return std::make_unique<mail_path>(std::move(sender), std::move(from), std::move(gateway));
}

std::optional<std::uint32_t> telecommand_of_attachment(std::string_view name) {
    if (!name.starts_with('c') || !name.ends_with(".sbd")) return std::nullopt;
    auto id = iridium::parse_integer("the id of a telecommand", name.substr(1, name.size() - 5), 1,
                                     std::numeric_limits<std::uint32_t>::max());
    if (!id) return std::nullopt;
    return static_cast<std::uint32_t>(*id);
}

} // namespace atirma
