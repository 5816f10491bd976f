#include "peer.hpp"

#include <algorithm>
#include <cstdio>
#include <exception>
#include <stdexcept>

namespace bench {

int peer_main(int argc, char** argv, const char* name, const std::function<void(const options&)>& serve,
              const std::function<outcome(const options&)>& measure) {
    try {
        const auto asked = parse_options(argc, argv);
        if (asked.work == "idle" || asked.work == "names") throw std::invalid_argument("that is measured of ISE only");
        if (asked.serve) {
            end_with_standard_input();
            serve(asked);
        } else {
            print(asked, measure(asked));
        }
        std::fflush(stdout);
        std::_Exit(0); // measured: how long their threads take to end is not asked
    } catch (const std::invalid_argument& wrong) {
        std::fprintf(stderr, "bench_%s: %s\n%s", name, wrong.what(), usage());
        return 2;
    } catch (const std::exception& failed) {
        std::fprintf(stderr, "bench_%s: %s\n", name, failed.what());
        std::fflush(stderr);
        std::_Exit(1);
    }
}

void expect(const options& asked, const char* name, std::initializer_list<const char*> transports) {
    if (asked.kind != name && asked.kind != "raw") throw std::invalid_argument("the only kind is " + std::string(name));
    if (std::none_of(transports.begin(), transports.end(), [&](const char* one) { return asked.transport == one; }))
        throw std::invalid_argument(std::string(name) + " is not measured over " + asked.transport);
}

} // namespace bench
