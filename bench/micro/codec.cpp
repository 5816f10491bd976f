// What encoding and decoding cost on one thread, beside what the same bytes cost by hand: a packet of six fields (26
// bytes) against storing each field at its place, ten thousand floats against memcpy.
#include "support/report.hpp"

#include <ise/packet/codec.hpp>

#include <algorithm>
#include <array>
#include <cstdio>
#include <cstring>
#include <vector>

namespace {

struct fix {
    double latitude_deg = 28.1, longitude_deg = -15.4;
    float speed_kn = 4.5F;
    std::uint32_t sequence = 7;
    std::uint8_t satellites = 9;
    bool valid = true;
};
struct scan {
    std::vector<float> ranges_m;
};

// The compiler must take it that everything may be read and written here.
inline void touch(void* at) { asm volatile("" : : "r"(at) : "memory"); }

/// Nanoseconds of one `work()`: the best of many batches, which is what the code costs without its neighbours.
template <class Work>
double cost(std::size_t in_a_batch, Work work) {
    double best = 1e18;
    for (int batch = 0; batch != 200; ++batch) {
        const auto began = bench::now_ns();
        for (std::size_t i = 0; i != in_a_batch; ++i) work();
        best = std::min(best, static_cast<double>(bench::now_ns() - began) / static_cast<double>(in_a_batch));
    }
    return best;
}

template <class Packet, class ByHandOut, class ByHandIn>
void compare(const char* name, std::size_t in_a_batch, Packet packet, ByHandOut out_by_hand, ByHandIn in_by_hand) {
    ise::buffer out;
    ise::encode(packet, out);
    const auto bytes = out.to_bytes();
    std::vector<std::byte> raw(bytes.size());
    Packet read = packet;
    const double encode = cost(in_a_batch, [&] {
        out.clear();
        ise::encode(packet, out);
        touch(&out);
    });
    const double decode = cost(in_a_batch, [&] {
        ise::decode_into(read, bytes);
        touch(&read);
    });
    const double encode_floor = cost(in_a_batch, [&] {
        out_by_hand(packet, raw.data());
        touch(raw.data());
    });
    const double decode_floor = cost(in_a_batch, [&] {
        touch(raw.data());
        in_by_hand(read, raw.data());
        touch(&read);
    });
    std::printf("{\"packet\":\"%s\",\"bytes\":%zu,\"encode_ns\":%.2f,\"encode_floor_ns\":%.2f,\"decode_ns\":%.2f,"
                "\"decode_floor_ns\":%.2f}\n",
                name, bytes.size(), encode, encode_floor, decode, decode_floor);
}

// Field by field, as reflection without an archive would.
template <class Field>
void put(std::byte*& to, const Field& field) {
    std::memcpy(to, &field, sizeof field);
    to += sizeof field;
}
template <class Field>
void get(const std::byte*& from, Field& field) {
    std::memcpy(&field, from, sizeof field);
    from += sizeof field;
}

} // namespace

int main() {
    compare(
        "six fields", 100'000, fix(),
        [](const fix& packet, std::byte* to) {
            put(to, packet.latitude_deg), put(to, packet.longitude_deg), put(to, packet.speed_kn);
            put(to, packet.sequence), put(to, packet.satellites), put(to, packet.valid);
        },
        [](fix& packet, const std::byte* from) {
            get(from, packet.latitude_deg), get(from, packet.longitude_deg), get(from, packet.speed_kn);
            get(from, packet.sequence), get(from, packet.satellites), get(from, packet.valid);
        });
    scan ranges;
    ranges.ranges_m.assign(10'000, 1.5F);
    compare(
        "10,000 floats", 500, ranges,
        [](const scan& packet, std::byte* to) {
            std::memcpy(to, packet.ranges_m.data(), packet.ranges_m.size() * sizeof(float));
        },
        [](scan& packet, const std::byte* from) {
            std::memcpy(packet.ranges_m.data(), from, packet.ranges_m.size() * sizeof(float));
        });
}
