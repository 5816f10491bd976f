#include <components/iridium_gateway/iridium_gateway.hpp>

#include <components/iridium/directip.hpp>
#include <components/iridium/jwt.hpp>
#include <components/iridium_mail/mail_format.hpp>
#include <ise/http/stream_http_client.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t mails_at_once = 16;
constexpr ise::duration mail_period = 30s;
constexpr std::size_t max_key_bytes = 64 * 1024;
constexpr std::string_view submit_path = "/rockblock/MT";

double in_range(const char* what, double value, double low, double high) {
    if (value >= low && value <= high) return value; // not a number fails
    throw ise::error(ise::errc::refused, fmt::format("{} is {:g} to {:g}, not {:g}", what, low, high, value));
}

ise::http_response answer(int status, std::string body) {
    ise::http_response made;
    made.status = status;
    made.body = std::move(body);
    return made;
}
} // namespace

struct iridium_gateway::state {
    state(iridium_gateway& self, gateway_model_options options)
        : model(std::move(options)), due(self.on(), [&self] { self.turn(); }) {}

    gateway_model model;
    ise::timer due;
    std::unique_ptr<ise::http_client> http;
    std::unique_ptr<mail_sender> sender;
    std::unique_ptr<mailbox> mails;
    std::unique_ptr<ise::http_server> submissions;
    std::unique_ptr<iridium::directip_server> directip;
    std::string private_key;
    ise::publication<ise::subscription<sbd_ring_alert>> rings;
};

iridium_gateway::iridium_gateway(iridium_gateway_options options) : options_(std::move(options)) {}
iridium_gateway::~iridium_gateway() = default;

std::optional<ise::endpoint> iridium_gateway::submissions_at() const {
    if (!state_ || !state_->submissions) return std::nullopt;
    return state_->submissions->where();
}
std::optional<ise::endpoint> iridium_gateway::directip_at() const {
    if (!state_ || !state_->directip) return std::nullopt;
    return state_->directip->where();
}

std::chrono::sys_seconds iridium_gateway::wall_seconds() const {
    return std::chrono::floor<std::chrono::seconds>(wall());
}

ise::task<> iridium_gateway::run() {
    auto model = options_.model;
    model.tells_mtmsn = options_.post_to.empty(); // a web hook cannot tell it
    state_.reset();
    state_ = std::make_unique<state>(*this, std::move(model));
    auto& s = *state_;
    if (options_.make_http_client) s.http = options_.make_http_client(on());
    else s.http = std::make_unique<ise::stream_http_client>(on());
    if (!options_.mail_to.empty() || options_.open_mailbox) {
        if (!options_.make_mail_sender)
            throw ise::error(ise::errc::invalid_argument, "for mails a mail server is needed");
        s.sender = options_.make_mail_sender(on());
    }
    if (!options_.sign_with.empty()) s.private_key = env().read_file(options_.sign_with, max_key_bytes).value();
    iridium_gateway_request initial;
    initial.session_failures = options_.session_failures;
    initial.duplicates = options_.duplicates;
    initial.delivery_delay_s = options_.delivery_delay_s;
    control(initial);
    provide_all();
    open_doors();
    co_return;
}

void iridium_gateway::provide_all() {
    auto& s = *state_;
    s.rings = publish(services::sbd_ring);
    provide(services::sbd_session, [this](const sbd_session_request& request) { return session(request); });
    provide(services::iridium_gateway_control,
            [this](const iridium_gateway_request& request) { return control(request); });
    publish_every(services::iridium_gateway_status, 1s, [this] {
        state_->model.on_time(now());
        return state_->model.state;
    });
}

void iridium_gateway::open_doors() {
    auto& s = *state_;
    auto spawner = [this](std::string name, ise::task<> body) { spawn(std::move(name), std::move(body)); };
    if (!options_.listen.empty()) {
        s.submissions = std::make_unique<ise::http_server>(on(), log(), ise::http_limits(), spawner);
        s.submissions->otherwise([this](const ise::http_request& request) { return on_submission(request); });
        s.submissions->listen(ise::endpoint::parse(options_.listen).value()).value();
        log().info("messages to modems may be submitted here",
                   {{"url", fmt::format("{}{}", s.submissions->where().text(), submit_path)}});
    }
    if (!options_.directip_listen.empty()) {
        auto handler = [this](ise::bytes_view message, const std::string&) { return on_directip(message); };
        s.directip =
            std::make_unique<iridium::directip_server>(on(), log(), iridium::directip_limits(), handler, spawner);
        s.directip->listen(ise::endpoint::parse(options_.directip_listen).value()).value();
    }
    if (options_.open_mailbox) {
        s.mails = options_.open_mailbox(on());
        spawn("mails", read_mails());
    }
}

