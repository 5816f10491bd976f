// The rows that must hold whatever happens to the session, and the network: under scripted faults, in every weather.
#include "traffic.hpp"

#include <fmt/format.h>

using namespace conformance;

namespace {

// Peers are missed sooner, so that faults are over sooner; and nobody is given up meanwhile.
void hasty(ise::service_options& options) {
    options.accepts.heartbeat_ns /= 3;
    options.linger = 10min;
}
// As the slow weather takes its time.
void patient(ise::service_options& options) {
    options.linger = 10min;
    options.connect_time = 1min;
    options.unsent_bytes = 4096;
}

template <class World>
void in_all_weathers() {
    if (auto lacks = lacking<World>(); !lacks.empty()) return ise_test::skip(lacks);
    for (const auto& now : all_weathers()) {
        INFO(fmt::format("{}, seed {}", now.name, now.seed));
        World where(now);
        pair at(where, patient);
        sail(at, {fault::cut, fault::reset, fault::partition});
    }
}

} // namespace

TEMPLATE_TEST_CASE("under each fault calls run at most once, and a subscription resumes with the exact gap", "",
                   OVER_EVERY_TRANSPORT) {
    if (auto lacks = lacking<TestType>(); !lacks.empty()) return ise_test::skip(lacks);
    for (fault what : faults_over(TestType().has)) {
        INFO(name_of(what));
        over<TestType>([&](pair& at) { sail(at, {what}); }, hasty);
    }
}

TEMPLATE_TEST_CASE(
    "under one fault after the other calls run at most once, and a subscription resumes with the exact gap", "",
    OVER_EVERY_TRANSPORT) {
    over<TestType>(
        [](pair& at) {
            auto script = faults_over(at.has);
            script.insert(script.end(), script.begin(), script.end());
            sail(at, script);
        },
        hasty);
}

TEMPLATE_TEST_CASE("in every weather calls run at most once, and a subscription resumes with the exact gap", "",
                   virtual_tcp, virtual_tls, virtual_udp) {
    in_all_weathers<TestType>();
}
