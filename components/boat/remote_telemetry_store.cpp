#include <components/boat/remote_telemetry_store.hpp>

#include <algorithm>

namespace atirma {
namespace {

constexpr ise::duration patience = std::chrono::seconds(10); // a disk, and a node that is taken for lost meanwhile

} // namespace

ise::task<> remote_telemetry_store::keep(std::vector<telemetry_packet> packets) {
    for (std::size_t done = 0; done < packets.size();) {
        auto many = std::min(packets.size() - done, keep_request::max_packets);
        auto first = packets.begin() + static_cast<std::ptrdiff_t>(done);
        keep_request part;
        part.packets.assign(first, first + static_cast<std::ptrdiff_t>(many));
        co_await nodes_.call(services::telemetry_store, std::move(part), patience);
        done += many;
    }
}

} // namespace atirma
