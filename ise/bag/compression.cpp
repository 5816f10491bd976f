#include <ise/bag/compression.hpp>

#include <fmt/format.h>
#include <lz4frame.h>
#include <zlib.h>
#include <zstd.h>

#include <algorithm>
#include <string>

namespace ise::bag {
namespace {

// A bomb claims much and holds little: room is made as it is filled.
constexpr std::size_t step_bytes = std::size_t{1} << 20;

failure damaged(std::string_view kind, const char* why) {
    return failure(errc::malformed, fmt::format("its {} data is damaged: {}", kind, why));
}

failure wrong_size(std::size_t got, std::size_t wanted) {
    return failure(errc::malformed, got < wanted ? fmt::format("it decompresses to {} bytes instead of {}", got, wanted)
                                                 : fmt::format("it decompresses to more than its {} bytes", wanted));
}

result<void> unpack_zstd(bytes_view data, std::size_t size, buffer& to) {
    std::unique_ptr<ZSTD_DStream, decltype(&ZSTD_freeDStream)> stream(ZSTD_createDStream(), &ZSTD_freeDStream);
    if (!stream) return failure(errc::io_failed, "there is no memory for zstd");
    ZSTD_DCtx_setParameter(stream.get(), ZSTD_d_windowLogMax, 27); // 128 MiB
    ZSTD_inBuffer in{data.data(), data.size(), 0};
    std::size_t made = 0, hint = 1;
    for (;;) {
        // One byte more than there may be shows that there is more.
        auto room = std::min(step_bytes, size - made);
        std::byte extra{};
        auto* at = room > 0 ? to.grow(room) : &extra;
        ZSTD_outBuffer out{at, room > 0 ? room : 1, 0};
        hint = ZSTD_decompressStream(stream.get(), &out, &in);
        if (room == 0 && out.pos > 0) return wrong_size(size + 1, size);
        made += out.pos;
        to.truncate(made);
        if (ZSTD_isError(hint)) return damaged("zstd", ZSTD_getErrorName(hint));
        if (in.pos == in.size && (hint == 0 || out.pos < out.size)) break;
    }
    if (made != size) return wrong_size(made, size);
    return {};
}

result<void> unpack_lz4(bytes_view data, std::size_t size, buffer& to) {
    LZ4F_dctx* raw = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&raw, LZ4F_VERSION)))
        return failure(errc::io_failed, "there is no memory for lz4");
    std::unique_ptr<LZ4F_dctx, decltype(&LZ4F_freeDecompressionContext)> context(raw, &LZ4F_freeDecompressionContext);
    std::size_t made = 0;
    while (true) {
        auto room = std::min(step_bytes, size - made);
        std::byte extra{};
        auto* at = room > 0 ? to.grow(room) : &extra;
        std::size_t wrote = room > 0 ? room : 1, read = data.size();
        auto hint = LZ4F_decompress(context.get(), at, &wrote, data.data(), &read, nullptr);
        if (LZ4F_isError(hint)) {
            to.truncate(made);
            return damaged("lz4", LZ4F_getErrorName(hint));
        }
        if (room == 0 && wrote > 0) return wrong_size(size + 1, size);
        made += wrote;
        to.truncate(made);
        data = data.subspan(read);
        if (data.empty() && (hint == 0 || (wrote == 0 && read == 0) || wrote < std::max<std::size_t>(room, 1))) break;
        if (read == 0 && wrote == 0) return damaged("lz4", "it does not continue");
    }
    if (made != size) return wrong_size(made, size);
    return {};
}

} // namespace

std::string_view name_of(compression kind) noexcept {
    switch (kind) {
        case compression::none: return "";
        case compression::lz4: return "lz4";
        case compression::zstd: return "zstd";
    }
    return "";
}

result<compression> compression_named(std::string_view name) {
    for (auto one : {compression::none, compression::lz4, compression::zstd})
        if (name_of(one) == name) return one;
    return failure(errc::malformed, fmt::format("its compression is none of lz4, zstd and no compression: {:?}",
                                                std::string(name.substr(0, 32))));
}

std::uint32_t crc32(bytes_view data, std::uint32_t before) noexcept {
    return static_cast<std::uint32_t>(::crc32_z(before, reinterpret_cast<const Bytef*>(data.data()), data.size()));
}

struct compressor::state {
    std::unique_ptr<ZSTD_CCtx, decltype(&ZSTD_freeCCtx)> zstd{nullptr, &ZSTD_freeCCtx};
};

compressor::compressor(compression kind, int level) : state_(std::make_unique<state>()), kind_(kind), level_(level) {
    if (kind == compression::zstd) {
        state_->zstd.reset(ZSTD_createCCtx());
        if (!state_->zstd) throw error(errc::io_failed, "there is no memory for zstd");
    }
}
compressor::~compressor() = default;
compressor::compressor(compressor&&) noexcept = default;
compressor& compressor::operator=(compressor&&) noexcept = default;

void compressor::compress(bytes_view data, buffer& to) {
    auto from = to.size();
    auto take = [&](std::size_t bound, auto pack, auto failed, auto name) {
        auto* room = to.grow(bound);
        auto size = pack(room, bound);
        if (failed(size)) throw error(errc::io_failed, fmt::format("a chunk cannot be compressed: {}", name(size)));
        to.truncate(from + size);
    };
    switch (kind_) {
        case compression::none: return to.append(data);
        case compression::zstd:
            return take(
                ZSTD_compressBound(data.size()),
                [&](void* room, std::size_t bound) {
                    return ZSTD_compressCCtx(state_->zstd.get(), room, bound, data.data(), data.size(), level_);
                },
                [](std::size_t size) { return ZSTD_isError(size); },
                [](std::size_t size) { return ZSTD_getErrorName(size); });
        case compression::lz4: {
            LZ4F_preferences_t how{};
            how.frameInfo.contentSize = data.size();
            return take(
                LZ4F_compressFrameBound(data.size(), &how),
                [&](void* room, std::size_t bound) {
                    return LZ4F_compressFrame(room, bound, data.data(), data.size(), &how);
                },
                [](std::size_t size) { return LZ4F_isError(size); },
                [](std::size_t size) { return LZ4F_getErrorName(size); });
        }
    }
}

result<void> decompress(compression kind, bytes_view data, std::size_t size, buffer& to) {
    to.clear();
    switch (kind) {
        case compression::none:
            to.append(data.first(std::min(data.size(), size)));
            if (data.size() != size) return wrong_size(data.size(), size);
            return {};
        case compression::zstd: return unpack_zstd(data, size, to);
        case compression::lz4: return unpack_lz4(data, size, to);
    }
    return {};
}

} // namespace ise::bag
