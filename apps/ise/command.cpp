#include "command.hpp"
#include "signals.hpp"

#include "json.hpp"
#include "text.hpp"

#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/core/task_scope.hpp>
#include <ise/naming/name_servers.hpp>
#include <ise/naming/services.hpp>

#include <asio/io_context.hpp>
#include <asio/signal_set.hpp>

#include <fmt/format.h>

#include <csignal>
#include <functional>
#include <thread>
#include <utility>

namespace ise::cli {
namespace {

struct error_line {
    std::string error;
    int exit_code = 0;
    std::string message;
    if_any<std::string> executed, advice;
};
struct note_line {
    std::string note;
};

// The command as a component that is registered only when it says so.
class performer final : public component {
public:
    explicit performer(std::function<task<>(component&)> body) : body_(std::move(body)) { announce_when_ready(); }

private:
    task<> run() override { return body_(*this); }

    std::function<task<>(component&)> body_;
};

// How the command ended, written on its component's thread and read when that has stopped.
struct ending {
    std::optional<exit_code> code;
    std::optional<problem> why;
};

task<> run_on(component& self, const parsed_command& what, interrupt& ctrl_c, ending& end) {
    struct care_ends { // its handler holds what the command had
        interrupt& of;
        ~care_ends() { of.leave(); }
    } at_the_end{ctrl_c};
    output out;
    context in{self, what.set, out, saturating_add(self.now(), what.set.timeout), ctrl_c};
    try {
        co_await what.work(in);
        end.code = exit_code::ok;
    } catch (const reader_gone&) {
        end.code = exit_code::ok;
    } catch (const problem& why) {
        end.why = why;
    } catch (const error& thrown) {
        end.why.emplace(thrown.why());
    } catch (const std::exception& thrown) {
        if (is_cancellation(std::current_exception())) throw; // Ctrl-C
        end.why.emplace(exit_code::failed, "unexpected", thrown.what());
    }
    // Cancelled: what was waited for may have made a failure of it.
    if (end.why && self.state() == component_state::stopping) end.why.reset();
    if (end.why) end.code = end.why->code();
    self.stop();
}

// As ise::run_until_signal, for a command that may care.
void run_until_interrupted(node& running, interrupt& ctrl_c, asio::io_context& context, asio::signal_set& signals) {
    std::function<void()> listen = [&] {
        signals.async_wait([&](std::error_code problem, int) {
            if (problem) return;
            if (ctrl_c.raise()) return listen();
            running.stop();
        });
    };
    listen();
    std::thread watcher([&] { context.run(); });
    running.wait();
    context.stop();
    watcher.join();
}

} // namespace

void interrupt::care(loop& on, std::function<void()> first) {
    std::lock_guard lock(mutex_);
    gate_ = on.gate();
    first_ = std::move(first);
}

void interrupt::leave() {
    std::lock_guard lock(mutex_);
    first_ = nullptr;
    gate_.reset();
    *valid_ = false;
    valid_ = std::make_shared<bool>(true);
}

bool interrupt::raise() {
    std::lock_guard lock(mutex_);
    if (!first_) return false;
    gate_->post([first = std::exchange(first_, nullptr), valid = valid_] {
        if (*valid) first();
    });
    return true;
}

std::vector<endpoint> name_servers_of(const settings& set, const environment& env) {
    const bool given = !set.name_server.empty();
    auto all = given ? parse_name_servers(set.name_server) : usual_name_servers(env);
    if (!all)
        throw problem(exit_code::usage, "usage",
                      fmt::format("{}{}", given ? "--name-server: " : "", all.error().message()));
    return *all;
}

exit_code run(const parsed_command& what) {
    const auto& set = what.set;
    ending end;
    interrupt ctrl_c;
    try {
        real_environment env;
        node_options options;
        options.name = "ise";
        options.name_servers = name_servers_of(set, env);
        options.security = set.security;
        options.metrics = "none"; // ISE_METRICS means those that run
        options.grace = std::chrono::milliseconds(500);
        options.log = set.verbose ? log_to_stderr(log_level::debug) : log_sink();
        component_options mine;
        mine.listens = false;
        mine.registers = false;
        node running(env, options);
        auto path = what.looks ? fmt::format("{}{}", looker_prefix, env.identity().process_id) : set.as;
        if (!path.empty() && !naming::is_path(path))
            throw problem(exit_code::usage, "usage",
                          fmt::format("--as: '{}' is not a path, such as atirma/operators/ana", path));
        // Before anything is printed: whoever reads it may answer with Ctrl-C.
        asio::io_context context(1);
        asio::signal_set signals(context);
        for (int number : ending_signals()) signals.add(number);
        auto body = [&](component& self) { return run_on(self, what, ctrl_c, end); };
        if (what.stands_in.empty()) {
            running.start(path, body, mine);
        } else {
            component_options in_place;
            if (!what.listens_at.empty()) in_place.listen = {endpoint::parse(what.listens_at).value()};
            running.start<performer>(what.stands_in, in_place, body);
        }
        run_until_interrupted(running, ctrl_c, context, signals);
        for (const auto& one : running.reports()) // such as a name that somebody else has
            if (!one.failure.empty() && !end.code) {
                end.why.emplace(exit_code::failed, "failed", one.failure);
                end.code = exit_code::failed;
            }
    } catch (const problem& why) {
        end.why = why;
        end.code = why.code();
    } catch (const std::exception& thrown) {
        end.why.emplace(exit_code::failed, "unexpected", thrown.what());
        end.code = exit_code::failed;
    }
    if (end.why) report(*end.why, set.json);
    if (end.code) return *end.code;
    return what.endless ? exit_code::ok : exit_code::interrupted;
}

void report(const problem& why, bool json) {
    auto advice = why.advice();
    while (advice.ends_with('\n')) advice.pop_back();
    if (json) {
        error_line line{why.name(), static_cast<int>(why.code()), why.what(), {}, {}};
        if (!why.executed().empty()) line.executed = why.executed();
        if (!advice.empty()) line.advice = advice;
        return complain(json_line(line));
    }
    auto text = fmt::format("ise: {}\n", printable(why.what(), true));
    if (why.executed() == "unknown") text += "     it may have been executed anyway\n";
    if (why.executed() == "not_executed") text += "     it did not run there\n";
    if (!advice.empty()) text += indented(printable(advice, true), "     ");
    complain(text);
}

void note(const settings& set, const std::string& text) {
    if (set.json) {
        note_line line{text};
        complain(json_line(line));
    } else {
        complain(fmt::format("ise: {}\n", printable(text)));
    }
}

} // namespace ise::cli
