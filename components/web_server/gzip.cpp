#include <components/web_server/gzip.hpp>

#include <ise/core/error.hpp>

#include <zlib.h>

namespace atirma {

std::string gzip(std::string_view text) {
    z_stream stream{};
    constexpr int gzip_format = 15 + 16, memory = 8;
    bool opened =
        deflateInit2(&stream, Z_DEFAULT_COMPRESSION, Z_DEFLATED, gzip_format, memory, Z_DEFAULT_STRATEGY) == Z_OK;
    if (!opened) throw ise::error(ise::errc::io_failed, "zlib cannot compress: it has no memory");
    std::string packed(deflateBound(&stream, static_cast<uLong>(text.size())), '\0');
    std::string input(text); // zlib's input is not const
    stream.next_in = reinterpret_cast<Bytef*>(input.data());
    stream.avail_in = static_cast<uInt>(input.size());
    stream.next_out = reinterpret_cast<Bytef*>(packed.data());
    stream.avail_out = static_cast<uInt>(packed.size());
    bool whole = deflate(&stream, Z_FINISH) == Z_STREAM_END;
    packed.resize(stream.total_out);
    deflateEnd(&stream);
    if (!whole) throw ise::error(ise::errc::io_failed, "zlib could not compress the text to its end");
    return packed;
}

} // namespace atirma
