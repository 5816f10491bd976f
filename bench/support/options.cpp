#include "options.hpp"

#include <charconv>
#include <stdexcept>
#include <string_view>

namespace bench {
namespace {

std::size_t to_count(std::string_view name, std::string_view text, std::size_t most, std::size_t least = 1) {
    std::size_t value = 0;
    const auto [end, wrong] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (wrong != std::errc{} || end != text.data() + text.size() || value < least || value > most) {
        throw std::invalid_argument(std::string(name) + " takes a number from " + std::to_string(least) + " to " +
                                    std::to_string(most) + ", not " + std::string(text));
    }
    return value;
}

double to_seconds(std::string_view name, std::string_view text) {
    double value = 0;
    const auto [end, wrong] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (wrong != std::errc{} || end != text.data() + text.size() || !(value >= 0 && value <= 3600)) {
        throw std::invalid_argument(std::string(name) + " takes seconds from 0 to 3600, not " + std::string(text));
    }
    return value;
}

void check_one_of(std::string_view name, std::string_view value, std::initializer_list<std::string_view> known) {
    for (auto one : known) {
        if (one == value) return;
    }
    throw std::invalid_argument("unknown " + std::string(name) + ": " + std::string(value));
}

} // namespace

options parse_options(int argc, char** argv) {
    options out;
    int at = 1;
    if (at < argc && std::string_view(argv[at]) == "serve") {
        out.serve = true;
        ++at;
    }
    if (at == argc) throw std::invalid_argument("say what to do");
    out.work = argv[at++];
    check_one_of("work", out.work, {"call", "publish", "paced", "idle", "names"});
    for (; at < argc; at += 2) {
        const std::string_view name = argv[at];
        if (at + 1 == argc) throw std::invalid_argument(std::string(name) + " needs a value");
        const std::string_view value = argv[at + 1];
        if (name == "--kind") out.kind = value;
        else if (name == "--transport") out.transport = value;
        else if (name == "--connect") out.connect = value;
        else if (name == "--size") out.size_bytes = to_count(name, value, std::size_t{1} << 26);
        else if (name == "--outstanding") out.outstanding = to_count(name, value, 1'000'000);
        else if (name == "--subscribers") out.subscribers = to_count(name, value, 1024);
        else if (name == "--services") out.services = to_count(name, value, 10'000);
        else if (name == "--first") out.first = to_count(name, value, 1'000'000, 0);
        else if (name == "--seconds") out.seconds = to_seconds(name, value);
        else if (name == "--warmup") out.warmup_seconds = to_seconds(name, value);
        else throw std::invalid_argument("unknown option: " + std::string(name));
    }
    check_one_of("transport", out.transport, {"tcp", "local", "shm", "udp", "inproc", "oneloop"});
    if (out.serve && in_process(out)) throw std::invalid_argument("in process there is nothing to serve");
    const bool connects = out.work == "names" || !out.serve; // also the nodes, to the name server
    if (connects && !in_process(out) && out.connect.empty()) throw std::invalid_argument("--connect is missing");
    if (out.size_bytes < 8) throw std::invalid_argument("--size: at least 8 bytes, for a time stamp");
    return out;
}

const char* usage() noexcept {
    return "usage: PROGRAM serve WORK [options]              prints its address, ends when its standard input ends\n"
           "       PROGRAM WORK --connect ADDRESS [options]  measures, prints one line of JSON\n"
           "WORK: call, publish, paced; bench_ise: idle, names\n"
           "  --kind raw|asio|...            --transport tcp|local|shm|udp|inproc|oneloop\n"
           "  --size BYTES                   --outstanding N   --subscribers N   --services N\n"
           "  --first N (of names)           --seconds S       --warmup S\n"
           "See bench/README.md.\n";
}

} // namespace bench
