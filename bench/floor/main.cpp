#include "floors.hpp"

#include <cstdio>
#include <exception>
#include <stdexcept>

namespace {

using namespace bench;

void check_offered(const options& asked) {
    if (asked.transport == "inproc")
        throw std::invalid_argument("between threads the floor is a local socket: --transport local");
    if (asked.transport == "shm")
        throw std::invalid_argument("the floor of shared memory is a local socket: --transport local");
    if (asked.work == "idle" || asked.work == "names") throw std::invalid_argument("there is no floor for that");
    if (asked.transport == "udp" && (asked.work != "call" || asked.outstanding != 1 || asked.kind != "raw"))
        throw std::invalid_argument("over udp there is a floor for one outstanding call, of kind raw");
}

void serve(const options& asked) {
    end_with_standard_input();
    if (asked.kind == "asio" && asked.work == "call") serve_asio_call(asked);
    else if (asked.kind != "raw") throw std::invalid_argument("there is no floor of that kind for this work");
    else if (asked.work == "call") serve_raw_call(asked);
    else if (asked.work == "publish") serve_raw_publish(asked);
    else serve_raw_paced(asked);
}

outcome measure(const options& asked) {
    if (asked.transport == "oneloop") {
        if (asked.kind != "asio" || asked.work != "call")
            throw std::invalid_argument("on one loop the floor is a call of kind asio: a post and its resumption");
        return asio_post(asked);
    }
    if (asked.kind == "asio" && asked.work == "call" && asked.outstanding == 1) return asio_call(asked);
    if (asked.kind != "raw") throw std::invalid_argument("there is no floor of that kind for this work");
    if (asked.work == "call") return raw_call(asked);
    return asked.work == "publish" ? raw_publish(asked) : raw_paced(asked);
}

} // namespace

int main(int argc, char** argv) {
    try {
        const auto asked = parse_options(argc, argv);
        check_offered(asked);
        if (asked.serve) serve(asked);
        else print(asked, measure(asked));
        return 0;
    } catch (const std::invalid_argument& wrong) {
        std::fprintf(stderr, "bench_floor: %s\n%s", wrong.what(), usage());
        return 2;
    } catch (const std::exception& failed) {
        std::fprintf(stderr, "bench_floor: %s\n", failed.what());
        return 1;
    }
}
