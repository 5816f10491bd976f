#include "../signals.hpp"

#include <csignal>

namespace ise::cli {
namespace {

// A terminal was closed. Under nohup that is nothing.
bool hangup_ends() {
    struct sigaction now {};
    return ::sigaction(SIGHUP, nullptr, &now) == 0 && now.sa_handler != SIG_IGN;
}

} // namespace

std::vector<int> ending_signals() {
    std::vector<int> all{SIGINT, SIGTERM};
    if (hangup_ends()) all.push_back(SIGHUP);
    return all;
}

} // namespace ise::cli
