// How fast hours of A-Tirma are replayed: a voyage with all its troubles is recorded, and then replayed twice into its
// communication nodes.
#include <apps/stress/replaying.hpp>
#include <apps/stress/voyage.hpp>

#include <fmt/format.h>

#include <chrono>
#include <cstdlib>
#include <ctime>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <string>

namespace {

double processor_s() { return static_cast<double>(std::clock()) / CLOCKS_PER_SEC; }

std::string whole_file(const std::string& path) {
    std::ifstream in(path, std::ios::binary);
    return std::string(std::istreambuf_iterator<char>(in), {});
}

void run(double hours, std::uint64_t seed, const std::string& folder) {
    auto name = folder + "/voyage.mcap";
    auto began = processor_s();
    {
        atirma::stress::voyage_options options;
        options.seed = seed;
        options.length = std::chrono::minutes(static_cast<long>(hours * 60 + 0.5));
        options.record = name;
        atirma::stress::voyage sea(std::move(options));
        sea.sail();
    }
    fmt::print("recorded: {:.1f} h, {:.1f} MB, in {:.1f} s of processor time with the simulation\n", hours,
               static_cast<double>(std::filesystem::file_size(name)) / 1e6, processor_s() - began);
    std::string first;
    std::uint64_t hash = 0;
    for (int round = 1; round <= 2; ++round) {
        auto out = fmt::format("{}/replay-{}.mcap", folder, round);
        began = processor_s();
        const auto real = std::chrono::steady_clock::now();
        auto report = atirma::stress::replay_nodes(name, out);
        const std::chrono::duration<double> took = std::chrono::steady_clock::now() - real;
        const auto& counts = report.counts;
        fmt::print("replay {}: {:.1f} s, {:.1f} s of processor time; {} packets and {} calls came, {} calls answered, "
                   "{} refused, {} compared\n",
                   round, took.count(), processor_s() - began, counts.packets, counts.called, counts.answered,
                   counts.unknown, counts.compared);
        if (report.first_difference) fmt::print("  first difference: {}\n", report.first_difference->text());
        auto now = whole_file(out);
        if (round == 1) {
            first = std::move(now);
            hash = report.hash;
            continue;
        }
        fmt::print("the recordings of both replays: {}; their events: {}\n", now == first ? "the same" : "DIFFERENT",
                   hash == report.hash ? "the same" : "DIFFERENT");
    }
}

} // namespace

int main(int count, char** words) {
    try {
        std::string folder = (std::filesystem::temp_directory_path() / "ise_bench_replay_XXXXXX").string();
        if (!::mkdtemp(folder.data())) return 1;
        run(count > 1 ? std::stod(words[1]) : 10, count > 2 ? std::stoul(words[2]) : 7, folder);
        std::filesystem::remove_all(folder);
    } catch (const std::exception& why) {
        fmt::print(stderr, "bench_replay: {}\n", why.what());
        return 1;
    }
    return 0;
}
