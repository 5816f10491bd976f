// ise play: plays a recording into the running system.
#include "json.hpp"
#include "options.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/bag/player.hpp>
#include <ise/component/node.hpp>
#include <ise/core/loop.hpp>

#include <fmt/format.h>

#include <cerrno>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include <unistd.h>

namespace ise::cli {
namespace {

struct play_options {
    bag::player_options what;
    std::vector<std::string> renamed;
    std::string into = "live";
};

struct play_answer {
    std::string file;
    std::vector<std::string> paths;
    std::uint64_t packets = 0, answered = 0, unknown = 0, called = 0, compared = 0;
    if_any<std::string> difference;
};

std::string as_text(const play_answer& of) {
    auto text = fmt::format("played {} packets, answered {} calls\n", of.packets, of.answered);
    if (of.unknown > 0) text += fmt::format("refused {} calls that the recording does not have\n", of.unknown);
    if (of.compared > 0)
        text += fmt::format("made {} calls, compared {} packets and answers\n", of.called, of.compared);
    if (of.difference) text += "first difference: " + printable(*of.difference) + "\n";
    return text;
}

// The node of the played components, which is made and ended on other threads than the command's.
struct stage {
    std::unique_ptr<node> running;
    std::unique_ptr<bag::player> play;
    bool stopped = false;
};

task<> play(context& in, play_options options) {
    [[maybe_unused]] auto server = co_await reach_name_server(in); // whether there is one
    auto on = std::make_shared<stage>();
    node_options of;
    of.name = "ise play";
    of.name_servers = name_servers_of(in.set, in.self.env());
    of.security = in.set.security;
    of.metrics = "none";
    of.log = in.set.verbose ? log_to_stderr(log_level::debug) : log_sink();
    auto& env = in.self.env();
    auto begin = [on, of, &env, &options] {
        on->running = std::make_unique<node>(env, of);
        try {
            on->play = std::make_unique<bag::player>(*on->running, options.what);
        } catch (...) { // such as a file that is no recording
            on->running.reset();
            throw;
        }
    };
    in.ctrl_c.care(in.self.on(), [on] { on->stopped = true; });
    co_await in.self.offload(begin);
    const auto& paths = on->play->paths();
    note(in.set, paths.empty() ? fmt::format("testing {} with {}; Ctrl-C ends it",
                                             printable(enumerate(options.what.tested)), printable(options.what.file))
                               : fmt::format("playing {} as {}; Ctrl-C ends it", printable(options.what.file),
                                             printable(enumerate(paths))));
    std::optional<stop_report> failed; // such as one whose name somebody else has
    while (!on->play->done() && !on->stopped && !failed) {
        co_await in.self.sleep(std::chrono::milliseconds(50));
        for (auto& one : on->running->reports())
            if (!failed && !one.failure.empty()) failed = std::move(one);
    }
    auto end = [on] {
        on->running->stop();
        on->running->wait();
    };
    co_await in.self.offload(end);
    in.ctrl_c.leave();
    play_answer answer;
    answer.file = options.what.file;
    answer.paths = on->play->paths();
    auto counts = on->play->counts();
    answer.packets = counts.packets;
    answer.answered = counts.answered;
    answer.unknown = counts.unknown;
    answer.called = counts.called;
    answer.compared = counts.compared;
    auto different = on->play->first_difference();
    if (different) answer.difference = different->text();
    auto text = in.set.json ? json_line(answer) : as_text(answer);
    auto trouble = on->play->trouble();
    auto close = [on] {
        on->play.reset();
        on->running.reset();
    };
    co_await in.self.offload(close);
    if (failed)
        throw problem(
            exit_code::failed, "failed", fmt::format("{} is not played: {}", failed->path, failed->failure),
            fmt::format("--rename {}=OTHER plays it under another name, --only chooses what is played", failed->path));
    co_await in.out.write(in.self, std::move(text));
    if (trouble) throw problem(*trouble);
    if (different)
        throw problem(exit_code::failed, "different", "the tested components behave differently from the recording",
                      "leave out times and random numbers with --ignore FIELD");
}

// `ise` has no components of users: the program that has them replays.
[[noreturn]] void replay_with(const play_options& options, std::vector<std::string> program) {
    if (program.empty())
        throw problem(
            exit_code::usage, "usage", "--into sim: name the program that has the components",
            "such as: ise play voyage.mcap --into sim -- atirma communication-node --path atirma/shore/node-1");
    if (!options.renamed.empty() || !options.what.tested.empty() || !options.what.ignored.empty() ||
        options.what.speed != 1 || options.what.loop)
        throw problem(exit_code::usage, "usage",
                      "--into sim: components are tested under their own paths, once, as fast as possible",
                      "leave out --rename, --test, --ignore, --speed and --loop");
    std::vector<std::string> words{program.front(), "replay", options.what.file};
    for (const auto& one : options.what.only) words.insert(words.end(), {"--only", one});
    words.insert(words.end(), program.begin() + 1, program.end());
    std::vector<char*> raw;
    for (auto& one : words) raw.push_back(one.data());
    raw.push_back(nullptr);
    ::execvp(raw.front(), raw.data());
    throw problem(exit_code::failed, "program",
                  fmt::format("cannot run {}: {}", printable(program.front()), std::strerror(errno)),
                  "name a program that has the command `replay`, such as atirma");
}

void declare_play(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<play_options>();
    auto& what = given->what;
    app.add_option("FILE", what.file, "a recording")->required();
    add_each(app, "--only", what.only, "this component or topic, or those below it; may be given several times",
             "TOPIC");
    add_each(app, "--rename", given->renamed, "plays a component, or those below a path, under another", "PATH=PATH");
    add_each(app, "--test", what.tested,
             "a component that runs: recorded calls to it are made, and what it does is compared", "PATH");
    add_each(app, "--ignore", what.ignored,
             "a field that is not compared, or all of a service as 'state/*'; may be given several times", "FIELD");
    app.add_option("--speed", what.speed, "2: twice as fast (default: 1)")->type_name("FACTOR");
    app.add_flag("--loop", what.loop, "begin again at the end");
    app.add_option("--into", given->into,
                   "live: the running system; sim: components on the virtual clock, by `PROGRAM replay FILE ...`: the "
                   "program and its words follow (default: live)")
        ->check(command_line::is_member({"live", "sim"}));
    auto program = std::make_shared<std::vector<std::string>>();
    app.add_option("PROGRAM", *program, "with --into sim: the program that has the components, and its words after --")
        ->type_name("");
    app.callback([&made, given, program] {
        auto rest = *program;
        if (given->into == "sim") replay_with(*given, std::move(rest));
        if (!rest.empty())
            throw problem(exit_code::usage, "usage", fmt::format("'{}' is not expected", printable(rest.front())),
                          "a program follows --into sim only");
        if (!(given->what.speed > 0 && given->what.speed <= 1e9))
            throw problem(exit_code::usage, "usage", "--speed: a number above 0, such as 0.5 or 10");
        for (const auto& one : given->renamed) {
            auto [from, to] = name_and_value(one, "--rename");
            check_name(from);
            check_name(to);
            given->what.as[from] = to;
        }
        made.endless = true;
        made.work = [given](context& in) { return play(in, *given); };
    });
}

} // namespace

extern const command play_command{
    "play", record_group, "plays a recording into the running system, or into components on the virtual clock",
    "  ise play voyage.mcap\n"
    "  ise play voyage.mcap --only atirma/boat --rename atirma/boat=replay/boat --speed 10\n"
    "  ise play voyage.mcap --test atirma/navigator\n"
    "  ise play voyage.mcap --into sim -- atirma communication-node --path atirma/shore/node-1 --file memory:node\n",
    declare_play};

} // namespace ise::cli
