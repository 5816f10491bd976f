#include <ise/component/served_calls.hpp>

#include <ise/call/call_tap.hpp>
#include <ise/core/environment.hpp>
#include <ise/core/loop.hpp>
#include <ise/service/service_host.hpp>
#include <ise/subscription/publication.hpp>

#include <memory>
#include <utility>

namespace ise {

bool records_calls(const environment& env) {
    auto wanted = env.variable(record_calls_variable);
    return wanted && !wanted->empty() && *wanted != "0";
}

void provide_served_calls(service_host& of) {
    if (!records_calls(of.env())) return;
    auto core = make_publication(of, served_calls_service);
    of.services().add(core).value();
    of.on().common<call_taps>().watch(of, [held = std::weak_ptr<publication_core>(core)](tapped_call call) {
        auto still = held.lock();
        if (!still || still->subscribers() == 0) return;
        served_call made;
        made.service = std::move(call.service);
        made.caller = std::move(call.caller);
        made.asked_at = call.asked_at;
        made.took = call.took;
        made.deadline = call.deadline;
        made.outcome = std::move(call.outcome);
        made.message = std::move(call.message);
        made.request = std::move(call.request);
        made.response = std::move(call.response);
        publication<std::remove_const_t<decltype(served_calls_service)>> out(still);
        out(made);
    });
}

} // namespace ise
