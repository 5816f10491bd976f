// link: ise_foxglove
// Any bytes as what a viewer sends: WebSocket frames, the messages in them, and the paths of assets. What is read is
// within the limits, and what is refused has a reason.
#include <components/foxglove_gateway/protocol.hpp>
#include <ise/http/web_socket_frames.hpp>

#include <algorithm>
#include <cstdlib>
#include <string>

namespace {

void require(bool holds) {
    if (!holds) std::abort();
}

void read_message(bool text, const std::string& payload) {
    auto got = text ? ise::foxglove::read_text(payload) : ise::foxglove::read_binary(payload);
    if (!got) {
        require(!got.error().message().empty());
        return;
    }
    if (auto* asset = std::get_if<ise::foxglove::fetch_asset_message>(&*got)) {
        auto path = ise::foxglove::asset_path(asset->uri);
        if (path)
            require(!path->empty() && path->front() != '/' && ("/" + *path + "/").find("/../") == std::string::npos);
    }
}

} // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
    if (size == 0) return 0;
    ise::bytes_view input(reinterpret_cast<const std::byte*>(data), std::min<std::size_t>(size, 20'000));
    const auto how = std::to_integer<unsigned>(input[0]);
    input = input.subspan(1);
    if (how % 4 != 0) { // without frames
        read_message(how % 4 == 1, std::string(ise::as_text(input)));
        if (how % 4 == 3) (void)ise::foxglove::asset_path(ise::as_text(input));
        return 0;
    }
    ise::web_socket_limits limits;
    limits.max_message_bytes = 1000;
    limits.max_fragments = 5;
    ise::web_socket_reader reader(ise::web_socket_reader::from::clients, limits);
    const std::size_t piece = 1 + how / 4;
    while (!input.empty()) {
        auto used = reader.feed(input.first(std::min(piece, input.size())));
        if (!used) {
            require(!used.error().message().empty());
            return 0;
        }
        require(*used > 0 || reader.complete());
        input = input.subspan(*used);
        if (!reader.complete()) continue;
        auto got = reader.take();
        require(got.payload.size() <= limits.max_message_bytes);
        require(got.kind != ise::web_socket_opcode::continuation);
        if (got.kind == ise::web_socket_opcode::text) read_message(true, got.payload);
        if (got.kind == ise::web_socket_opcode::binary) read_message(false, got.payload);
    }
    return 0;
}
