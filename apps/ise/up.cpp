#include "commands.hpp"

#include "deployments.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <optional>

namespace ise::cli {
namespace {

using namespace std::chrono_literals;
namespace host_services = instantiation::services;
using deployment::action;
using instantiation::start_request;

// Beside what a component may take by its own terms: a name that has to come free, another try as before.
constexpr duration besides = 30s;
constexpr duration longest_stop = 90s;

/// A step that was done, and how it is undone.
struct done_step {
    deployment::step what;
    std::optional<start_request> former; ///< of what was changed
};

/// Carries a plan out, and tells what happens while it happens.
class carrier {
public:
    carrier(context& in, fleet& there) : in_(in), there_(there) {}

    task<> carry_out(std::vector<deployment::step> steps, bool keep) {
        count_ = steps.size();
        std::optional<problem> why;
        for (auto& one : steps) {
            ++number_;
            try {
                co_await carry_out_one(one);
            } catch (const problem& thrown) {
                why = thrown;
            }
            if (why) break;
        }
        if (why) co_await give_up(std::move(*why), keep);
        for (auto& one : done_)
            if (one.what.what == action::stop) co_await forget(one.what);
    }

    /// Ends what a step names, and keeps nothing of it.
    task<> take_down(deployment::step what, std::size_t number, std::size_t count) {
        number_ = number;
        count_ = count;
        co_await tell(what, "begun", "");
        auto ended = co_await stop(what, true);
        co_await tell(what, "done", ended.ended.reason);
    }

private:
    task<> carry_out_one(deployment::step what) {
        co_await tell(what, "begun", "");
        done_step made;
        made.what = what;
        auto began = in_.self.now();
        std::string outcome;
        if (what.what == action::stop) {
            auto ended = co_await stop(what, false);
            outcome = ended.ended.reason;
        } else if (what.what == action::start) {
            auto server = there_.servers.at(what.server);
            auto request = what.request;
            auto told = co_await server.try_call(host_services::start, std::move(request), limit_of(what));
            if (!told) throw problem(told.error());
            auto instance = started(*told);
            outcome = ready_text(instance, began);
        } else {
            auto told = co_await change_to(what.server, what.request);
            auto instance = started(told.outcome);
            made.former = std::move(told.former);
            outcome = told.way == instantiation::change_way::restarted ? ready_text(instance, began) : std::string("changed while it runs");
        }
        co_await tell(what, "done", outcome);
        done_.push_back(std::move(made));
    }

    task<> give_up(problem why, bool keep) {
        auto text = fmt::format("step {} of {} failed: {}", number_, count_, why.what());
        std::string advice = why.advice();
        if (keep || done_.empty()) {
            if (!done_.empty()) text += fmt::format("\nwhat was done before stays (--keep)");
            throw problem(why.code(), why.name(), text, advice);
        }
        bool whole = true;
        for (auto one = done_.rbegin(); one != done_.rend(); ++one) {
            bool undone = co_await undo(*one);
            whole = whole && undone;
        }
        text += whole ? "\nwhat was done before was undone" : "\nwhat was done before was undone in part: ise ps, ise diff";
        throw problem(why.code(), why.name(), text, advice);
    }

    task<bool> undo(done_step what) {
        std::string trouble;
        try {
            co_await undo_one(what);
        } catch (const problem& thrown) {
            trouble = thrown.what();
        }
        co_await tell(what.what, trouble.empty() ? "undone" : "not undone", trouble);
        co_return trouble.empty();
    }

    task<> undo_one(const done_step& what) {
        if (what.what.what == action::start) {
            auto ended = co_await stop(what.what, true);
        } else if (what.what.what == action::stop) {
            if (!what.what.alive) co_return;
            auto server = there_.servers.at(what.what.server);
            instantiation::restart_request request{what.what.path};
            auto told = co_await server.try_call(host_services::restart, std::move(request), limit_of(what.what));
            if (!told) throw problem(told.error());
            started(*told);
        } else {
            auto told = co_await change_to(what.what.server, *what.former);
            started(told.outcome);
        }
    }

    task<instantiation::change_response> change_to(std::string server, start_request to) {
        auto who = there_.servers.at(server);
        instantiation::change_request request;
        auto limit = 4 * to.terms.ready_within + to.terms.grace + besides;
        request.to = std::move(to);
        auto told = co_await who.try_call(host_services::change, std::move(request), std::min(limit, in_.left()));
        if (!told) throw problem(told.error());
        co_return std::move(*told);
    }

    task<instantiation::ended_response> stop(deployment::step what, bool forget) {
        auto server = there_.servers.at(what.server);
        instantiation::stop_request request;
        request.path = what.path;
        request.forget = forget;
        auto told = co_await server.try_call(host_services::stop, std::move(request), std::min(longest_stop, in_.left()));
        if (!told) throw problem(told.error());
        co_return std::move(*told);
    }

    /// Of what has ended, and is not needed to undo anything any more.
    task<> forget(deployment::step what) {
        std::string trouble;
        try {
            auto ended = co_await stop(what, true);
        } catch (const problem& thrown) {
            trouble = thrown.what();
        }
        if (!trouble.empty()) note(in_.set, fmt::format("{} on {} is not forgotten: {}", what.path, what.server, trouble));
    }

