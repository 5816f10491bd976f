// Any bytes as what a stranger sends: cut into frames in two ways that must agree, put together from pieces, which come
// whole or in parts, and read as the bodies of control frames.
#include <ise/wire/body.hpp>
#include <ise/wire/messages.hpp>
#include <ise/wire/parser.hpp>
#include <ise/wire/pieces.hpp>

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <vector>

namespace {

struct summary {
    std::vector<std::uint64_t> frames;
    bool broken = false;
    bool operator==(const summary&) const = default;
};

summary parse(ise::bytes_view raw, std::size_t at_once) {
    ise::wire::parser in(8192);
    summary seen;
    while (!raw.empty() && !seen.broken) {
        auto room = in.prepare();
        if (room.empty()) std::abort();
        auto count = std::min({room.size(), raw.size(), at_once});
        std::memcpy(room.data(), raw.data(), count);
        in.commit(count);
        raw = raw.subspan(count);
        for (;;) {
            auto found = in.next();
            seen.broken = !found;
            if (!found || !*found) break;
            seen.frames.push_back((*found)->header.id ^ (*found)->body.size());
        }
        if (in.capacity() > 32768) std::abort();
    }
    return seen;
}

template <class Body>
void read(ise::bytes_view raw) {
    auto body = ise::wire::read_body<Body>(raw);
    if (!body) return;
    auto again = ise::wire::read_body<Body>(ise::encode(*body)); // what was read can be written and read
    if (!again || ise::encode(*again) != ise::encode(*body)) std::abort();
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    ise::bytes_view input(reinterpret_cast<const std::byte*>(data), size);
    if (parse(input, 7) != parse(input, 100'000)) std::abort();

    ise::wire::parser in(1 << 16);
    ise::wire::reassembly whole(1 << 16);
    while (!input.empty()) {
        const auto missing = whole.missing();
        auto room = missing > 0 ? whole.room() : in.prepare();
        auto count = std::min(room.size(), input.size());
        std::memcpy(room.data(), input.data(), count);
        input = input.subspan(count);
        if (missing > 0) {
            const auto own = std::min(count, missing);
            in.add(ise::bytes_view(room).subspan(own, count - own));
            if (!whole.fill(own)) return 0;
            if (whole.missing() > 0) continue;
        } else {
            in.commit(count);
        }
        for (;;) {
            auto found = in.next();
            if (!found) return 0;
            if (!*found) {
                const auto part = in.begun();
                if (!part || part->header.type != ise::wire::frame_type::piece) break;
                auto begun = whole.begin(*part);
                if (whole.bytes_held() > 2 << 16) std::abort();
                if (!begun) return 0;
                if (*begun) in.give_begun();
                break;
            }
            const auto& frame = **found;
            using enum ise::wire::frame_type;
            switch (frame.header.type) {
                case hello: read<ise::wire::hello>(frame.body); break;
                case welcome: read<ise::wire::welcome>(frame.body); break;
                case reject:
                case goodbye:
                case ended: read<ise::wire::farewell>(frame.body); break;
                case error: read<ise::wire::call_failure>(frame.body); break;
                case introduce: read<ise::wire::introduction>(frame.body); break;
                case answers: read<ise::wire::provider_packets>(frame.body); break;
                case subscribe: read<ise::wire::subscribe>(frame.body); break;
                case subscribed: read<ise::wire::subscribed>(frame.body); break;
                case schema_request: read<ise::wire::schema_request>(frame.body); break;
                case schema: read<ise::wire::schema_answer>(frame.body); break;
                case piece: {
                    auto taken = whole.take(frame);
                    if (whole.bytes_held() > 2 << 16) std::abort();
                    if (!taken) return 0;
                    break;
                }
                default: break;
            }
        }
    }
    return 0;
}
