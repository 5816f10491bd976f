// ise record: records a running system into MCAP files.
#include "json.hpp"
#include "options.hpp"
#include "target.hpp"
#include "text.hpp"

#include <ise/bag/recorder.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/time_text.hpp>
#include <ise/naming/services.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

namespace ise::cli {
namespace {

struct record_options {
    bag::recorder_options what;
    std::string packing = "zstd";
    bool lossless = false;
    bool no_calls = false;
    bool no_parameters = false;
    std::optional<duration> length;
};

struct record_answer {
    std::vector<std::string> files;
    std::uint64_t messages = 0, bytes = 0, services = 0, lost = 0, gaps = 0, triggered = 0;
};

std::string as_text(const record_answer& of) {
    auto text = fmt::format("recorded {} message{} of {} service{} ({})", of.messages, of.messages == 1 ? "" : "s",
                            of.services, of.services == 1 ? "" : "s", show_bytes(of.bytes));
    for (const auto& one : of.files) text += "\n  " + printable(one);
    if (of.gaps > 0) text += fmt::format("\n{} gap{}: ise bag info shows them", of.gaps, of.gaps == 1 ? "" : "s");
    if (of.lost > 0) text += fmt::format("\n{} packets were not recorded, and are counted in the file", of.lost);
    return text + "\n";
}

// A name may be mistyped, or its component comes later.
task<> note_absent(context& in, const std::vector<std::string>& paths) {
    auto listed = co_await listed_names(in, ""); // also whether there is a name server
    std::vector<std::string> known;
    for (const auto& one : listed) known.push_back(one.path);
    for (const auto& path : paths)
        if (std::ranges::none_of(known, [&](const auto& one) { return naming::lies_below(one, path); }))
            note_nothing(in, path, known);
}

// The messages before the failure are in the file.
problem of_file(const failure& why, const bag::recorder_counts& counts) {
    if (counts.messages == 0 || counts.files.empty()) return problem(why);
    return problem(why, fmt::format("{} messages came before: make room; ise bag recover {} --out FILE makes a whole "
                                    "recording of them",
                                    counts.messages, counts.files.back()));
}

task<> record(context& in, record_options options) {
    auto& what = options.what;
    co_await note_absent(in, what.paths);
    what.name_servers = name_servers_of(in.set, in.self.env());
    what.files.format.library = "ise " ISE_VERSION;
    what.files.about["host"] = in.self.env().identity().host_name;
    what.files.about["started_at"] = iso_8601(in.self.wall());
    bag::recorder_core core(in.self, what);
    in.ctrl_c.care(in.self.on(), [&core] { core.finish(); });
    timer end(in.self.on(), [&core] { core.finish(); });
    if (options.length) end.arm(saturating_add(in.self.now(), *options.length));
    note(in.set, what.ring > duration{} ? fmt::format("keeping the last {} until something happens; Ctrl-C ends it",
                                                      show_duration(what.ring))
                                        : fmt::format("recording to {}; Ctrl-C ends it", printable(what.files.file)));
    std::optional<problem> broken;
    try {
        co_await core.run();
    } catch (const error& why) {
        broken = of_file(why.why(), core.counts());
    }
    if (broken) throw problem(std::move(*broken));
    in.ctrl_c.leave();
    const auto& counts = core.counts();
    record_answer answer;
    answer.files = counts.files;
    answer.messages = counts.messages;
    answer.bytes = counts.bytes;
    answer.services = counts.topics;
    answer.lost = counts.lost;
    answer.gaps = counts.gaps;
    answer.triggered = counts.triggered;
    auto text = in.set.json ? json_line(answer) : as_text(answer);
    co_await in.out.write(in.self, std::move(text));
}

void declare_record(command_line::app& app, parsed_command& made) {
    auto given = std::make_shared<record_options>();
    auto& what = given->what;
    app.add_option("PATH", what.paths, "components, each with those below it (default: all)");
    app.add_option("-o,--out", what.files.file, "the file; with splitting or a ring it gets numbers: FILE_0001.mcap")
        ->required()
        ->type_name("FILE");
    add_each(app, "--only", what.services, "this service; may be given several times", "SERVICE");
    add_each(app, "--except", what.except, "not this service; may be given several times", "SERVICE");
    app.add_flag("--no-calls", given->no_calls, "without the calls of components that show them (ISE_RECORD_CALLS=1)");
    app.add_flag("--no-parameters", given->no_parameters, "without the parameters of components");
    app.add_flag("--own", what.own_services, "ISE's own services too");
    app.add_flag("--lossless", given->lossless,
                 "every packet, with flow control; a subscription that falls too far behind ends");
    app.add_option("--depth", what.depth, "packets queued at either end, 1 to 65536 (default: 1024)")
        ->check(command_line::range(1u, 65536u))
        ->type_name("N");
    app.add_option("--compression", given->packing, "of the file: zstd, lz4 or none (default: zstd)")
        ->check(one_of({"zstd", "lz4", "none"}))
        ->type_name("KIND");
    app.add_option("--split-size", what.files.split_bytes, "a new file after so many bytes, such as 500MB")
        ->as_size()
        ->type_name("SIZE");
    add_time(app, "--split-time", what.files.split_time, "a new file after this time");
    add_time(app, "--ring", what.ring, "keep only this time, in memory, until a trigger; then write it");
    add_each(app, "--trigger", what.triggers,
             "COMPONENT/SERVICE: a packet or a call of it; gone:PATH: a name that goes; may be given several times",
             "WHAT");
    add_time(app, "--after", what.after, "recorded after a trigger (default: 10s)");
    add_time(app, "--for", given->length, "end after this time");
    add_each(
        app, "--attach", what.files.attached,
        "a file that is attached to each recording, such as the deployment file or a log; may be given several times",
        "FILE");
    app.callback([&made, given] {
        auto& settings = given->what;
        for (const auto& path : settings.paths) check_prefix(path);
        if (settings.ring > duration{} && settings.triggers.empty())
            throw problem(exit_code::usage, "usage", "--ring requires a --trigger",
                          "or start the component type recorder, whose service 'trigger' writes its ring");
        if (settings.ring == duration{} && !settings.triggers.empty())
            throw problem(exit_code::usage, "usage", "--trigger requires --ring: the time that is kept until then");
        if (given->lossless) settings.policy = overflow::lossless;
        settings.calls = !given->no_calls;
        settings.parameters = !given->no_parameters;
        settings.files.format.packing = given->packing == "zstd"  ? bag::compression::zstd
                                        : given->packing == "lz4" ? bag::compression::lz4
                                                                  : bag::compression::none;
        made.endless = true;
        made.looks = true;
        made.work = [given](context& in) { return record(in, *given); };
    });
}

} // namespace

extern const command record_command{"record", record_group, "records packets, calls and names of a running system",
                                    "  ise record --out voyage.mcap\n"
                                    "  ise record atirma/boat --out boat.mcap --split-size 500MB\n"
                                    "  ise record --out incident.mcap --ring 5min --trigger gone:atirma/boat\n",
                                    declare_record};

} // namespace ise::cli
