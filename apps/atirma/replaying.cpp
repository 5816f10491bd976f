#include "replaying.hpp"

#include <apps/progress_line.hpp>

#include <ise/core/endpoint.hpp>
#include <ise/replay/replay_world.hpp>

#include <fmt/format.h>

#include <chrono>
#include <utility>

namespace atirma {

bool replay(const replay_request& what, const std::vector<hosted>& components,
            const std::function<void(const std::string&)>& print) {
    ise::replay_options options;
    options.ignored = what.ignored;
    options.only = what.only;
    options.out = what.out;
    options.log = ise::log_to_stderr(what.level);
    for (const auto& one : components) {
        ise::replayed_component made;
        made.path = one.path;
        made.make = one.make;
        for (const auto& text : one.listen) made.options.listen.push_back(ise::endpoint::parse(text).value());
        for (const auto& text : one.roles) made.options.roles.insert(ise::parse_role(text).value());
        made.options.parameters = one.parameters;
        options.components.push_back(std::move(made));
    }
    progress_line progress;
    options.on_progress = [&](double part) { progress.show(part, "replaying " + what.file); };
    ise::replay_world world;
    auto report = world.play(what.file, options);
    progress.clear();
    const auto& counts = report.counts;
    print(fmt::format("replayed {:.1f} s: {} packets and {} calls came, {} calls were answered, {} refused, {} packets "
                      "and answers compared",
                      std::chrono::duration<double>(report.length).count(), counts.packets, counts.called,
                      counts.answered, counts.unknown, counts.compared));
    if (report.first_difference) print("first difference: " + report.first_difference->text());
    else print("no difference");
    return !report.first_difference;
}

} // namespace atirma
