// What a recording costs on one thread: packets of 100 bytes and of 64 KiB as protobuf messages into chunks, with each
// compression, into a file; and reading them back by time. All by processor time, which other programs disturb little:
// what a disk that is fast enough would get. The time on the clock stands beside it.
// bench_bag [FOLDER]      FOLDER: of the file (default: /tmp; /dev/shm is memory)
#include <ise/bag/compression.hpp>
#include <ise/bag/file.hpp>
#include <ise/bag/protobuf.hpp>
#include <ise/bag/reader.hpp>
#include <ise/bag/writer.hpp>
#include <ise/packet/codec.hpp>
#include <ise/packet/schema.hpp>

#include <chrono>
#include <cstdint>
#include <cstdio>
#include <ctime>
#include <memory>
#include <string>
#include <utility>
#include <vector>

namespace {

using namespace ise;
using namespace ise::bag;

struct fix {
    std::uint64_t number = 0;
    double latitude_deg = 28.1, longitude_deg = -15.4, heading_deg = 0, speed_kn = 4.5;
    std::string sentence = "$GPRMC,080000,A,2808.9,N,01526.4,W,4.5,90,211126,,*1D";
};
struct scan {
    std::vector<float> ranges_m;
};

/// From its beginning on.
class stretch {
public:
    double busy_s() const { return static_cast<double>(std::clock() - busy_) / CLOCKS_PER_SEC; }
    double passed_s() const { return std::chrono::duration<double>(std::chrono::steady_clock::now() - began_).count(); }

private:
    std::clock_t busy_ = std::clock();
    std::chrono::steady_clock::time_point began_ = std::chrono::steady_clock::now();
};

template <class Packet, class Change>
void measure(const char* name, Packet packet, Change change, std::size_t count, compression packing,
             const std::string& file) {
    std::remove(file.c_str());
    protobuf_type type(schema_of<Packet>());
    writer_options how;
    how.packing = packing;
    auto out = writer::make(create_file(file).value(), how).value();
    auto schema = out.add_schema(type.name(), "protobuf", type.descriptors()).value();
    auto channel = out.add_channel(schema, "bench", "protobuf").value();
    buffer raw, message;
    std::uint64_t in = 0;
    const stretch writing;
    for (std::size_t i = 0; i < count; ++i) {
        change(packet, i);
        raw.clear();
        encode(packet, raw);
        in += raw.size();
        message.clear();
        type.encode(raw.view(), message, true).value();
        message_record one;
        one.channel_id = channel;
        one.sequence = static_cast<std::uint32_t>(i);
        one.log_time = one.publish_time = i;
        one.data = message.view();
        out.write(one).value();
    }
    out.close().value();
    const auto wrote = writing.busy_s(), passed = writing.passed_s();
    const stretch reading;
    auto from = open_file(file).value();
    auto about = read_summary(*from).value();
    message_reader reader(*from, about);
    std::uint64_t read = 0;
    for (auto got = reader.next().value(); got; got = reader.next().value()) read += got->data.size();
    const auto took = reading.busy_s();
    constexpr double mega = 1e6;
    std::printf("%-10s %-5s %8.0f ns a packet  %7.1f MB/s of packets  %7.1f MB/s of messages (%7.1f by the clock)  "
                "file %6.1f MB  read %7.1f MB/s\n",
                name, packing == compression::none ? "none" : std::string(name_of(packing)).c_str(),
                wrote / static_cast<double>(count) * 1e9, static_cast<double>(in) / mega / wrote,
                static_cast<double>(read) / mega / wrote, static_cast<double>(read) / mega / passed,
                static_cast<double>(about.file_bytes) / mega, static_cast<double>(read) / mega / took);
    std::remove(file.c_str());
}

} // namespace

int main(int count, char** arguments) {
    std::string file = std::string(count > 1 ? arguments[1] : "/tmp") + "/bench_bag.mcap";
    for (auto packing : {compression::none, compression::lz4, compression::zstd}) {
        measure(
            "100 bytes", fix(),
            [](fix& one, std::size_t i) { one.number = i, one.heading_deg = static_cast<double>(i % 3600) / 10; },
            1'000'000, packing, file);
        scan big;
        big.ranges_m.resize(16384);
        measure(
            "64 KiB", big, [](scan& one, std::size_t i) { one.ranges_m[i % 16384] = static_cast<float>(i); }, 5'000,
            packing, file);
    }
}
