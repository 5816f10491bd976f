// The cost of an access policy of 200 rules where it is asked: once for a session and a service, and for all sessions
// when it changes. No session, no file: `bench/security` measures calls.
#include "support/report.hpp"

#include <ise/access/policy.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <string>
#include <vector>

namespace {

constexpr int rules = 200;

std::string policy_text() {
    std::string text = "version = 1\n";
    for (int n = 1; n < rules; ++n) {
        auto number = std::to_string(n);
        text += "[[allow]]\nwho = [\"ise://atirma/host-" + number + "\", \"ise://atirma/team-" + number +
                "/*\"]\nname = [\"atirma/part-" + number + "/**\"]\ncall = [\"atirma/part-" + number +
                "/*:{telecommand,authority}\"]\nsubscribe = [\"atirma/part-" + number + "/**:telemetry\"]\n";
    }
    return text + "[[allow]]\nwho = [\"ise://atirma/**\", \"nobody\"]\nname = [\"bench/*\"]\ncall = [\"bench/*:*\"]\n";
}

/// Nanoseconds of one `work()`: the median of many batches.
template <class Work>
double cost(Work work) {
    constexpr int in_a_batch = 200;
    std::vector<double> all;
    for (int batch = 0; batch != 101; ++batch) {
        const auto began = bench::now_ns();
        for (int i = 0; i != in_a_batch; ++i) work();
        all.push_back(static_cast<double>(bench::now_ns() - began) / in_a_batch);
    }
    std::ranges::nth_element(all, all.begin() + all.size() / 2);
    return all[all.size() / 2];
}

} // namespace

int main() {
    std::vector<ise::access::remark> problems;
    const auto policy = ise::access::policy::parse(policy_text(), "access.toml", problems);
    if (!policy) return 1;
    const std::string titles[] = {"bench/server"};
    const auto wanted = ise::access::request_for(false, titles, "echo");
    const ise::access::view known(policy, "ise://atirma/host-250");
    auto must = [](const ise::access::verdict& found) {
        if (!found.allowed) std::abort();
    };
    std::printf("a policy of %d rules\n", rules);
    std::printf("  first use of a session: its rules are looked up, and the service decided: %.0f ns\n", cost([&] {
                    ise::access::view made(policy, "ise://atirma/host-250");
                    must(made.decide(wanted));
                }));
    std::printf("  first use of one more service: %.0f ns\n", cost([&] { must(known.decide(wanted)); }));
    return 0;
}
