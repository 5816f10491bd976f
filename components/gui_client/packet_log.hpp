#pragma once
#include <components/gui_client/view.hpp>

#include <deque>
#include <memory>
#include <string>
#include <vector>

namespace atirma::console {

/// The newest raw packets. Pure, bounded.
class packet_log {
public:
    using list = std::vector<std::shared_ptr<const raw_packet>>;
    explicit packet_log(std::size_t most) : most_(most) {}

    void add(const std::string& path, const telemetry_packet& packet, bool duplicate, utc_time now);
    /// The same object until something changes. Oldest first.
    std::shared_ptr<const list> packets();

private:
    std::size_t most_;
    std::uint64_t count_ = 0;
    std::deque<std::shared_ptr<const raw_packet>> packets_;
    std::shared_ptr<const list> shared_;
};

} // namespace atirma::console
