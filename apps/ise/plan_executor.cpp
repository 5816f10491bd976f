#include "plan_executor.hpp"

#include "text.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;
namespace host_services = instantiation::services;
using deployment::action;
using instantiation::start_request;

// Beside what a component may take by its own terms: a name that has to come free, another try as before.
constexpr duration besides = 30s;
constexpr duration max_stop = 90s;
constexpr std::size_t steps_at_once = 8; // an instantiation server bounds how many are started within a short time

// Of what was asked of an instantiation server. One that is lost meanwhile says neither that it is done nor that it is
// not.
problem failed_at(action what, const std::string& path, const std::string& server, const failure& why) {
    if (why.executed() != execution::unknown || code_of(why.code()) != exit_code::not_reached) return problem(why);
    return {exit_code::not_reached, std::string(ise::name_of(why.code())),
            fmt::format("the instantiation server of {} did not come to tell whether it did {} {}: {}", server,
                        deployment::name_of(what), path, why.message()),
            fmt::format("is ise_instantiation_server running on {}? Started again it takes over what it had begun; "
                        "then ise up goes on from there, and ise down ends it",
                        server)};
}

} // namespace

planned_step planned_step_of(const deployment::step& of) {
    planned_step made{deployment::name_of(of.what), of.path, of.server, of.reason, {}, {}, {}, {}, {}};
    for (const auto& one : of.differences) made.differences.push_back({one.what, one.is, one.wanted, one.in_place});
    return made;
}

plan_executor::plan_executor(context& in, fleet& there)
    : in_(in), there_(there), scope_(in.self.on(), [this](const std::string&, std::exception_ptr thrown) {
          if (!why_ && !is_cancellation(thrown)) why_.emplace(exit_code::failed, "unexpected", ise::describe(thrown));
      }) {}

plan_executor::~plan_executor() { in_.ctrl_c.leave(); }

task<> plan_executor::execute(std::vector<deployment::step> steps, manner how) {
    how_ = how;
    for (auto& one : steps) {
        jobs_.emplace_back();
        jobs_.back().what = std::move(one);
    }
    in_.ctrl_c.care(in_.self.on(), [this] { on_interrupt(); });
    std::exception_ptr cancelled;
    try {
        for (;;) {
            bool some = begin_some();
            if (begun_ > 0) co_await wait_for_change();
            else if (!some) break;
        }
        if (why_ || interrupted_) co_await give_up();
        for (auto& one : jobs_)
            if (!how_.forget && one.what.what == action::stop) co_await forget(one.what);
    } catch (...) {
        cancelled = std::current_exception();
    }
    in_.ctrl_c.leave();
    scope_.stop();
    co_await this_task::forget_cancellation;
    co_await scope_.join();
    if (cancelled) std::rethrow_exception(cancelled);
}

bool plan_executor::may_begin(const job& one) const {
    if (one.now != phase::waiting) return false;
    return std::ranges::all_of(one.what.after, [&](std::size_t before) {
        auto now = jobs_[before].now;
        return now == phase::done || (how_.all && now == phase::failed);
    });
}

bool plan_executor::begin_some() {
    if (interrupted_ || (why_ && !how_.all)) return false;
    bool some = false;
    for (std::size_t number = 0; number < jobs_.size() && begun_ < steps_at_once; ++number) {
        auto& one = jobs_[number];
        if (!may_begin(one)) continue;
        one.now = phase::begun;
        some = true;
        ++begun_;
        one.cancel = scope_.spawn("step", execute_one(number));
    }
    return some;
}

task<> plan_executor::execute_one(std::size_t number) {
    auto& one = jobs_[number];
    std::optional<problem> why;
    std::string outcome;
    struct ending { // also where it is given up
        plan_executor& of;
        job& one;
        ~ending() {
            if (one.now == phase::begun) one.now = phase::failed; // it did not come to its end
            one.cancel = nullptr;
            --of.begun_;
            if (of.changed_) of.changed_->resume();
        }
    } guard{*this, one};
    try {
        co_await tell(number, "begun", "");
        outcome = co_await act(one);
        one.now = phase::done;
        done_.push_back(number);
        co_await tell(number, "done", outcome);
    } catch (const problem& thrown) {
        why = thrown;
    } catch (const error& thrown) {
        why.emplace(thrown.why());
    }
    if (!why || interrupted_) co_return;
    std::string text = why->what();
    if (!how_.all)
        text = fmt::format("step {} of {} failed ({} {} on {}): {}", number + 1, jobs_.size(),
                           deployment::name_of(one.what.what), one.what.path, one.what.server, text);
    if (!why_) why_.emplace(why->code(), why->name(), text, why->advice());
    std::string message;
    if (how_.all) message = why->what();
    if (why->code() != exit_code::no_output) co_await tell(number, "failed", message);
}