iridium_gateway_state iridium_gateway::control(const iridium_gateway_request& request) {
    auto& result = state_->model.state;
    auto failures = in_range("session_failures", request.session_failures.value_or(result.session_failures), 0, 1);
    auto duplicates = in_range("duplicates", request.duplicates.value_or(result.duplicates), 0, 1);
    auto delay_s = in_range("delivery_delay_s", request.delivery_delay_s.value_or(result.delivery_delay_s), 0, 3600);
    auto code = in_range("fail_mt", request.fail_mt.value_or(result.fail_mt), 0, 9999);
    result.session_failures = failures;
    result.duplicates = duplicates;
    result.delivery_delay_s = delay_s;
    result.fail_mt = static_cast<int>(code);
    result.up = request.up.value_or(result.up);
    if (request.flush.value_or(false)) state_->model.flush();
    turn();
    return result;
}

sbd_session_reply iridium_gateway::session(const sbd_session_request& request) {
    auto reply = state_->model.session(now(), wall_seconds(), request);
    if (!reply) throw ise::error(reply.error());
    turn();
    return std::move(*reply);
}

ise::http_response iridium_gateway::on_submission(const ise::http_request& request) {
    auto& s = *state_;
    if (!s.model.state.up) return answer(503, "the gateway is switched off\n");
    if (request.path != submit_path) return answer(404, fmt::format("submit to {}\n", submit_path));
    if (request.message.method != "POST") return answer(405, "only POST\n");
    const auto& body = request.message.body;
    auto submission = iridium::parse_mt_submission(body.empty() ? request.query : body);
    if (!submission) return answer(400, submission.error().message() + "\n");
    std::string alert;
    auto reply = s.model.submit(now(), *submission, alert);
    if (!alert.empty()) ring(alert);
    return answer(200, iridium::encode_mt_reply(reply));
}

ise::bytes iridium_gateway::on_directip(ise::bytes_view whole) {
    auto& s = *state_;
    auto message = iridium::parse_directip_mt(whole);
    iridium::mt_confirmation result;
    if (!message) {
        result.status = -7;
        return iridium::encode_mt_confirmation(result);
    }
    auto imei = iridium::imei_text(message->imei);
    auto place =
        s.model.enqueue(now(), imei, std::move(message->payload), (message->flags & iridium::flush_queue) != 0);
    if (place.status >= 1) ring(imei);
    result.client_id = message->client_id;
    result.imei = message->imei;
    result.auto_id = place.mtmsn;
    result.status = static_cast<std::int16_t>(place.status);
    return iridium::encode_mt_confirmation(result);
}

ise::task<> iridium_gateway::read_mails() {
    auto& s = *state_;
    for (;;) {
        auto mails = co_await s.mails->fetch(mails_at_once);
        bool none = !mails || mails->empty() || !s.model.state.up;
        for (std::size_t i = 0; !none && i < mails->size(); ++i) {
            auto uid = (*mails)[i].uid;
            auto answering = answer_mail((*mails)[i].message);
            co_await std::move(answering);
            auto done = co_await s.mails->done(uid);
            if (!done) none = true; // it comes again, as from a gateway that repeats itself
        }
        if (!none) continue;
        auto waited = co_await s.mails->wait(mail_period);
        if (!waited || !s.model.state.up) co_await sleep(mail_period);
    }
}

ise::task<> iridium_gateway::answer_mail(mail_message mail) {
    auto& s = *state_;
    auto order = iridium_mail::read_mt_mail(mail);
    std::vector<iridium_mail::disposition> words;
    if (!order) {
        iridium_mail::disposition word;
        word.reason = order.error().message();
        words.push_back(std::move(word));
    }
    for (std::size_t i = 0; order && i < order->imeis.size() * order->messages.size(); ++i) {
        const auto& imei = order->imeis[i / order->messages.size()];
        auto& message = order->messages[i % order->messages.size()];
        auto place = s.model.enqueue(now(), imei, message.payload, false);
        iridium_mail::disposition word;
        word.imei = imei;
        word.attachment = message.name;
        word.queued = place.status >= 1;
        if (word.queued) {
            word.mtmsn = place.mtmsn;
            word.queue_position = static_cast<std::uint32_t>(place.status);
            ring(imei);
        } else {
            word.reason = iridium::explain_mt_status(place.status);
        }
        words.push_back(std::move(word));
    }
    for (const auto& word : words) {
        auto sent = co_await s.sender->send(iridium_mail::make_disposition_mail(word, mail.from));
        if (!sent) log().warning("a disposition mail was not taken", {{"cause", sent.error().message()}});
    }
}

