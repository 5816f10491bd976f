// Any datagrams to one who listens and to one who has a session: nothing breaks, memory is bounded, and a stranger is
// never answered at greater length than it asked. A byte of kind and two of length stand before each datagram.
#include <ise/sim/world.hpp>
#include <ise/transport/shared_key.hpp>
#include <ise/transport/udp/channel.hpp>
#include <ise/transport/udp/port.hpp>

#include <algorithm>
#include <cstdlib>

namespace {

using namespace ise::net::udp;

struct silent_socket final : ise::datagram_socket {
    std::size_t sent = 0;
    void deliver_to(ise::datagram_reader&, std::size_t) override {}
    ise::task<std::pair<std::error_code, const ise::datagram*>> receive() override {
        std::pair<std::error_code, const ise::datagram*> none;
        co_return none;
    }
    std::error_code try_send(const ise::endpoint&, ise::bytes_view content) override {
        sent += content.size();
        return {};
    }
    void close() override {}
    ise::endpoint where() const override { return {}; }
};

void into_channel(ise::bytes_view input) {
    channel at(1);
    at.take_messages();
    at.out().write(ise::as_bytes("something that is to be acknowledged"));
    ise::time_point now{std::chrono::seconds(1)};
    ise::buffer out;
    std::uint64_t number = 0;
    ise::bytes room(4096);
    while (input.size() >= 3) {
        auto flags = static_cast<unsigned>(input[0]);
        std::size_t length = ise::detail::load_little<std::uint16_t>(input.data() + 1);
        input = input.subspan(3);
        length = std::min({length, input.size(), ise::wire::datagram_bytes - ise::wire::data_head_bytes});
        ise::bytes body(8);
        ise::detail::store_little(body.data(), flags & 1 ? number++ : std::uint64_t{flags});
        if ((flags & 24) == 24 && length >= 8) { // any number
            std::copy_n(input.begin(), 8, body.begin());
            input = input.subspan(8);
            length -= 8;
        }
        body.insert(body.end(), input.begin(), input.begin() + static_cast<std::ptrdiff_t>(length));
        input = input.subspan(length);
        channel::events happened;
        at.take(body, now, happened);
        if (happened.messages.size() > 64) std::abort();
        if (flags & 2) at.in().read(room);
        if (flags & 4) now += std::chrono::milliseconds(flags);
        for (int burst = 0; burst < 64; ++burst) {
            out.clear();
            if (!at.next(out, now)) break;
            if (out.size() > ise::wire::datagram_bytes || !ise::wire::read_datagram(out.view())) std::abort();
        }
        at.on_timer(now);
        out.clear();
        if (!at.next(out, now) && at.due(now) <= now) std::abort(); // it would be asked again without end
        if (at.messages().bytes_held() > incoming_messages::max_bytes) std::abort();
    }
}

void into_port(ise::bytes_view input, bool seals) {
    static ise::sim::world world(1);
    static auto& process = world.host("boat").start_process("boat");
    static auto host = process.make_loop("main");
    auto socket = std::make_unique<silent_socket>();
    auto& wire = *socket;
    static const auto key = ise::shared_key::make(std::string(64, 'k'), "a test").value();
    port_security with;
    if (seals) with.key = key;
    auto at = std::make_shared<port>(host->loop(), std::move(socket), true, std::move(with));
    ise::datagram came;
    came.peer = ise::endpoint::parse("udp://10.0.0.9:4000").value();
    while (input.size() >= 3) {
        std::size_t length = ise::detail::load_little<std::uint16_t>(input.data() + 1);
        auto type = static_cast<std::uint8_t>(input[0]);
        input = input.subspan(3);
        length = std::min({length, input.size(), ise::wire::datagram_bytes - ise::wire::frame_header::size});
        ise::buffer out;
        ise::wire::put_datagram(out, static_cast<ise::wire::datagram_type>(type % 16), length, input.first(length));
        input = input.subspan(length);
        came.content = out.to_bytes();
        auto before = wire.sent;
        at->on_datagram(came.peer, came.content);
        if (wire.sent - before > came.content.size() || at->associations() != 0) std::abort();
    }
    at->close();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    ise::bytes_view input(reinterpret_cast<const std::byte*>(data) + 1, size - 1);
    if (data[0] % 2) {
        into_channel(input);
    } else {
        into_port(input, data[0] % 4 == 0);
    }
    return 0;
}
