#pragma once
#include <cstddef>
#include <string>

namespace bench {

/// What a benchmark program was asked to do; bench/README.md describes the command line.
struct options {
    bool serve = false;       ///< the other side: prints its address, ends when standard input ends
    std::string work;         ///< call, publish, paced, idle, names
    std::string kind = "raw"; ///< raw, asio; a program may know others
    std::string transport =
        "tcp";           ///< tcp, local, udp; inproc: two threads of one process; oneloop: one thread, one loop
    std::string connect; ///< what the serving side printed
    std::size_t size_bytes = 64;
    std::size_t outstanding = 1;
    std::size_t subscribers = 1;
    std::size_t services = 1; ///< of the serving component; calls go to each in turn
    std::size_t first = 0;    ///< names: the number of the first
    double seconds = 1;
    double warmup_seconds = 0.2;
};

/// Throws std::invalid_argument with a text for the user.
options parse_options(int argc, char** argv);

/// Whether one process does both sides.
inline bool in_process(const options& asked) { return asked.transport == "inproc" || asked.transport == "oneloop"; }

const char* usage() noexcept;

} // namespace bench
