#include <components/iridium_proxy/iridium_proxy.hpp>
#include <components/iridium_proxy/proxy_state.hpp>

#include <components/iridium/directip.hpp>
#include <components/iridium_mail/mail_format.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t mails_at_once = 16;

ise::http_response answer(int status, std::string body) {
    ise::http_response made;
    made.status = status;
    made.body = std::move(body) + "\n";
    return made;
}

iridium::mo_message message_of(const iridium_mail::mo_session& session) {
    iridium::mo_message made;
    made.imei = session.imei;
    made.momsn = session.momsn;
    made.mtmsn = session.mtmsn;
    made.session_time = session.session_at;
    made.session_status = static_cast<std::uint8_t>(session.status);
    if (session.latitude_deg && session.longitude_deg)
        made.where = iridium::estimate{*session.latitude_deg, *session.longitude_deg, session.cep_km.value_or(0)};
    made.data = session.payload;
    return made;
}
} // namespace

bool iridium_proxy::is_ours(std::string_view imei) const {
    return imei == options_.imei || (!options_.beacon_imei.empty() && imei == options_.beacon_imei);
}

void iridium_proxy::refuse(std::string_view what, const std::string& peer, const std::string& why) {
    ++state_->counts.refused;
    if (auto left_out = state_->quiet.admit(now()))
        log().warning(what, {{"peer", peer}, {"cause", why}, {"left_out", std::to_string(*left_out)}});
}

ise::http_response iridium_proxy::on_post(const ise::http_request& request) {
    auto refused = [&](int status, const std::string& why) {
        refuse(fmt::format("a post is refused ({})", status), request.peer, why);
        return answer(status, why);
    };
    if (!ise::within_host(state_->webhook->where()) && !state_->gateways.accepts(request.peer))
        return refused(403, "your address is not on the list of the gateway's (--gateway-addresses)");
    if (!request.message.header("origin").empty()) // of any site that somebody on this host visits
        return refused(403, "a page in a browser is not the gateway");
    if (request.path != options_.webhook_path) return refused(404, "the web hook is " + options_.webhook_path);
    if (request.message.method != "POST") return refused(405, "the web hook takes POST, not " + request.message.method);
    auto delivery = iridium::parse_mo_delivery(request.message.body);
    if (!delivery)
        return refused(delivery.error().code() == ise::errc::too_large ? 413 : 400, delivery.error().message());
    if (state_->key) {
        auto good = state_->key->verify(*delivery, std::chrono::floor<std::chrono::seconds>(clock()));
        if (!good) return refused(401, good.error().message());
    }
    if (!is_ours(delivery->message.imei))
        return refused(403, fmt::format("IMEI {} is not the boat's", delivery->message.imei));
    auto kept = accept(delivery->message, "http");
    if (!kept) return answer(500, "the message could not be kept, send it again: " + kept.error().message());
    return answer(200, "OK");
}

ise::bytes iridium_proxy::on_directip(ise::bytes_view whole, const std::string& peer) {
    auto message = iridium::parse_directip_mo(whole);
    if (!message || !is_ours(message->imei)) {
        refuse("a DirectIP message is refused", peer,
               message ? fmt::format("IMEI {} is not the boat's", message->imei) : message.error().message());
        return iridium::encode_mo_confirmation(false);
    }
    auto kept = accept(*message, "directip");
    return iridium::encode_mo_confirmation(kept.has_value());
}

