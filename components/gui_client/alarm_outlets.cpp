#include <components/gui_client/alarm_outlets.hpp>

#include <components/gui_client/track_store.hpp>

#include <ise/core/readable.hpp>
#include <ise/core/time_text.hpp>
#include <ise/packet/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <cctype>

namespace atirma::console {

/// What the web hook gets.
struct alarm_hook_body {
    std::string boat, time, event, severity, key, text;
};

namespace {
using namespace std::chrono_literals;
constexpr ise::duration poll = 200ms, first_pause = 5s, longest_pause = 5min, patience = 60min, hook_deadline = 20s;

std::string upper(std::string_view word) {
    std::string made(word);
    std::transform(made.begin(), made.end(), made.begin(), [](unsigned char c) { return std::toupper(c); });
    return made;
}

/// Another attempt would end alike.
bool is_refusal(const ise::failure& why) {
    return why.code() == ise::errc::refused || why.code() == ise::errc::invalid_argument ||
           why.code() == ise::errc::unauthorized;
}

} // namespace

alarm_outlets::alarm_outlets(client_context& context, alarm_outlet_options options)
    : context_(context), options_(std::move(options)) {}

void alarm_outlets::start() {
    if (options_.make_mail_sender && !options_.mail_to.empty()) {
        sender_ = options_.make_mail_sender(context_.self.on());
        context_.self.spawn("alarm mail", run(mail_, true));
    }
    if (options_.make_http_client && !options_.hook_url.empty()) {
        client_ = options_.make_http_client(context_.self.on());
        context_.self.spawn("alarm hook", run(hook_, false));
    }
}

void alarm_outlets::take(const std::vector<alarm_event>& events) {
    for (const auto& one : events) {
        if (one.how < options_.at_least || one.what == alarm_change::acknowledged || one.key.starts_with("outlet:"))
            continue;
        for (auto* to : {sender_ ? &mail_ : nullptr, client_ ? &hook_ : nullptr}) {
            if (!to) continue;
            if (to->waiting.size() >= max_waiting) to->waiting.pop_front();
            to->waiting.push_back({one, context_.self.now()});
        }
    }
}

ise::task<> alarm_outlets::run(outlet& of, bool mail) {
    auto& self = context_.self;
    ise::duration pause = first_pause;
    for (;;) {
        while (of.waiting.empty()) co_await self.sleep(poll);
        std::vector<alarm_event> events;
        for (const auto& one : of.waiting)
            if (mail || events.empty()) events.push_back(one.event);
        ise::result<void> sent;
        if (mail) {
            auto sending = sender_->send(alarm_mail(options_, events));
            sent = co_await std::move(sending);
        } else {
            auto sending = post(events.front());
            sent = co_await std::move(sending);
        }
        bool settled = sent || is_refusal(sent.error()), gives_up = false;
        // Some may have been dropped meanwhile: those that were sent are the oldest that are still there.
        auto is_over = [&](const pending& one) {
            return settled ? one.event.number <= events.back().number : self.now() - one.since > patience;
        };
        for (; !of.waiting.empty() && is_over(of.waiting.front()); of.waiting.pop_front()) gives_up = !sent;
        context_.state.on_outlet(of.key,
                                 sent ? std::string()
                                      : fmt::format("An alarm was not sent by {}: {}{}", of.called,
                                                    sent.error().message(), gives_up ? "; it is given up" : ""),
                                 context_.clock());
        context_.news();
        if (settled) {
            pause = first_pause;
            continue;
        }
        co_await self.sleep(pause);
        pause = std::min<ise::duration>(2 * pause, longest_pause);
    }
}

mail_message alarm_mail(const alarm_outlet_options& options, const std::vector<alarm_event>& events) {
    auto worst = std::max_element(events.begin(), events.end(), [](const auto& a, const auto& b) {
        return std::pair(a.what != alarm_change::over, a.how) < std::pair(b.what != alarm_change::over, b.how);
    });
    mail_message mail;
    mail.from = options.mail_from;
    mail.to = options.mail_to;
    mail.subject = ise::readable(fmt::format("{}: {} {}", options.boat,
                                             worst->what == alarm_change::over ? "over:" : upper(name_of(worst->how)),
                                             worst->text));
    for (const auto& one : events)
        mail.text += fmt::format("{}  {}, {}: {}\n", ise::iso_8601(one.at, 3), name_of(one.how), name_of(one.what),
                                 ise::readable(one.text));
    mail.text += "\nAcknowledge it in the console.\n";
    return mail;
}

ise::task<ise::result<void>> alarm_outlets::post(alarm_event event) {
    alarm_hook_body body;
    body.boat = options_.boat;
    body.time = ise::iso_8601(event.at, 3);
    body.event = std::string(name_of(event.what));
    body.severity = std::string(name_of(event.how));
    body.key = event.key;
    body.text = event.text;
    ise::http_exchange what;
    what.method = "POST";
    what.url = options_.hook_url;
    what.headers.emplace_back("content-type", "application/json");
    what.body = ise::to_json(body);
    auto asking = client_->exchange(std::move(what), hook_deadline);
    auto answer = co_await std::move(asking);
    if (!answer) co_return answer.error();
    if (answer->status >= 200 && answer->status < 300) co_return ise::result<void>();
    bool later = answer->status >= 500 || answer->status == 408 || answer->status == 429;
    co_return ise::failure(later ? ise::errc::unreachable : ise::errc::refused,
                           fmt::format("the web hook answered {}", answer->status));
}

} // namespace atirma::console
