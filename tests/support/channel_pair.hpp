#pragma once
#include <ise/transport/udp/channel.hpp>

#include <functional>
#include <map>
#include <random>

namespace ise_test {

/// What lies between two channels: which datagrams are lost, come twice, or late. Seeded.
struct rough_way {
    double loss = 0;
    double twice = 0;
    double late = 0;
    ise::duration travel = std::chrono::milliseconds(20);
};

/// Two channels and a network of nothing but a list: pure state, time in hand.
class channel_pair {
public:
    struct side {
        explicit side(std::uint64_t peer_id) : channel(peer_id) { channel.take_messages(); }
        ise::net::udp::channel channel;
        ise::bytes stream;
        std::vector<ise::bytes> messages;
    };

    explicit channel_pair(std::uint64_t seed = 1, rough_way between = {}) : way(between), random_(seed) {}

    rough_way way;
    side a{2}, b{1};
    ise::time_point now{std::chrono::seconds(100)};
    std::uint64_t datagrams = 0;
    std::size_t written = 0; ///< of what `a` is to send

    /// Lets things happen until `done`, at most for `limit`; whether it was.
    bool run_until(const std::function<bool()>& done, ise::duration limit = std::chrono::minutes(10)) {
        auto end = now + limit;
        while (!done()) {
            send(a, b);
            send(b, a);
            if (done()) return true;
            auto next = std::min(a.channel.due(now), b.channel.due(now));
            if (!under_way_.empty()) next = std::min(next, under_way_.begin()->first);
            if (next > end) return false;
            now = std::max(next, now + std::chrono::nanoseconds(1));
            while (!under_way_.empty() && under_way_.begin()->first <= now) {
                auto arriving = std::move(under_way_.begin()->second);
                under_way_.erase(under_way_.begin());
                take(*arriving.first, arriving.second);
            }
            a.channel.on_timer(now);
            b.channel.on_timer(now);
        }
        return true;
    }

    void take(side& at, const ise::bytes& raw) {
        auto received = ise::wire::read_datagram(raw);
        if (!received || received->type != ise::wire::datagram_type::data) return;
        ise::net::udp::channel::events happened;
        at.channel.take(received->body, now, happened);
        for (auto& message : happened.messages) at.messages.push_back(std::move(message));
        ise::bytes room(4096);
        while (auto count = at.channel.in().read(room))
            at.stream.insert(at.stream.end(), room.begin(), room.begin() + static_cast<std::ptrdiff_t>(count));
    }

private:
    bool chance(double of) { return std::uniform_real_distribution<double>(0, 1)(random_) < of; }
    void send(side& from, side& to) {
        ise::buffer out;
        for (int burst = 0; burst < 1000; ++burst) {
            out.clear();
            if (!from.channel.next(out, now)) return;
            ++datagrams;
            for (int copies = chance(way.twice) ? 2 : 1; copies > 0; --copies) {
                if (chance(way.loss)) continue;
                auto arrives = now + way.travel;
                if (chance(way.late)) arrives += std::chrono::microseconds(random_() % 50'000);
                under_way_.emplace(arrives, std::pair(&to, out.to_bytes()));
            }
        }
    }

    std::mt19937_64 random_;
    std::multimap<ise::time_point, std::pair<side*, ise::bytes>> under_way_;
};

inline ise::bytes numbered_bytes(std::size_t count) {
    ise::bytes made(count);
    for (std::size_t i = 0; i < count; ++i) made[i] = static_cast<std::byte>(i * 31 + (i >> 8));
    return made;
}

inline void put_message(ise::net::udp::channel& into, std::uint64_t key, std::size_t size, std::uint8_t fill) {
    ise::wire::frame_header header;
    header.type = ise::wire::frame_type::packet;
    header.id = key;
    header.length = static_cast<std::uint32_t>(size);
    ise::buffer content;
    content.append(ise::bytes_view(ise::bytes(size, static_cast<std::byte>(fill))));
    into.out().messages().put(key, header, {}, ise::shared_bytes(std::move(content)));
}

} // namespace ise_test
