#pragma once
#include <components/gui_client/client_context.hpp>
#include <components/mail/mail.hpp>
#include <ise/http/http_client.hpp>

#include <deque>
#include <functional>
#include <memory>
#include <string>
#include <vector>

namespace atirma::console {

/// Where alarms go besides the windows.
struct alarm_outlet_options {
    severity at_least = severity::critical;
    std::string boat = "A-Tirma";                                             ///< in subjects
    std::function<std::unique_ptr<mail_sender>(ise::loop&)> make_mail_sender; ///< empty: no mail
    std::string mail_from;
    std::vector<std::string> mail_to;
    std::function<std::unique_ptr<ise::http_client>(ise::loop&)> make_http_client; ///< empty: no web hook
    std::string hook_url;
};

/// The mail about these events, at least one. What boat or proxies put into their texts is escaped (`ise::readable`).
mail_message alarm_mail(const alarm_outlet_options& options, const std::vector<alarm_event>& events);

/// Sends alarms by mail and to a web hook. What waits goes in one mail; the hook gets a POST with JSON for each. A
/// failure is repeated with exponential back-off (5 s to 5 min), and is an alarm of its own, `outlet:mail` or
/// `outlet:hook`, which stays here. An event that waited for an hour is given up. Bounded: 100 events each, the oldest
/// is dropped.
class alarm_outlets {
public:
    static constexpr std::size_t max_waiting = 100;

    alarm_outlets(client_context& context, alarm_outlet_options options);
    /// Starts those that are configured, as tasks of the component.
    void start();
    /// New events of the alarms; acknowledgements stay here.
    void take(const std::vector<alarm_event>& events);

private:
    struct pending {
        alarm_event event;
        ise::time_point since; ///< it waits
    };
    struct outlet {
        std::string key;    ///< "outlet:mail"
        std::string called; ///< "mail"
        std::deque<pending> waiting;
    };
    ise::task<> run(outlet& of, bool mail);
    ise::task<ise::result<void>> post(alarm_event event);

    client_context& context_;
    alarm_outlet_options options_;
    outlet mail_{"outlet:mail", "mail", {}}, hook_{"outlet:hook", "web hook", {}};
    std::unique_ptr<mail_sender> sender_;
    std::unique_ptr<ise::http_client> client_;
};

} // namespace atirma::console
