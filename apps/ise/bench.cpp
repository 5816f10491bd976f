// ise bench: calls a service for a while, as fast as it answers.
#include "json.hpp"
#include "options.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/component/health.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

namespace ise::cli {
namespace {

struct bench_options {
    std::string name, service, json; ///< without a service: ISE's own question how it is
    std::uint32_t concurrent = 1;    ///< calls at once
    duration length = std::chrono::seconds(5);
};

struct bench_summary {
    std::uint64_t answered = 0, failed = 0;
    duration length_s{};
    double calls_hz = 0;
    std::optional<duration> min_s, p50_s, p90_s, p99_s, max_s;
    std::map<std::string, std::uint64_t> failures; ///< by message
};

constexpr std::size_t max_kept = 1'000'000; // of more, only the first count for the quantiles

struct tally {
    std::vector<duration> took;
    std::uint64_t answered = 0;
    std::map<std::string, std::uint64_t> failures; // by message
    std::optional<failure> last;
    std::size_t callers = 0;
    waiter<>* waiting = nullptr;
    bool over = false; // by Ctrl-C

    bool add(duration length, const failure* why) {
        if (why) {
            constexpr std::size_t max_kinds = 16;
            if (failures.size() < max_kinds || failures.contains(why->message())) ++failures[why->message()];
            last = *why;
            return false;
        }
        ++answered;
        if (took.size() < max_kept) took.push_back(length);
        return true;
    }
};

struct target_call {
    remote who;
    std::optional<dynamic_contract> service; // else ISE's own question
    std::optional<dynamic_packet> request;
};

task<std::optional<failure>> call_once(const target_call& what, duration limit) {
    auto who = what.who;
    if (!what.service) {
        health_request question;
        auto response = co_await who.try_call(health_service, question, limit);
        if (!response) co_return response.error();
        co_return std::nullopt;
    }
    auto request = *what.request;
    auto response = co_await call_dynamic(std::move(who), *what.service, std::move(request), limit);
    if (!response) co_return response.error();
    co_return std::nullopt;
}

task<> call_on(context& in, std::shared_ptr<const target_call> what, time_point until, std::shared_ptr<tally> to) {
    struct leaving {
        tally& of;
        ~leaving() {
            if (--of.callers == 0 && of.waiting) of.waiting->resume();
        }
    } guard{*to};
    auto limit = in.set.timeout;
    for (;;) {
        auto began = in.self.env().now();
        if (began >= until || to->over) co_return;
        auto why = co_await call_once(*what, limit);
        bool well = to->add(in.self.env().now() - began, why ? &*why : nullptr);
        if (!well) co_await in.self.sleep(std::chrono::milliseconds(10)); // what refuses is not hammered
    }
}

bench_summary summary_of(tally& of, duration length) {
    bench_summary made;
    made.answered = of.answered;
    for (const auto& [why, count] : of.failures) made.failed += count;
    made.length_s = length;
    made.calls_hz = static_cast<double>(of.answered) / std::chrono::duration<double>(length).count();
    made.failures = of.failures;
    if (of.took.empty()) return made;
    std::ranges::sort(of.took);
    auto at = [&](double share) {
        auto size = of.took.size();
        return of.took[std::min(size - 1, static_cast<std::size_t>(static_cast<double>(size) * share))];
    };
    made.min_s = at(0);
    made.p50_s = at(0.5);
    made.p90_s = at(0.9);
    made.p99_s = at(0.99);
    made.max_s = at(1);
    return made;
}

std::string as_text(const bench_summary& of) {
    auto text =
        fmt::format("{} calls answered in {}: {:.0f} a second\n", of.answered, show_duration(of.length_s), of.calls_hz);
    if (of.min_s)
        text +=
            fmt::format("min {}, p50 {}, p90 {}, p99 {}, max {}\n", show_duration(*of.min_s), show_duration(*of.p50_s),
                        show_duration(*of.p90_s), show_duration(*of.p99_s), show_duration(*of.max_s));
    for (const auto& [why, count] : of.failures) text += fmt::format("{} failed: {}\n", count, printable(why));
    return text;
}

task<> bench(context& in, bench_options options) {
    auto what = std::make_shared<target_call>();
    what->who = co_await reach(in, options.name);
    if (!options.service.empty()) {
        what->service = co_await find_service(in, what->who, options.service, service_kind::request_response);
        auto request = co_await request_from(in, *what->service, options.name, options.json);
        what->request = std::move(request);
    }
    auto first = co_await call_once(*what, in.left()); // makes the connection, and what fails always fails here
    if (first) throw problem(*first);
    auto seen = std::make_shared<tally>();
    waiter<> done(in.self.on());
    struct listed {
        tally& of;
        ~listed() { of.waiting = nullptr; }
    } listing{*seen};
    seen->waiting = &done;
    auto began = in.self.env().now();
    auto until = saturating_add(began, options.length);
    seen->callers = options.concurrent;
    in.ctrl_c.care(in.self.on(), [seen] { seen->over = true; }); // what was measured is shown
    for (std::uint32_t count = 0; count < options.concurrent; ++count)
        in.self.spawn("bench", call_on(in, what, until, seen));
    while (seen->callers > 0) co_await done.wait();
    in.ctrl_c.leave();
    auto summary = summary_of(*seen, in.self.env().now() - began);
    auto text = in.set.json ? json_line(summary) : as_text(summary);
    co_await in.out.write(in.self, std::move(text));
    if (seen->answered == 0 && seen->last) throw problem(*seen->last, "is it busy or stopped? ise doctor looks at all");
}

void declare_bench(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<bench_options>();
    add_component(app, given->name);
    app.add_option("SERVICE", given->service,
                   "a request-response service; every call has its effects (default: ise.health)");
    app.add_option("JSON", given->json, "the request; - reads it from standard input");
    app.add_option("--concurrent,-c", given->concurrent, "calls at once (default: 1)")
        ->type_name("N")
        ->check(command_line::range(1u, 1024u));
    add_time(app, "--for", given->length, "how long (default: 5s)");
    app.callback([&made, given] {
        if (!given->json.empty()) given->json = json_given(given->json);
        made.looks = true;
        made.work = [given](context& in) { return bench(in, *given); };
    });
}

} // namespace

extern const command bench_command{
    "bench", measure_group, "measures calls per second of a service, and their latency",
    "  ise bench atirma/boat --for 3s\n  ise bench atirma/boat helm {} -c 8       really calls helm each time\n",
    declare_bench};

} // namespace ise::cli