    duration limit_of(const deployment::step& what) const { return std::min(3 * what.request.terms.ready_within + what.request.terms.grace + besides, in_.left()); }

    std::string ready_text(const instantiation::instance_text& what, time_point began) const {
        return fmt::format("ready after {}, process {}", show_duration(in_.self.now() - began), what.process_id);
    }

    task<> tell(deployment::step what, std::string state, std::string outcome) {
        std::string text;
        if (in_.set.json) {
            auto told = nlohmann::ordered_json::parse(as_json(what));
            told["step"] = number_;
            told["of"] = count_;
            told["state"] = state;
            told["outcome"] = outcome;
            text = told.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
        } else if (state == "begun") {
            text = printable(fmt::format("[{}/{}] {}", number_, count_, deployment::as_text(what, true)), true) + "\n";
        } else {
            bool plain = state == "done";
            text = printable(fmt::format("      {}{}{}", plain ? "" : fmt::format("{} {} on {}: ", deployment::name_of(what.what), what.path, what.server),
                                         plain && !outcome.empty() ? "" : state, plain || outcome.empty() ? outcome : ": " + outcome)) + "\n";
        }
        co_await in_.out.write(in_.self, std::move(text));
    }

    context& in_;
    fleet& there_;
    std::vector<done_step> done_;
    std::size_t number_ = 0, count_ = 0;
};

struct prepared {
    deployment::deployment wanted;
    fleet there;
    deployment::step_plan plan;
};

task<prepared> prepare(context& in, deployment_options options, bool settled) {
    prepared made;
    made.wanted = read_file(in, options);
    made.there = co_await ask_hosts(in, made.wanted, settled);
    std::vector<deployment::problem> wrong;
    deployment::complete(made.wanted, made.there.hosts, wrong);
    refuse(options.file, wrong);
    made.plan = deployment::plan_up(made.wanted, made.there.hosts);
    refuse(options.file, made.plan.problems);
    co_return made;
}

std::string summary(const deployment::deployment& of, const char* word, std::size_t components, std::size_t steps, bool json) {
    if (json) {
        nlohmann::ordered_json told;
        told["deployment"] = of.name.text;
        told["state"] = word;
        told["components"] = components;
        told["steps"] = steps;
        return told.dump() + "\n";
    }
    auto done = steps == 0 ? std::string("nothing was to be done") : fmt::format("{} step{}", steps, steps == 1 ? "" : "s");
    return fmt::format("{} is {}: {} component{}, {}\n", of.name.text, word, components, components == 1 ? "" : "s", done);
}

} // namespace

task<> up(context& in, deployment_options options) {
    auto made = co_await prepare(in, options, true);
    auto steps = made.plan.steps.size();
    carrier hands(in, made.there);
    co_await hands.carry_out(std::move(made.plan.steps), options.keep);
    auto text = summary(made.wanted, "up", made.wanted.components.size(), steps, in.set.json);
    co_await in.out.write(in.self, std::move(text));
}

task<> down(context& in, deployment_options options) {
    auto wanted = read_file(in, options);
    auto there = co_await ask_hosts(in, wanted, true);
    auto plan = deployment::plan_down(wanted, there.hosts);
    carrier hands(in, there);
    std::optional<problem> why;
    std::size_t number = 0;
    for (auto& one : plan.steps) {
        std::string trouble;
        try {
            co_await hands.take_down(one, ++number, plan.steps.size());
        } catch (const problem& thrown) { // the others are to end all the same
            why = thrown;
            trouble = thrown.what();
        }
        if (!trouble.empty()) note(in.set, fmt::format("{} on {} is not stopped: {}", one.path, one.server, trouble));
    }
    if (why) throw problem(why->code(), why->name(), fmt::format("not all of {} is down: {}", wanted.name.text, why->what()), "ise ps tells what runs; try again");
    auto text = summary(wanted, "down", plan.steps.size(), plan.steps.size(), in.set.json);
    co_await in.out.write(in.self, std::move(text));
}

task<> diff(context& in, deployment_options options) {
    auto made = co_await prepare(in, options, false);
    std::string text;
    if (in.set.json) {
        nlohmann::ordered_json told;
        told["deployment"] = made.wanted.name.text;
        auto steps = nlohmann::ordered_json::array();
        for (const auto& one : made.plan.steps) steps.push_back(nlohmann::ordered_json::parse(as_json(one)));
        told["steps"] = std::move(steps);
        told["kept"] = made.plan.kept;
        text = told.dump(-1, ' ', false, nlohmann::json::error_handler_t::replace) + "\n";
    } else {
        for (const auto& one : made.plan.steps) text += printable(deployment::as_text(one, true), true) + "\n";
        if (text.empty()) text = fmt::format("{} is as {} describes it: {} components\n", made.wanted.name.text, options.file, made.wanted.components.size());
    }
    co_await in.out.write(in.self, std::move(text));
}

} // namespace ise::cli
