// Any bytes as a recording: described, read by time, and recovered; what was recovered is whole.
// link: ise_bag
#include <ise/bag/file.hpp>
#include <ise/bag/reader.hpp>
#include <ise/bag/recording.hpp>
#include <ise/bag/recover.hpp>
#include <ise/bag/writer.hpp>

#include <cstddef>
#include <cstdint>
#include <cstdlib>
#include <span>
#include <utility>

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    using namespace ise::bag;
    ise::bytes_view input = std::as_bytes(std::span(data, size));
    reader_limits limits;
    limits.max_record_bytes = limits.max_chunk_bytes = limits.max_open_bytes = std::uint64_t{1} << 20;
    auto from = memory_source(input);
    for (auto how : {depth::index, depth::whole}) {
        auto about = read_summary(*from, how, limits);
        if (!about) continue;
        for (const auto& [id, channel] : about->channels) (void)topic::of(channel);
        for (const auto& one : about->attachments) (void)read_attachment(*from, one, limits);
        message_reader in(*from, *about, message_filter(), limits);
        ise::bag::timestamp last = 0;
        for (auto got = in.next(); got && *got; got = in.next()) {
            if ((*got)->log_time < last && about->loose.empty() && !about->indexed) std::abort();
            last = (*got)->log_time;
        }
    }
    ise::bytes mended;
    auto out = writer::make(memory_sink(mended));
    auto got = recover(*from, *out, limits);
    if (!got) return 0;
    auto again = memory_source(mended);
    auto healed = read_summary(*again, depth::whole);
    if (!healed || healed->damage || !healed->complete || healed->statistics.message_count != got->messages)
        std::abort();
    return 0;
}
