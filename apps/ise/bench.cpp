#include "look.hpp"

#include "description.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/component/health.hpp>

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>
#include <memory>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

constexpr std::size_t max_kept = 1'000'000; // of more, only the first count for the quantiles

struct tally {
    std::vector<duration> took;
    std::uint64_t answered = 0;
    std::map<std::string, std::uint64_t> failures; // by message
    std::optional<failure> last;
    std::size_t callers = 0;
    waiter<>* waiting = nullptr;

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
        auto told = co_await who.try_call(health_service, question, limit);
        if (!told) co_return told.error();
        co_return std::nullopt;
    }
    auto request = *what.request;
    auto told = co_await call_dynamic(std::move(who), *what.service, std::move(request), limit);
    if (!told) co_return told.error();
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
        if (began >= until) co_return;
        auto why = co_await call_once(*what, limit);
        bool well = to->add(in.self.env().now() - began, why ? &*why : nullptr);
        if (!well) co_await in.self.sleep(std::chrono::milliseconds(10)); // what refuses is not hammered
    }
}

std::string shown(context& in, tally& of, duration length) {
    std::ranges::sort(of.took);
    auto at = [&](double share) {
        return of
            .took[std::min(of.took.size() - 1, static_cast<std::size_t>(static_cast<double>(of.took.size()) * share))];
    };
    auto seconds = std::chrono::duration<double>(length).count();
    auto rate = static_cast<double>(of.answered) / seconds;
    std::uint64_t failed = 0;
    for (const auto& [why, count] : of.failures) failed += count;
    if (in.set.json) {
        auto exact = [](duration one) { return std::chrono::duration<double>(one).count(); };
        ordered_json told;
        told["answered"] = of.answered;
        told["failed"] = failed;
        told["length_s"] = seconds;
        told["calls_hz"] = rate;
        constexpr std::pair<const char*, double> shares[] = {
            {"min_s", 0.0}, {"p50_s", 0.5}, {"p90_s", 0.9}, {"p99_s", 0.99}, {"max_s", 1.0}};
        for (auto [name, share] : shares)
            told[name] = of.took.empty() ? ordered_json() : ordered_json(exact(at(share)));
        told["failures"] = of.failures;
        return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
    }
    auto text = fmt::format("{} calls answered in {}: {:.0f} a second\n", of.answered, show_duration(length), rate);
    if (!of.took.empty())
        text += fmt::format("min {}, p50 {}, p90 {}, p99 {}, max {}\n", show_duration(at(0)), show_duration(at(0.5)),
                            show_duration(at(0.9)), show_duration(at(0.99)), show_duration(at(1)));
    for (const auto& [why, count] : of.failures) text += fmt::format("{} failed: {}\n", count, printable(why));
    return text;
}

} // namespace

task<> bench(context& in, bench_options options) {
    auto what = std::make_shared<target_call>();
    what->who = co_await reach(in, options.name);
    if (!options.service.empty()) {
        what->service = co_await find_service(in, what->who, options.service, service_kind::request_response);
        const auto& asked = what->service->packet(role::request);
        if (options.json.empty() && !asked.type().members.empty())
            throw problem(exit_code::usage, "usage",
                          fmt::format("the request of '{}' has fields, and none was given", options.service),
                          example(options.name, *what->service));
        if (options.json.empty()) options.json = "{}";
        auto request = co_await packet_from(in, asked, options.json, "request");
        what->request = std::move(request);
    }
    auto first = co_await call_once(*what, in.left()); // makes the connection, and what fails always fails here
    if (first) throw problem(*first);
    auto seen = std::make_shared<tally>();
    waiter<> done(in.self.on(), [&done] { done.resume(); });
    struct listed {
        tally& of;
        ~listed() { of.waiting = nullptr; }
    } listing{*seen};
    seen->waiting = &done;
    auto began = in.self.env().now();
    auto until = saturating_add(began, options.length);
    seen->callers = options.concurrent;
    for (std::uint32_t count = 0; count < options.concurrent; ++count)
        in.self.spawn("bench", call_on(in, what, until, seen));
    while (seen->callers > 0) co_await done.wait();
    auto length = in.self.env().now() - began;
    auto text = shown(in, *seen, length);
    co_await in.out.write(in.self, std::move(text));
    if (seen->answered == 0 && seen->last) throw problem(*seen->last, "is it busy or stopped? ise doctor looks at all");
}

} // namespace ise::cli
