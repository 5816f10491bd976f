#include <components/iridium/bundle.hpp>

#include <fmt/format.h>

namespace atirma::iridium {
namespace {
constexpr std::byte bundle_mark{0x42};
}

ise::bytes bundle(std::span<const ise::bytes> packets, std::size_t most, std::size_t& taken) {
    taken = 0;
    ise::bytes out{bundle_mark};
    for (const auto& packet : packets) {
        if (packet.empty() || packet.size() > 255 || out.size() + 1 + packet.size() > most) break;
        out.push_back(static_cast<std::byte>(packet.size()));
        out.insert(out.end(), packet.begin(), packet.end());
        ++taken;
    }
    if (taken == 0) {
        if (packets.empty() || packets[0].empty() || packets[0].size() > most) return {};
        taken = 1; // fits without the two bytes of a bundle only
    }
    return taken == 1 ? packets[0] : out;
}

ise::result<std::vector<ise::bytes>> unbundle(ise::bytes_view message) {
    std::vector<ise::bytes> packets;
    if (message.empty()) return ise::failure(ise::errc::malformed, "an empty message");
    if (message[0] != bundle_mark) {
        packets.emplace_back(message.begin(), message.end());
        return packets;
    }
    auto rest = message.subspan(1);
    while (!rest.empty()) {
        auto length = std::to_integer<std::size_t>(rest[0]);
        if (length == 0 || length > rest.size() - 1)
            return ise::failure(ise::errc::malformed, fmt::format("a bundle whose packet of {} bytes ends after {}",
                                                                  length, rest.size() - 1));
        auto packet = rest.subspan(1, length);
        packets.emplace_back(packet.begin(), packet.end());
        rest = rest.subspan(1 + length);
    }
    if (packets.empty()) return ise::failure(ise::errc::malformed, "a bundle without packets");
    return packets;
}

} // namespace atirma::iridium
