// The same work as bench_floor, on ISE and through its public interface only.
#include "collector.hpp"
#include "programs.hpp"

#include <ise/service/service_host.hpp>

#include <sys/resource.h>
#include <unistd.h>

#include <cstdio>
#include <exception>
#include <stdexcept>

namespace bench {

bool in_a_hurry(const options& asked) { return asked.kind == "ise-fast"; }

ise::node_options node_options() {
    ise::node_options made;
    made.services.session_bytes = std::size_t{256} << 20; // of the biggest packets, one
    made.services.max_calls_per_session = 1u << 20;       // all that a measurement may have pending
    made.name = "bench";
    made.use_names = false;
    made.services.linger = std::chrono::milliseconds(200); // a measuring side that was killed is soon forgotten
    made.log = ise::log_to_stderr(ise::log_level::warning);
    return made;
}

ise::component_options asking(std::string together_with) {
    ise::component_options made;
    made.listens = false;
    made.registers = false;
    made.together_with = std::move(together_with);
    return made;
}

span span::after_warm_up(const options& asked) {
    span made;
    made.begin_ns = now_ns() + static_cast<std::int64_t>(asked.warmup_seconds * 1e9);
    made.end_ns = made.begin_ns + static_cast<std::int64_t>(asked.seconds * 1e9);
    return made;
}

namespace {

bool dynamic(const options& asked) { return asked.kind == "ise-dynamic"; }

ise::endpoint listen_at(const std::string& transport) {
    auto unique = std::to_string(::getpid());
    if (transport == "tcp") return ise::endpoint::parse("tcp://127.0.0.1:0").value();
    if (transport == "udp") return ise::endpoint::parse("udp://127.0.0.1:0").value();
    if (transport == "local") return ise::endpoint::parse("local://@ise-bench-" + unique).value();
    if (transport == "shm") return ise::endpoint::parse("shm://@ise-bench-" + unique).value();
    return ise::endpoint::parse("inproc://bench-" + unique).value();
}

ise::endpoint start_server(ise::node& node, const options& asked) {
    auto made = dynamic(asked)            ? make_dynamic_server(asked)
                : asked.work == "call"    ? make_call_server(asked)
                : asked.work == "publish" ? make_publisher(asked)
                : asked.work == "paced"   ? make_pacer(asked)
                                          : make_memory_teller();
    ise::component_options how;
    how.listen = {listen_at(asked.transport)};
    how.registers = false;
    return node.launch("bench/server", std::move(made), std::move(how)).services().listening().front();
}

ise::node_options node_options_for(const options& asked) {
    auto made = node_options();
    if (asked.kind == "ise-poll") made.poll = std::chrono::microseconds(50);
    return made;
}

// Ten thousand connections need as many descriptors.
void allow_descriptors() {
    rlimit most{};
    if (::getrlimit(RLIMIT_NOFILE, &most) != 0) return;
    most.rlim_cur = most.rlim_max;
    ::setrlimit(RLIMIT_NOFILE, &most);
}

void serve(const options& asked) {
    ise::real_environment env;
    ise::node node(env, node_options_for(asked));
    const auto where = start_server(node, asked);
    end_with_standard_input();
    announce(where.text());
    node.wait();
}

outcome measure(const options& asked) {
    collector found;
    ise::real_environment env;
    ise::node node(env, node_options_for(asked));
    const auto server = in_process(asked) ? start_server(node, asked) : ise::endpoint::parse(asked.connect).value();
    if (dynamic(asked)) start_dynamic_caller(node, asked, server, found);
    else if (asked.work == "call") start_callers(node, asked, server, found);
    else if (asked.work == "publish") start_subscribers(node, asked, server, found);
    else if (asked.work == "idle") start_idlers(node, asked, server, found);
    else start_listener_of_pacer(node, asked, server, found);
    auto out = found.get();
    node.stop();
    node.wait();
    return out;
}

} // namespace
} // namespace bench

int main(int argc, char** argv) {
    try {
        auto asked = bench::parse_options(argc, argv);
        if (asked.kind != "ise" && asked.kind != "ise-fast" && asked.kind != "ise-poll" && asked.kind != "ise-dynamic")
            throw std::invalid_argument("bench_ise has the kinds ise, ise-fast, ise-poll and ise-dynamic, not " +
                                        asked.kind);
        if (asked.kind == "ise-dynamic" && (asked.work != "call" || asked.outstanding != 1 || asked.services != 1))
            throw std::invalid_argument("kind ise-dynamic calls one service, one call after the other");
        bench::allow_descriptors();
        if (asked.work == "names") asked.serve ? bench::serve_names(asked) : bench::measure_names(asked);
        else if (asked.serve) bench::serve(asked);
        else bench::print(asked, bench::measure(asked));
        return 0;
    } catch (const std::invalid_argument& wrong) {
        std::fprintf(stderr, "bench_ise: %s\n%s", wrong.what(), bench::usage());
        return 2;
    } catch (const std::exception& failed) {
        std::fprintf(stderr, "bench_ise: %s\n", failed.what());
        return 1;
    }
}
