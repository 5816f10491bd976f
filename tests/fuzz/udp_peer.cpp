// A client and a provider over datagrams, each of whose datagrams is changed as the input says once they know each
// other: the one is a hostile peer for the other. No call stays without an end, and both serve and reach others as
// before.
#include <fuzz/input.hpp>
#include <ise/wire/datagram.hpp>
#include <support/boat_services.hpp>
#include <support/datagram_router.hpp>
#include <support/sim_parties.hpp>

#include <algorithm>
#include <cstdio>
#include <cstdlib>

using namespace boat_services;
using namespace ise_test;
using namespace std::chrono_literals;

namespace {

ise::task<ise::result<mode_set>> try_helm(ise::remote boat, std::string mode, ise::duration limit) {
    set_mode request{std::move(mode)};
    auto got = co_await boat.try_call(helm, request, limit);
    co_return got;
}

void must(bool holds, const char* what) {
    if (holds) return;
    std::fprintf(stderr, "udp_peer: %s\n", what);
    std::abort();
}

constexpr std::size_t head = ise::wire::frame_header::size;

void change(fuzz_input& by, ise::buffer& datagram) {
    if (by.left.empty() || datagram.size() < head) return;
    auto type = static_cast<ise::wire::datagram_type>(ise::wire::read_header(datagram.data()).type);
    if (type != ise::wire::datagram_type::data || datagram.size() < head + 8) return;
    switch (by.next() % 8) {
        case 1: datagram.clear(); return;
        case 2: datagram.append(by.next()); break; // a stray byte
        case 3: {                                  // one byte of it
            auto at = head + by.number(2) % (datagram.size() - head);
            datagram.data()[at] ^= std::byte{by.next()};
            break;
        }
        case 4: datagram.truncate(datagram.size() - by.next() % (datagram.size() - head)); break;
        case 5: { // a chunk more
            auto kind = by.next();
            auto content = by.raw(by.next());
            datagram.append(kind);
            datagram.append(static_cast<std::uint16_t>(content.size()));
            datagram.append(content);
            break;
        }
        case 6: ise::detail::store_little(datagram.data() + head, by.number(8)); break; // its number
        case 7: {                                                                       // other chunks only
            datagram.truncate(head + 8);
            datagram.append(by.raw(by.number(2) % 1100));
            break;
        }
        default: return;
    }
    ise::detail::store_little(datagram.data(), static_cast<std::uint32_t>(datagram.size() - head));
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 2 || size > 10'000) return 0;
    fuzz_input input{ise::bytes_view(reinterpret_cast<const std::byte*>(data), size)};
    auto flags = input.next();
    sim_parties sea;
    ise::service_options options;
    options.accepts.heartbeat_ns = 500'000'000;
    options.first_back_off = 20ms;
    options.max_back_off = 200ms;
    auto& boat = sea.add("boat", options);
    auto& shore = sea.add("shore", options);
    boat.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    auto where = boat.listen("udp://10.0.0.1:7400");
    auto& other = sea.add("other", options);
    other.provide(helm, [](set_mode asked) { return mode_set{true, asked.mode}; });
    auto elsewhere = other.listen("udp://" + sea.world.host("other").address() + ":7400");
    datagram_router between(sea.world.host("router").start_process("router"), where);
    auto there = shore.at(ise::endpoint::parse("udp://" + sea.world.host("router").address() + ":9000").value());
    must(sea.run(shore, try_helm(there, "greets", 10s)).has_value(), "no session at first");

    if (flags & 1) between.on_question = [&](ise::buffer& datagram) { change(input, datagram); };
    if (flags & 2) between.on_answer = [&](ise::buffer& datagram) { change(input, datagram); };
    std::vector<std::shared_ptr<started<ise::result<mode_set>>>> calls;
    for (std::size_t i = 1; i <= 4; ++i) {
        std::string words((flags >> 2) * 40 * i, 'w');
        calls.push_back(start(shore.on, try_helm(there, words, 5s)));
    }
    auto ended = [&] { return std::ranges::all_of(calls, [](const auto& one) { return one->done; }); };
    must(sea.world.run_until(ended, 6s), "a call has no end");
    between.on_question = between.on_answer = nullptr;
    auto asks = sea.run(other, try_helm(other.at(where), "others", 5s));
    must(asks && asks->reason == "others", "the provider does not answer others");
    auto goes_on = sea.run(shore, try_helm(shore.at(elsewhere), "elsewhere", 5s));
    must(goes_on && goes_on->reason == "elsewhere", "the client does not reach others");
    must(sea.stop(), "something runs on");
    between.stop(sea.world);
    return 0;
}
