#pragma once
#include <components/curl/curl_http_client.hpp>
#include <components/curl/imap_mailbox.hpp>
#include <components/curl/smtp_sender.hpp>

#include <memory>

// libcurl's clients as components take them: each brings the transfers that it works with.
namespace atirma {

std::unique_ptr<ise::http_client> make_curl_http_client(ise::loop& on, curl_http_options options = curl_http_options());
/// Throws ise::error (invalid_argument) for a server that is none, as the next.
std::unique_ptr<mailbox> make_imap_mailbox(ise::loop& on, imap_options options);
std::unique_ptr<mail_sender> make_smtp_sender(ise::loop& on, smtp_options options);

} // namespace atirma
