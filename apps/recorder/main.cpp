// ise_recorder: the component type `recorder`, for deployments.
#include <ise/bag/compression.hpp>
#include <ise/bag/recorder.hpp>
#include <ise/component/component_type.hpp>

#include <chrono>
#include <cstdint>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

struct words {
    double split_minutes = 0;
    double ring_minutes = 0;
    double after_seconds = 10;
    bool lossless = false;
};

ise::duration seconds(double count) {
    return std::chrono::duration_cast<ise::duration>(std::chrono::duration<double>(count));
}

ise::component_type recorder_type() {
    ise::component_type type("recorder", "records packets, calls and names into MCAP files", "ise/recorder");
    auto options = std::make_shared<ise::bag::recorder_options>();
    auto given = std::make_shared<words>();
    options->files.file = "recording.mcap";
    options->files.numbered = true; // it may be restarted
    options->files.format.library = "ise " ISE_VERSION;
    auto& set = type.parameters;
    set.add("file", options->files.file,
            "recording.mcap: files recording_0001.mcap and so on; those that exist are kept")
        .kind(ise::parameter_kind::path);
    set.add("record", options->paths, "components, each with those below it; none: all");
    set.add("only", options->services, "only these services");
    set.add("except", options->except, "services that are left out");
    set.add("calls", options->calls, "the calls of components with ISE_RECORD_CALLS=1");
    set.add("lossless", given->lossless, "every packet, with flow control; else the last ones of each service");
    set.add("split-bytes", options->files.split_bytes, "a new file after so many; 0: none");
    set.add("split-minutes", given->split_minutes, "a new file after this time; 0: none").range(0, 525600);
    set.add("ring-minutes", given->ring_minutes,
            "keep only this time, in memory, until a trigger; 0: record all the time")
        .range(0, 1440);
    set.add("after-seconds", given->after_seconds, "recorded after a trigger").range(0, 86400);
    set.add("attach", options->files.attached, "files that are attached to each recording, such as deployment and logs")
        .kind(ise::parameter_kind::path);
    set.add("trigger", options->triggers, "COMPONENT/SERVICE: a packet or a call of it; gone:PATH: a name that goes");
    type.provides(ise::bag::trigger_service).provides(ise::bag::recorder_status_service);
    type.make = [options, given] {
        auto made = *options;
        made.files.split_time = seconds(given->split_minutes * 60);
        made.ring = seconds(given->ring_minutes * 60);
        made.after = seconds(given->after_seconds);
        if (given->lossless) made.policy = ise::overflow::lossless;
        return std::make_unique<ise::bag::recorder>(std::move(made));
    };
    return type;
}

} // namespace

int main(int count, char** arguments) {
    std::vector<ise::component_type> types;
    types.push_back(recorder_type());
    return ise::main(count, arguments, std::move(types), ISE_VERSION);
}
