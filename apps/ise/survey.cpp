#include "survey.hpp"

#include "text.hpp"

#include <ise/core/time_text.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t asked_at_once = 32;

// Shared by the one who waits and those who ask.
struct inquiry {
    std::vector<surveyed> all;
    std::size_t next = 0;
    std::size_t asking = 0;
    waiter<>* waiting = nullptr;
};

task<> look_at(context& in, surveyed& into, bool leases) {
    // A lease is renewed several times within its length: an old one is worth a question.
    if (leases && into.name.lease_age > 500ms) {
        auto server = co_await reach_name_server(in);
        naming::describe_request which;
        which.path = into.name.path;
        auto response = co_await server.try_call(naming::describe, which, in.left());
        if (response) {
            into.lease = response->lease;
            into.name.lease_age = response->lease_age;
        }
    }
    auto who = co_await reach(in, into.name.path);
    auto asked = in.self.now();
    into.about = co_await ask_about(in, who);
    into.answered_at = in.self.now();
    into.answered_after = into.answered_at - asked;
    auto response = co_await ask_health(in, who, in.left());
    if (!response) co_return; // a version without, or it has just gone
    into.answered_at = in.self.now();
    into.answered_after = response->round_trip;
    into.clock_ahead = response->clock_ahead;
    into.clock_doubt = response->round_trip / 2;
    into.health = std::move(response->report);
}

task<> ask_some(context from, std::shared_ptr<inquiry> of, bool leases) {
    while (of->next < of->all.size()) {
        auto& one = of->all[of->next++];
        // A component that hangs does not cost the whole time.
        from.until = from.self.now() + from.set.timeout / 2;
        try {
            co_await look_at(from, one, leases);
        } catch (const problem& why) {
            one.why = why.name() == ise::name_of(errc::timed_out)       ? errc::timed_out
                      : why.name() == ise::name_of(errc::access_denied) ? errc::access_denied
                                                                        : errc::unreachable;
            one.trouble = why.what();
        } catch (const error& why) {
            one.why = why.code();
            one.trouble = why.what();
        }
    }
    if (--of->asking == 0 && of->waiting) of->waiting->resume();
}

} // namespace

task<result<pulse>> ask_health(context& in, remote who, duration limit) {
    health_request question;
    auto asked = in.self.env().now();
    auto began = in.self.wall();
    auto response = co_await who.try_call(health_service, question, limit);
    if (!response) co_return response.error();
    pulse made;
    made.round_trip = in.self.env().now() - asked;
    made.clock_ahead = response->wall - (began + made.round_trip / 2);
    made.report = std::move(*response);
    co_return made;
}

task<std::vector<surveyed>> survey(context& in, survey_options options) {
    auto names = co_await listed_names(in, options.prefix);
    auto of = std::make_shared<inquiry>();
    for (auto& one : names) {
        of->all.emplace_back();
        of->all.back().name = std::move(one);
    }
    waiter<> done(in.self.on());
    struct listed {
        inquiry& of;
        ~listed() { of.waiting = nullptr; }
    } listing{*of};
    of->waiting = &done;
    of->asking = std::min(asked_at_once, of->all.size());
    for (std::size_t count = of->asking; count > 0; --count) in.self.spawn("survey", ask_some(in, of, options.leases));
    while (of->asking > 0) co_await done.wait();
    co_return std::move(of->all);
}

std::string show_age(const context& in, const std::vector<surveyed>& all) {
    auto answered =
        static_cast<std::size_t>(std::ranges::count_if(all, [](const auto& one) { return one.about.has_value(); }));
    duration longest{};
    for (const auto& one : all)
        if (one.about) longest = std::max(longest, one.answered_after);
    auto text = fmt::format("as of {}", iso_8601(in.self.wall()));
    if (answered > 0)
        text += fmt::format("; {} component{} answered within {}", answered, answered == 1 ? "" : "s",
                            show_duration(longest));
    if (answered < all.size()) text += fmt::format("; {} did not answer", all.size() - answered);
    return text + "\n";
}

} // namespace ise::cli
