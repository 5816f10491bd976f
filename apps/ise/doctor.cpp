#include "look.hpp"

#include "findings.hpp"
#include "survey.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace ise::cli {
namespace {

using nlohmann::ordered_json;

std::string as_json(const std::vector<finding>& found, std::size_t components, bool healthy, wall_time at) {
    ordered_json told;
    told["healthy"] = healthy;
    told["asked_at"] = show_wall(at);
    told["components"] = components;
    auto all = ordered_json::array();
    for (const auto& one : found) {
        ordered_json entry;
        entry["severity"] = name_of(one.weight);
        entry["kind"] = one.kind;
        entry["component"] = one.component;
        entry["message"] = one.message;
        entry["advice"] = one.advice;
        all.push_back(std::move(entry));
    }
    told["findings"] = std::move(all);
    return told.dump(-1, ' ', false, ordered_json::error_handler_t::replace) + "\n";
}

std::string as_text(const std::vector<finding>& found) {
    std::string text;
    for (const auto& one : found) {
        auto message = one.message;
        while (message.ends_with('\n')) message.pop_back();
        text += fmt::format("{:<8} {}{}{}\n", name_of(one.weight), printable(one.component), one.component.empty() ? "" : ": ", printable(message, true));
        text += fmt::format("         -> {}\n", printable(one.advice));
    }
    return text;
}

task<> conclude(context& in, std::vector<finding> found, std::vector<surveyed> all) {
    auto bad = static_cast<std::size_t>(std::ranges::count_if(found, [](const finding& one) { return one.weight != severity::note; }));
    std::string text;
    if (in.set.json) {
        text = as_json(found, all.size(), bad == 0, in.self.wall());
    } else {
        text = as_text(found);
        if (bad == 0) text += all.empty() ? "nothing is wrong: no component is registered\n" : "nothing is wrong\n";
        text += show_age(in, all);
    }
    co_await in.out.write(in.self, std::move(text));
    if (bad > 0) throw problem(exit_code::failed, "findings", fmt::format("{} finding{}", bad, bad == 1 ? "" : "s"));
}

} // namespace

task<> doctor(context& in, doctor_options options) {
    survey_options what;
    what.leases = true;
    std::vector<surveyed> before, now;
    std::vector<finding> found;
    try {
        before = co_await survey(in, what);
        co_await in.self.sleep(options.interval);
        in.until = saturating_add(in.self.now(), in.set.timeout);
        now = co_await survey(in, what);
        found = examine(before, now, options.interval, in.self.env().identity().host_name);
    } catch (const problem& why) {
        if (why.code() != exit_code::not_reached) throw;
        finding lost{severity::error, "no_name_server", {}, why.what(), why.advice()};
        found.push_back(std::move(lost));
    }
    co_await conclude(in, std::move(found), std::move(now));
}

} // namespace ise::cli