/// Starts what is due.
void iridium_gateway::turn() {
    auto& s = *state_;
    s.model.on_time(now());
    while (auto due = s.model.next_delivery(now())) {
        auto name = fmt::format("delivery {}", due->number);
        spawn(std::move(name), deliver(std::move(*due)));
    }
    auto next = s.model.next_event();
    if (next == ise::time_point::max()) s.due.disarm();
    else s.due.arm(next);
}

ise::task<> iridium_gateway::deliver(gateway_model::delivery what) {
    std::string trouble;
    if (!options_.post_to.empty()) trouble = co_await post(what.message);
    if (trouble.empty() && !options_.directip_to.empty()) trouble = co_await connect(what.message);
    if (trouble.empty() && !options_.mail_to.empty()) trouble = co_await mail(what.message);
    if (!trouble.empty())
        log().debug("a delivery failed; it is repeated",
                    {{"momsn", std::to_string(what.message.momsn)}, {"cause", trouble}});
    state_->model.on_delivered(now(), what.number, trouble.empty(), trouble);
    turn();
}

/// Why it was not taken; empty: it was.
ise::task<std::string> iridium_gateway::post(iridium::mo_message message) {
    iridium::mo_delivery delivery;
    delivery.message = message;
    delivery.serial = 1;
    delivery.device_type = "ROCKBLOCK";
    ise::http_exchange request;
    request.method = "POST";
    request.url = options_.post_to;
    auto encode = options_.post_json ? iridium::encode_mo_json : iridium::encode_mo_form;
    if (!state_->private_key.empty()) {
        // What it signs is what a receiver reads: a form has fewer digits.
        auto posted = iridium::parse_mo_delivery(encode(delivery));
        if (!posted) co_return posted.error().message();
        auto token = iridium::sign_jwt(state_->private_key, iridium::encode_mo_json(*posted));
        if (!token) co_return token.error().message();
        delivery.jwt = std::move(*token);
    }
    request.headers.emplace_back("Content-Type",
                                 options_.post_json ? "application/json" : "application/x-www-form-urlencoded");
    request.headers.emplace_back("User-Agent", "Rock7PushApi");
    request.body = encode(delivery);
    auto answered = co_await state_->http->exchange(std::move(request), options_.answer_time);
    if (!answered) co_return answered.error().message();
    if (answered->status != 200)
        co_return fmt::format("{} answered {}: {}", options_.post_to, answered->status, answered->body.substr(0, 200));
    co_return std::string();
}

ise::task<std::string> iridium_gateway::connect(iridium::mo_message message) {
    auto to = ise::endpoint::parse(options_.directip_to);
    if (!to) co_return to.error().message();
    auto answered =
        co_await iridium::ask_directip(on(), *to, iridium::encode_directip_mo(message), options_.answer_time);
    if (!answered) co_return answered.error().message();
    auto confirmed = iridium::parse_mo_confirmation(*answered);
    if (!confirmed) co_return confirmed.error().message();
    co_return *confirmed ? "" : "the receiver did not confirm";
}

ise::task<std::string> iridium_gateway::mail(iridium::mo_message message) {
    iridium_mail::mo_session session;
    session.imei = message.imei;
    session.momsn = message.momsn;
    session.mtmsn = message.mtmsn;
    session.session_at = message.session_time;
    session.size = static_cast<std::uint32_t>(message.data.size());
    if (message.where) {
        session.latitude_deg = message.where->latitude_deg;
        session.longitude_deg = message.where->longitude_deg;
        session.cep_km = message.where->cep_km;
    }
    session.payload = message.data;
    auto sent = co_await state_->sender->send(iridium_mail::make_mo_mail(session, options_.mail_to));
    if (!sent) co_return sent.error().message();
    co_return std::string();
}

void iridium_gateway::ring(const std::string& imei) { spawn("ring " + imei, ring_later(imei)); }

ise::task<> iridium_gateway::ring_later(std::string imei) {
    co_await sleep(options_.ring_delay);
    sbd_ring_alert alert;
    alert.imei = std::move(imei);
    if (state_->model.state.up) state_->rings(alert);
}

} // namespace atirma
