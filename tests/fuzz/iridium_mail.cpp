// link: atirma_iridium_mail
// The text of a gateway's mail; a session that is read is written and read back the same.
#include <components/iridium_mail/mail_format.hpp>

#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
    using namespace atirma::iridium_mail;
    std::string_view text(reinterpret_cast<const char*>(input), size);
    auto end = text.find('\n');
    if (end == std::string_view::npos) return 0;
    atirma::mail_message mail;
    mail.from = std::string(gateway_sender);
    mail.subject = text.substr(0, end);
    mail.text = text.substr(end + 1);
    mail.attachments.push_back({"x.sbd", std::vector<std::byte>(351)});
    if (auto order = read_mt_mail(mail); order && !make_mt_mail("a@b.c", order->imeis, order->messages)) std::abort();
    for (int with = 0; with < 2; ++with) {
        auto read = read_gateway_mail(mail);
        if (read && std::holds_alternative<mo_session>(*read)) {
            auto& session = std::get<mo_session>(*read);
            session.latitude_deg = session.longitude_deg = std::nullopt; // six places are written
            auto again = read_gateway_mail(make_mo_mail(session, "a@b.c"));
            if (!again || std::get<mo_session>(*again) != session) std::abort();
        }
        mail.attachments.clear();
    }
    return 0;
}
