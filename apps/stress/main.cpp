// Ten hours at sea on the virtual clock, and the report about them.
#include "heap_counter.hpp"
#include "report.hpp"
#include "voyage.hpp"

#include <apps/command_line.hpp>
#include <apps/progress_line.hpp>
#include <components/gui_client/console_state.hpp>

#include <ise/core/complain.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>
#include <cstdio>
#include <ctime>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string_view>
#include <utility>
#include <vector>

#include <unistd.h>

namespace {

namespace stress = atirma::stress;

void complain(std::string_view what) { ise::complain("atirma_stress", what); }

std::string read(const std::string& file) {
    std::ifstream in(file, std::ios::binary);
    if (!in) throw std::runtime_error(fmt::format("cannot read the wind file {}", file));
    return {std::istreambuf_iterator<char>(in), {}};
}

double processor_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

long resident_kib() {
    long whole = 0, resident = 0;
    if (auto* status = std::fopen("/proc/self/statm", "r")) {
        if (std::fscanf(status, "%ld %ld", &whole, &resident) != 2) resident = 0;
        std::fclose(status);
    }
    return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

long open_descriptors() {
    std::error_code none;
    auto begin = std::filesystem::directory_iterator("/proc/self/fd", none);
    return none ? 0 : static_cast<long>(std::distance(begin, std::filesystem::directory_iterator()));
}

/// What only this machine knows: machine.md.
class costs {
public:
    void take(const stress::sample& when, std::size_t tracks, double spent_s) {
        auto heap = stress::heap_now();
        auto blocks = static_cast<std::size_t>(std::max<std::int64_t>(0, heap.blocks));
        auto kib = static_cast<std::size_t>(std::max<std::int64_t>(0, heap.bytes - std::int64_t(tracks))) / 1024;
        auto descriptors = static_cast<std::size_t>(open_descriptors());
        if (when.settled()) {
            blocks_.emplace_back(when.at, blocks);
            kib_.emplace_back(when.at, kib);
            descriptors_.emplace_back(when.at, descriptors);
        }
        max_tracks_kib_ = std::max(max_tracks_kib_, tracks / 1024);
        rows_ += fmt::format("| {} | {:.2f} | {} | {} | {} | {} | {} |\n", stress::clock_text(when.at), spent_s, blocks,
                             kib, tracks / 1024, resident_kib(), descriptors);
    }
    std::string text(double sailing_s) const {
        return fmt::format(
            "# Resources of this run\nNot part of the report: they differ between machines. The heap is "
            "without the "
            "ledger and the text of events.log, which keep everything; resident memory includes them and the "
            "virtual disks.\n\n- heap blocks: "
            "{}\n- heap KiB, without the consoles' tracks: {}\n- consoles' tracks: {} KiB at most, of {} KiB that two "
            "full "
            "full ones need: they grow until they are full\n- descriptors: {}\n\n{} Samples count as in the report. "
            "Two "
            "structures grow to a bound after each start of their component: 17 telemetry filters, 128 KiB each, in "
            "about nine hours; and the remembered telecommands, 512 in each book and 300 at each "
            "console.\n\n| virtual | processor s | heap blocks | heap "
            "KiB | tracks KiB | resident KiB | descriptors |\n|---|---:|---:|---:|---:|---:|---:|\n{}\nThe sailing "
            "took {:.1f} s "
            "of one processor, {} allocations.\n",
            change(blocks_), change(kib_), max_tracks_kib_, full_tracks_kib(), change(descriptors_),
            stress::meaning_of_flat(), rows_, sailing_s, stress::heap_now().allocations);
    }

private:
    using series = std::vector<std::pair<ise::duration, std::size_t>>;
    static std::string change(const series& all) { return stress::say(stress::trend_of(all)); }
    /// As `track_store::bytes` says.
    static std::size_t full_tracks_kib() {
        return stress::operators * 3 * atirma::console::state_options().max_track *
               sizeof(atirma::console::track_point) / 1024;
    }
    std::size_t max_tracks_kib_ = 0;
    series blocks_, kib_, descriptors_;
    std::string rows_;
};

} // namespace

int main(int argc, char** argv) {
    command_line::app app(
        "Runs the whole of A-Tirma at sea for some hours on the virtual clock, with faults by the seed, and writes a "
        "report that proves that nothing the shore had acknowledged was lost.",
        "atirma_stress");
    std::uint64_t seed = 1;
    double hours = 10;
    std::string out, wind, record;
    app.add_option("--seed", seed, "random seed; the same seed gives the same report")->capture_default_str();
    app.add_option("--hours", hours, "virtual hours")->check(command_line::range(0.25, 100.0))->capture_default_str();
    app.add_option(
           "--out", out,
           "folder for report.md, track.svg, track.gpx, events.log, and machine.md with the resources of this machine")
        ->required();
    app.add_option("--wind", wind, "recorded wind as CSV (t_s, tws_kn or tws_mps, twd_deg); default: by the seed")
        ->check(command_line::existing_file());
    app.add_option("--record", record, "a recording (MCAP) of the packets and calls of the voyage, for a replay");
    try {
        app.parse(argc, argv);
    } catch (const command_line::parse_error& why) {
        return app.exit(why);
    }
    try {
        std::filesystem::create_directories(out);
        const std::filesystem::path folder(out);
        const double began_s = processor_s();
        costs machine;
        stress::voyage_options options;
        options.seed = seed;
        options.length = std::chrono::minutes(static_cast<long>(hours * 60 + 0.5));
        options.record = record;
        if (!wind.empty()) {
            options.wind_csv = read(wind);
            atirma::simulator::parse_wind_csv(options.wind_csv, wind).value(); // what is wrong is said here
        }
        options.on_sample = [&](const stress::sample& when, std::size_t tracks) {
            machine.take(when, tracks, processor_s() - began_s);
        };
        progress_line progress;
        options.on_progress = [&](double part) {
            progress.show(part, part < 1 ? fmt::format("seed {} at sea: {} of {}", seed,
                                                       stress::length_text(std::chrono::duration_cast<ise::duration>(
                                                           options.length * part)),
                                                       stress::length_text(options.length))
                                         : std::string("waiting for what was owed at the end"));
        };
        auto sailing = options;
        stress::voyage sea(std::move(sailing));
        sea.sail();
        const double sailing_s = processor_s() - began_s;
        progress.show(1, "judging, and writing the report");
        auto proof = sea.judge();
        const auto result = sea.story();
        stress::findings found(result);
        stress::write_file(folder / "report.md", stress::make_report(result, found, proof));
        stress::write_file(folder / "track.svg", stress::make_picture(result, found));
        stress::write_file(folder / "track.gpx", stress::make_gpx(found));
        stress::write_file(folder / "events.log", sea.log());
        stress::write_file(folder / "machine.md", machine.text(sailing_s));
        bool good = stress::holds(result, proof);
        progress.clear();
        fmt::print("{}: {} ({:.1f} s of processor time); {}\n", stress::voyage_text(result.plan.length),
                   good ? "the proof holds" : "THE PROOF DOES NOT HOLD", processor_s() - began_s,
                   (folder / "report.md").string());
        return good ? 0 : 1;
    } catch (const std::exception& why) {
        complain(why.what());
        return 2;
    }
}