/// A mail is done only once what it brought is on disk.
ise::task<> iridium_proxy::read_mails() {
    auto& s = *state_;
    for (;;) {
        auto mails = co_await s.mails->fetch(mails_at_once);
        std::optional<ise::failure> problem;
        if (!mails) problem = mails.error();
        for (std::size_t i = 0; mails && !problem && i < mails->size(); ++i) {
            const auto& mail = (*mails)[i];
            auto kept = on_mail(mail.message);
            if (!kept) {
                problem = kept.error();
                break;
            }
            auto done = co_await s.mails->done(mail.uid);
            if (!done) problem = done.error();
        }
        if (!problem && mails->size() == mails_at_once) continue;
        std::string trouble = problem ? "the mailbox: " + problem->message() : std::string();
        if (!trouble.empty() && trouble != s.mail_trouble) log().warning(trouble);
        s.mail_trouble = trouble;
        if (problem) {
            co_await sleep(options_.mail_period);
            continue;
        }
        auto waited = co_await s.mails->wait(options_.mail_period);
        if (!waited) co_await sleep(options_.mail_period);
    }
}

/// Success also for a mail that is of no use: it has been looked at.
ise::result<void> iridium_proxy::on_mail(const mail_message& mail) {
    if (!options_.mail_unchecked) {
        auto domain = std::string_view(options_.gateway_mail).substr(options_.gateway_mail.find('@') + 1);
        auto genuine = iridium_mail::check_authentication(mail.authentication_results, options_.mail_authserv, domain);
        if (!genuine) {
            refuse("a mail is passed over", mail.from, genuine.error().message());
            return {};
        }
    }
    auto read = iridium_mail::read_gateway_mail(mail, options_.gateway_mail);
    if (!read) {
        refuse("a mail is passed over", mail.from, read.error().message());
        return {};
    }
    if (const auto* session = std::get_if<iridium_mail::mo_session>(&*read)) {
        if (!is_ours(session->imei)) {
            refuse("a mail is passed over", mail.from, fmt::format("IMEI {} is not the boat's", session->imei));
            return {};
        }
        return accept(message_of(*session), "mail");
    }
    const auto& word = std::get<iridium_mail::disposition>(*read);
    auto id = telecommand_of_attachment(word.attachment);
    if (!id) {
        refuse("a mail is passed over", mail.from,
               fmt::format("'{}' is not a telecommand of this proxy", word.attachment));
        return {};
    }
    auto text = word.queued
                    ? fmt::format("queued at the gateway{}", word.mtmsn ? fmt::format(" as {}", *word.mtmsn) : "")
                    : "the gateway did not queue it: " + word.reason;
    state_->commands.tracker().on_gateway_word(state_->commands.now(), *id, word.queued, text);
    state_->commands.work();
    return {};
}

/// On disk first; then its sender may be told, and the others.
ise::result<void> iridium_proxy::accept(const iridium::mo_message& message, std::string_view path) {
    auto& s = *state_;
    auto added = s.store.add(message, path, clock(), credits_of(message.data.size(), options_.bytes_per_credit));
    if (!added) {
        disk_trouble(added.error());
        return added.error();
    }
    s.disk_trouble.clear();
    if (!*added) {
        ++s.counts.duplicate_messages;
        return {};
    }
    ++s.counts.messages;
    auto session_at = std::chrono::time_point_cast<std::chrono::milliseconds>(message.session_time);
    auto& last = is_beacons(message) ? s.counts.beacon_session_at : s.counts.last_session_at;
    last = std::max(last, std::optional(session_at)); // the gateway may deliver an older session later
    if (message.where && std::optional(session_at) >= s.counts.estimate_at) {
        s.counts.estimate_at = session_at;
        s.counts.estimate = waypoint{message.where->latitude_deg, message.where->longitude_deg};
        s.counts.estimate_cep_km = message.where->cep_km;
    }
    if (message.session_status > 2)
        log().warning("a session of the boat did not end well",
                      {{"momsn", std::to_string(message.momsn)},
                       {"status", std::string(iridium::explain_session_status(message.session_status))}});
    if (message.mtmsn != 0 && !is_beacons(message)) s.commands.tracker().on_delivered(s.commands.now());
    take_acknowledgements(message);
    s.commands.work();
    s.hand_on_soon.arm(now());
    return {};
}

} // namespace atirma
