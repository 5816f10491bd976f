// Any frames in any order as what a peer says within a session: to a component that provides, calls and subscribes.
// The input is a list of records: type, flags, id (one byte; 255: eight more), length (two bytes), the body. Type 0
// stands for bytes that are written as they are, type 128 and above lets some time pass, in 16 ms.
#include <ise/core/inproc_stream.hpp>

#include <asio/buffer.hpp>

#include <support/boat_services.hpp>
#include <support/sim_parties.hpp>

#include <algorithm>
#include <cstdlib>

using namespace std::chrono_literals;
using namespace boat_services;

namespace {

ise::task<> drain(std::shared_ptr<ise::stream> from) {
    ise::bytes room(16 * 1024);
    for (;;) {
        auto got = co_await from->read_some(asio::buffer(room.data(), room.size()));
        if (got.problem) co_return;
    }
}

// What the component itself wants of its peer.
ise::task<> want(ise::remote peer) {
    set_mode hold{"hold"};
    auto called = co_await peer.try_call(helm, hold, 2s);
    blob small;
    auto echoed = co_await peer.try_call(echo, small, 2s);
}
ise::task<> follow(ise::remote peer) {
    try {
        auto fixes = co_await peer.subscribe(position, ise::subscribe_options::lossless(4));
        for (;;) {
            auto fix = co_await fixes.next();
            if (!fix) co_return;
        }
    } catch (const ise::error&) { // refused, as the peer likes
    }
}

class script {
public:
    explicit script(ise::bytes_view from) : left_(from) {}
    bool empty() const { return left_.empty(); }
    ise::bytes_view take(std::size_t count) {
        auto taken = left_.first(std::min(count, left_.size()));
        left_ = left_.subspan(taken.size());
        return taken;
    }
    std::uint8_t byte() {
        auto one = take(1);
        return one.empty() ? 0 : std::to_integer<std::uint8_t>(one[0]);
    }
    std::uint64_t number(std::size_t bytes) {
        std::uint64_t value = 0;
        for (std::size_t i = 0; i < bytes; ++i) value |= static_cast<std::uint64_t>(byte()) << (8 * i);
        return value;
    }

private:
    ise::bytes_view left_;
};

void hold(ise::bytes_view input) {
    ise_test::sim_parties all;
    ise::service_options options;
    options.accepts.max_message_bytes = 1 << 20;
    auto& boat = all.add("boat", options);
    boat.provide(helm, [&boat](set_mode asked) -> ise::task<mode_set> {
        co_await ise::sleep_for(boat.on, 10ms);
        mode_set done{true, asked.mode};
        co_return done;
    });
    boat.provide(echo, [](blob given) { return given; });
    auto fixes = boat.publish(position);
    auto pair = ise::make_inproc_pair(boat.on, boat.on, "pair");
    std::shared_ptr<ise::stream> peer = std::move(pair.first);
    boat.scope.spawn("drain", drain(peer));
    ise::net::session_terms terms;
    terms.version = 1;
    terms.features = ise::wire::feature::all;
    terms.we_accept = boat.services->peers().greeting().accepts;
    terms.peer_accepts.max_calls = 16;
    std::weak_ptr<ise::session> alive;
    {
        auto made =
            std::make_shared<ise::net::connection>(boat.on, std::move(pair.second), terms, ise::wire::parser(1 << 16));
        auto session = boat.services->peers().run(std::move(made), {});
        alive = session;
        ise::remote back(boat.services->link_back(session));
        boat.scope.spawn("calls", want(back));
        boat.scope.spawn("subscribes", follow(back));
    }
    all.world.run_for(1ms);

    script said(input);
    while (!said.empty() && !boat.services->sessions().empty()) {
        auto type = said.byte();
        if (type >= 128) {
            all.world.run_for(16ms * (type - 127));
            fix here{1, 2, 3};
            fixes(here);
            continue;
        }
        ise::buffer out;
        if (type == 0) {
            out.append(said.take(said.byte()));
        } else {
            auto flags = said.byte();
            auto id = said.number(1);
            if (id == 255) id = said.number(8);
            auto body = said.take(said.number(2));
            ise::wire::put_frame(out, static_cast<ise::wire::frame_type>(type), flags, id,
                                 [&](ise::buffer& to) { to.append(body); });
        }
        asio::const_buffer raw(out.data(), out.size());
        peer->try_write(std::span(&raw, 1));
        all.world.run_for(1ms);
    }
    peer->close();
    // Whatever was said: the session ends, nothing runs for it any more, and everything stops in order.
    if (!all.run_until([&] { return alive.expired() && boat.services->sessions().empty(); })) std::abort();
    if (boat.services->calls().open_calls() != 0 || !boat.escaped.empty()) std::abort();
    if (!all.stop()) std::abort();
}

} // namespace

// g++ 12 gives a coroutine lambda within an extern "C" function a name twice.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size <= 40'000) hold(ise::bytes_view(reinterpret_cast<const std::byte*>(data), size));
    return 0;
}
