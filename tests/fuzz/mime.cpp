// link: atirma_mail
// A mail as a server may give it; what is read can be written and read again.
#include <components/mail/mime.hpp>

#include <cstdint>
#include <cstdlib>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* input, std::size_t size) {
    atirma::mime_limits limits;
    limits.max_bytes = 1 << 16;
    auto mail = atirma::read_mail({reinterpret_cast<const char*>(input), size}, limits);
    if (!mail) return 0;
    if (!atirma::is_mail_address(mail->from)) std::abort();
    auto text = atirma::write_mail(*mail, atirma::mail_stamp());
    if (!text) return 0; // names or texts that are no single lines are not sent
    auto again = atirma::read_mail(*text);
    if (!again || again->from != mail->from || again->to != mail->to) std::abort();
    if (again->attachments.size() != mail->attachments.size()) std::abort();
    for (std::size_t i = 0; i < mail->attachments.size(); ++i)
        if (again->attachments[i].content != mail->attachments[i].content) std::abort();
    return 0;
}