task<std::string> plan_executor::act(job& one) {
    auto what = one.what;
    auto began = in_.self.now();
    if (what.what == action::stop) {
        auto ended = co_await stop(what.server, what.path, how_.forget);
        co_return ended.ended.reason;
    }
    if (what.what == action::start) {
        auto server = there_.servers.at(what.server);
        for (;;) {
            auto request = what.request;
            auto response = co_await server.try_call(host_services::start, std::move(request), limit_of(what));
            if (!response) throw failed_at(what.what, what.path, what.server, response.error());
            auto later = room_in(*response);
            if (later == duration{}) {
                auto instance = started(*response);
                co_return ready_text(instance, began);
            }
            co_await in_.self.sleep(later);
        }
    }
    auto result = co_await change_to(what.server, what.request, 0);
    auto instance = started(result.outcome);
    one.former = std::move(result.former);
    one.undo = result.undo;
    if (result.way == instantiation::change_way::restarted) co_return ready_text(instance, began);
    co_return std::string("changed while it runs");
}

// A server starts so many within a time: a system that has more waits, as long as the command may take.
duration plan_executor::room_in(const instantiation::start_response& response) const {
    const bool waits = response.outcome == instantiation::start_outcome::too_many && response.retry_after < in_.left();
    return waits ? response.retry_after : duration{};
}

// What is being stopped or changed comes to its end; what is being started is given up, which ends it.
void plan_executor::on_interrupt() {
    interrupted_ = true;
    note(in_.set, how_.undo ? "interrupted: what was done is undone; Ctrl-C once more leaves it as it is"
                            : "interrupted: what was done stays");
    for (auto& one : jobs_)
        if (one.now != phase::waiting && one.cancel && one.what.what == action::start) one.cancel->cancel();
    if (changed_) changed_->resume();
}

task<> plan_executor::wait_for_change() {
    waiter<> result(in_.self.on());
    struct listed {
        plan_executor& of;
        ~listed() { of.changed_ = nullptr; }
    } listing{*this};
    changed_ = &result;
    co_await result.wait();
}

task<> plan_executor::give_up() {
    if (interrupted_ && !why_) {
        auto left = std::ranges::count_if(jobs_, [](const job& one) { return one.now == phase::waiting; });
        why_.emplace(
            exit_code::interrupted, "interrupted",
            fmt::format("interrupted: {} of {} steps were done, {} not begun", done_.size(), jobs_.size(), left));
    }
    std::string text = why_->what();
    bool anything = !done_.empty() || interrupted_;
    if (!how_.undo || !anything) {
        if (!done_.empty() && !how_.all) text += "\nwhat was done before stays (--keep)";
        throw problem(why_->code(), why_->name(), text, why_->advice());
    }
    bool whole = true;
    for (auto& one : jobs_) // given up while it was started: nothing is to be kept of it
        if (interrupted_ && one.now == phase::failed && one.what.what == action::start) co_await forget(one.what);
    for (auto number = done_.rbegin(); number != done_.rend(); ++number) {
        bool undone = co_await undo(jobs_[*number]);
        whole = whole && undone;
    }
    text += whole ? "\nwhat was done before was undone" : "\nwhat was done before was undone in part: ise ps, ise diff";
    throw problem(why_->code(), why_->name(), text, why_->advice());
}

task<bool> plan_executor::undo(job& one) {
    std::string trouble;
    try {
        co_await undo_one(one);
    } catch (const problem& thrown) {
        trouble = thrown.what();
    }
    auto number = static_cast<std::size_t>(&one - jobs_.data());
    co_await tell(number, trouble.empty() ? "undone" : "not undone", trouble);
    co_return trouble.empty();
}

