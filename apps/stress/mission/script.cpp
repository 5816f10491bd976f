#include "mission.hpp"

#include "processes.hpp"

#include <components/boat_simulator/services.hpp>
#include <ise/http/stream_http_client.hpp>

#include <ise/core/environment.hpp>

#include <nlohmann/json.hpp>

#include <algorithm>
#include <filesystem>
#include <set>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr int samples_wanted = 40;

} // namespace

ise::task<> mission::script::run() {
    auto sailed = [this](const ground_truth& now) { of_.told_.sailed_m = static_cast<double>(now.distance_sailed_m); };
    listen(at("atirma/boat"), services::truth, sailed);
    bool there = co_await see_the_boat();
    if (!there) {
        of_.trouble_ = "no telemetry reached the operators: the deployment did not start";
        of_.ask(task::over);
        co_return;
    }
    // The plan begins now, and its times are told from the beginning of everything.
    auto first = of_.elapsed();
    auto& plan = of_.told_.plan;
    for (auto& one : plan.faults) one.at += first;
    for (auto& person : of_.told_.people)
        for (auto& one : person.orders) one.at += first;
    plan.length += first;
    for (std::size_t i = 0; i < operators; ++i) of_.told_.people[i].may_begin = true;
    for (auto& next : timetable()) {
        co_await sleep_till(of_.began_ + next.at);
        next.what();
    }
    co_await sleep_till(of_.began_ + plan.length);
    auto ended = of_.elapsed();
    for (const auto& one : of_.options_.windows) of_.options_.say("leave " + one.name);
    // The boat goes on sending: a judgement of a later instant would find packets that nobody can have been shown yet.
    auto over = [this] { return windows_left() && nothing_owed(); };
    bool calm = over();
    for (; !calm && of_.elapsed() - ended < of_.options_.max_calm; calm = over()) co_await sleep(1s);
    of_.told_.calm = of_.elapsed() - ended;
    if (!calm && !of_.judge()) of_.trouble_ = "what the communication nodes keep cannot be read";
    co_await learn();
    of_.ask(task::over);
}

ise::task<bool> mission::script::see_the_boat() {
    auto nodes = at(std::string(communication_role));
    auto until = now() + of_.options_.max_start;
    while (now() < until) {
        track_request any;
        any.max_packets = 1;
        auto page = co_await nodes.try_call(services::track, any, 5s);
        if (page && !page->packets.empty()) co_return true;
        co_await sleep(500ms);
    }
    co_return false;
}

/// What only the page knows in the end: what it has shown.
ise::task<> mission::script::learn() {
    if (of_.options_.page.empty()) co_return;
    ise::stream_http_client client(on());
    ise::http_exchange ask;
    ask.url = "http://" + of_.options_.page + "/api/status";
    auto answer = co_await client.exchange(ask, 20s);
    auto parsed = nlohmann::json::parse(answer ? answer->body : std::string(), nullptr, false);
    if (parsed.is_discarded() || !parsed.contains("packets")) {
        of_.trouble_ = "the page does not report what it has shown";
        co_return;
    }
    const auto& packets = parsed["packets"];
    of_.told_.page.received = packets.value("received", std::uint64_t{0});
    of_.told_.page.duplicates = packets.value("duplicates", std::uint64_t{0});
    of_.told_.page.malformed = packets.value("malformed", std::uint64_t{0});
}

std::vector<mission::script::event> mission::script::timetable() {
    std::vector<event> all;
    const auto& plan = of_.told_.plan;
    for (const auto& one : plan.faults) {
        all.push_back({one.at, [this, one] { begin(one); }});
        if (one.length.count() > 0) all.push_back({one.at + one.length, [this, one] { end(one); }});
    }
    for (int i = 1; i < samples_wanted; ++i)
        all.push_back({plan.length / samples_wanted * i, [this] { take_sample(); }});
    std::erase_if(all, [&](const auto& one) { return one.at < of_.elapsed(); });
    std::stable_sort(all.begin(), all.end(), [](const auto& a, const auto& b) { return a.at < b.at; });
    return all;
}

void mission::script::begin(const fault& what) {
    auto at = of_.elapsed();
    auto& result = of_.told_;
    open_[what.what] = result.episodes.size();
    result.episodes.push_back({at, what.length.count() > 0 ? ise::duration(-1ns) : at, std::string(describe(what.what)),
                               felt_over(what.what), what.what == trouble::boat_killed});
    auto doing = deed_of(what.what);
    if (what.what == trouble::operator_away) of_.ask(task::leave);
    else if (!doing.process.empty()) of_.options_.say((doing.stops ? "stop " : "kill ") + doing.process);
    if (doing.begin) of_.director_->let(doing.begin);
}

void mission::script::end(const fault& what) {
    of_.told_.episodes[open_.at(what.what)].until = of_.elapsed();
    auto doing = deed_of(what.what);
    if (what.what == trouble::operator_away) of_.ask(task::come);
    else if (!doing.process.empty()) of_.options_.say((doing.stops ? "continue " : "start ") + doing.process);
    if (doing.end) of_.director_->let(doing.end);
}

/// Of the processes that the first console sees; this one keeps a ledger of everything, and is no part of it.
void mission::script::take_sample() {
    sample one;
    one.at = of_.elapsed();
    std::set<std::uint64_t> processes;
    auto consoles = of_.consoles();
    for (const auto& console : consoles) {
        auto shown = console->latest()->present;
        if (!shown) continue;
        for (const auto& there : *shown) processes.insert(there.process_id);
    }
    processes.erase(env().identity().process_id);
    measure(one, processes);
    of_.told_.samples.push_back(one);
}

bool mission::script::windows_left() {
    return std::ranges::all_of(of_.options_.windows, [](const auto& one) { return std::filesystem::exists(one.file); });
}

bool mission::script::nothing_owed() {
    if (!of_.judge()) return false;
    const auto& verdict = of_.proof();
    return verdict.missing.empty() && verdict.only_on_one == 0 &&
           std::ranges::all_of(verdict.subscribers, [](const auto& one) { return one.second.missed == 0; });
}

} // namespace atirma::stress
