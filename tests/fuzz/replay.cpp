// Runs a fuzz target without libFuzzer: over every seed, over every prefix of it, and over mutations drawn from
// a fixed seed. What libFuzzer found once stays in the corpus, so this is its regression test.
#include <algorithm>
#include <cstdint>
#include <cstdio>
#include <exception>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <random>
#include <vector>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size);

namespace {

using input = std::vector<std::uint8_t>;

void run(const input& bytes) {
    // Exactly as large as the input, so that a sanitizer sees a read past its end.
    const input exact(bytes.begin(), bytes.end());
    LLVMFuzzerTestOneInput(exact.data(), exact.size());
}

input mutated(input bytes, std::mt19937& random) {
    const auto edits = 1 + random() % 4;
    for (std::size_t i = 0; i != edits; ++i) {
        const auto at = bytes.empty() ? 0 : random() % bytes.size();
        const auto position = bytes.begin() + static_cast<std::ptrdiff_t>(at);
        switch (random() % 5) {
            case 0:
                if (!bytes.empty()) *position ^= static_cast<std::uint8_t>(1U << random() % 8);
                break;
            case 1:
                if (!bytes.empty()) *position = random() % 2 != 0 ? 0xff : 0x00;
                break;
            case 2: bytes.insert(position, static_cast<std::uint8_t>(random())); break;
            case 3:
                if (!bytes.empty()) bytes.erase(position);
                break;
            default: {
                const input tail(position, bytes.end());
                bytes.insert(bytes.end(), tail.begin(), tail.end());
            }
        }
        if (bytes.size() > 1U << 16) bytes.resize(1U << 16);
    }
    return bytes;
}

} // namespace

int main(int argc, char** argv) {
    if (argc != 2) {
        std::fprintf(stderr, "usage: %s FOLDER_OF_SEEDS\n", argv[0]);
        return 2;
    }
    try {
        std::vector<std::filesystem::path> seeds;
        for (const auto& entry : std::filesystem::directory_iterator(argv[1])) {
            if (entry.is_regular_file()) seeds.push_back(entry.path());
        }
        std::sort(seeds.begin(), seeds.end()); // the same order everywhere
        if (seeds.empty()) {
            std::fprintf(stderr, "no seed in %s\n", argv[1]);
            return 1;
        }
        std::mt19937 random(1);
        for (const auto& path : seeds) {
            std::ifstream file(path, std::ios::binary);
            const input seed{std::istreambuf_iterator<char>(file), std::istreambuf_iterator<char>()};
            std::printf("%s\n", path.c_str());
            std::fflush(stdout); // known even when the target aborts
            run(seed);
            for (std::size_t cut = 0; cut < std::min<std::size_t>(seed.size(), 512); ++cut) {
                run(input(seed.begin(), seed.begin() + static_cast<std::ptrdiff_t>(cut)));
            }
            for (int i = 0; i != 2000; ++i) run(mutated(seed, random));
        }
        return 0;
    } catch (const std::exception& failure) {
        std::fprintf(stderr, "an exception escaped the target: %s\n", failure.what());
        return 1;
    }
}