task<> plan_executor::undo_one(const job& one) {
    const auto& what = one.what;
    if (what.what == action::start) {
        auto ended = co_await stop(what.server, what.path, true);
    } else if (what.what == action::stop) {
        if (!what.alive) co_return;
        auto server = there_.servers.at(what.server);
        instantiation::restart_request request{what.path};
        auto response = co_await server.try_call(host_services::restart, std::move(request), limit_of(what));
        if (!response) throw problem(response.error());
        started(*response);
    } else {
        if (one.undo == 0) co_return; // nothing was changed
        auto former = *one.former;
        former.path = what.path;
        auto result = co_await change_to(what.server, std::move(former), one.undo);
        started(result.outcome);
    }
}

task<instantiation::change_response> plan_executor::change_to(std::string server, start_request to,
                                                              std::uint64_t undo) {
    auto who = there_.servers.at(server);
    instantiation::change_request request;
    auto limit = 4 * to.terms.ready_within + to.terms.grace + besides;
    auto path = to.path;
    request.to = std::move(to);
    request.undo = undo;
    for (;;) {
        auto copy = request;
        auto response = co_await who.try_call(host_services::change, std::move(copy), std::min(limit, in_.left()));
        if (!response) throw failed_at(action::change, path, server, response.error());
        auto later = room_in(response->outcome);
        if (later == duration{}) co_return std::move(*response);
        co_await in_.self.sleep(later);
    }
}

task<instantiation::ended_response> plan_executor::stop(std::string server, std::string path, bool forget) {
    auto who = there_.servers.at(server);
    instantiation::stop_request request;
    request.path = path;
    request.forget = forget;
    auto response = co_await who.try_call(host_services::stop, std::move(request), std::min(max_stop, in_.left()));
    if (!response) throw failed_at(action::stop, path, server, response.error());
    co_return std::move(*response);
}

/// Of what has ended, and is not needed to undo anything any more.
task<> plan_executor::forget(const deployment::step& what) {
    std::string trouble;
    try {
        auto ended = co_await stop(what.server, what.path, true);
    } catch (const problem& thrown) {
        trouble = thrown.what();
    }
    if (!trouble.empty() && !interrupted_)
        note(in_.set, fmt::format("{} on {} is not forgotten: {}", what.path, what.server, trouble));
}

duration plan_executor::limit_of(const deployment::step& what) const {
    return std::min(3 * what.request.terms.ready_within + what.request.terms.grace + besides, in_.left());
}

std::string plan_executor::ready_text(const instantiation::instance_info& what, time_point began) const {
    return fmt::format("ready after {}, process {}", show_duration(in_.self.now() - began), what.process_id);
}

task<> plan_executor::tell(std::size_t number, std::string state, std::string outcome) {
    const auto& what = jobs_[number].what;
    std::string text;
    if (in_.set.json) {
        auto line = planned_step_of(what);
        line.step = number + 1;
        line.of = jobs_.size();
        line.state = state;
        line.outcome = outcome;
        text = json_line(line);
    } else if (state == "begun") {
        text = printable(fmt::format("[{}/{}] {}", number + 1, jobs_.size(), deployment::as_text(what, true)), true) +
               "\n";
    } else {
        auto line = fmt::format("[{}/{}] {} {} on {}: {}", number + 1, jobs_.size(), deployment::name_of(what.what),
                                what.path, what.server, state == "done" && !outcome.empty() ? "" : state);
        if (!outcome.empty()) line += (state == "done" ? "" : ": ") + outcome;
        text = printable(line) + "\n";
    }
    co_await say(std::move(text));
}

// One writer: what others say meanwhile comes after it. Whoever does not read any more gets no account, but its deed.
task<> plan_executor::say(std::string text) {
    unsaid_ += text;
    if (std::exchange(saying_, true)) co_return;
    struct ending {
        bool& flag;
        ~ending() { flag = false; }
    } guard{saying_};
    try {
        while (!unsaid_.empty()) {
            auto now = std::exchange(unsaid_, {});
            co_await in_.out.write(in_.self, std::move(now));
        }
    } catch (const reader_gone&) {
        unsaid_.clear();
    }
}

} // namespace ise::cli
