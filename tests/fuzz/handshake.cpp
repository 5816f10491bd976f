// Any bytes as what a stranger says in place of a greeting, in pieces of any size, to the side that was called and to
// the side that calls, with a shared key and without: each ends with a connection or a reason, by its deadline, and
// holds nothing afterwards.
#include <ise/core/inproc_stream.hpp>
#include <ise/net/handshake.hpp>
#include <ise/packet/codec.hpp>
#include <ise/transport/shared_key.hpp>

#include <asio/buffer.hpp>

#include <support/sim_parties.hpp>

#include <algorithm>
#include <cstdlib>

using namespace std::chrono_literals;

namespace {

struct channel final : ise::net::gatekeeper {
    ise::result<ise::wire::welcome> admit(const ise::wire::hello& caller) override {
        if (caller.wanted_path == "buoy") return ise::failure(ise::errc::wrong_peer, "here is the boat");
        ise::wire::welcome yes;
        yes.self.path = "boat";
        return yes;
    }
};

using made = ise::result<std::shared_ptr<ise::net::connection>>;

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size < 1 || size > 40'000) return 0;
    bool calls = data[0] & 1;
    std::size_t at_once = std::size_t{1} << (data[0] >> 1 & 15); // bytes that come together
    bool closes = data[0] & 32;
    static const auto secret = ise::shared_key::make(std::string(64, 'k'), "the fuzzer").value();
    const auto* key = data[0] & 64 ? secret.get() : nullptr;
    ise::bytes_view said = ise::bytes_view(reinterpret_cast<const std::byte*>(data), size).subspan(1);

    ise::sim::world world;
    auto& env = world.host("a").start_process("a");
    auto host = env.make_loop("main");
    auto& on = host->loop();
    auto [near, far] = ise::make_inproc_pair(on, on, "pair");
    channel gate;
    ise::wire::hello mine;
    mine.self.path = "shore";
    auto outcome = calls ? ise_test::start(on, ise::net::initiate(on, std::move(far), mine, on.now() + 5s, key))
                         : ise_test::start(on, ise::net::respond(on, std::move(far), gate, on.now() + 5s, key));
    while (!said.empty() && !outcome->done) {
        auto count = std::min(at_once, said.size());
        asio::const_buffer piece(said.data(), count);
        auto wrote = near->try_write(std::span(&piece, 1));
        if (wrote.problem) break;
        said = said.subspan(wrote.bytes);
        world.run_for(1us);
    }
    if (closes) near->close();
    if (!world.run_until([&] { return outcome->done; }, 6s)) std::abort();
    if (outcome->thrown) std::abort();
    made& got = *outcome->value;
    if (got) {
        if (key) std::abort(); // nobody says 32 right bytes by chance
        const auto& terms = (*got)->terms();
        if (terms.version != 1 || terms.peer_accepts.max_frame_bytes < ise::wire::min_frame_limit) std::abort();
        if (terms.peer_accepts.heartbeat_ns < 20'000'000 ||
            (terms.features & ~(mine.features | ise::wire::feature::objects)) != 0)
            std::abort();
        (*got)->close(ise::failure(ise::errc::cancelled, "enough"));
    } else if (got.error().message().empty()) {
        std::abort();
    }
    got = ise::failure(ise::errc::cancelled, {});
    near.reset();
    world.run_for(1s);
    return 0;
}
