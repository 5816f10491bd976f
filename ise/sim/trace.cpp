#include <ise/sim/trace.hpp>

#include <fmt/format.h>

namespace ise::sim {

void trace::mix(const void* data, std::size_t size) noexcept { // FNV-1a
    for (auto* at = static_cast<const unsigned char*>(data); size > 0; ++at, --size)
        hash_ = (hash_ ^ *at) * 0x100000001B3u;
}

void trace::mix(std::uint64_t value) noexcept { // byte by byte: the same on every processor
    for (int shift = 0; shift < 64; shift += 8) {
        const auto octet = static_cast<unsigned char>(value >> shift);
        mix(&octet, 1);
    }
}

void trace::note(time_point at, std::string_view kind, std::string_view subject, std::uint64_t amount) {
    mix(static_cast<std::uint64_t>(at.time_since_epoch().count()));
    mix(kind.data(), kind.size());
    mix(subject.data(), subject.size());
    mix(amount);
    ++count_;
    if (newest_.size() == kept_entries) newest_.pop_front();
    newest_.push_back({at, kind, std::string(subject), amount});
}

std::string trace::text() const {
    std::string lines;
    for (const auto& each : newest_) {
        const auto seconds = std::chrono::duration<double>(each.at.time_since_epoch()).count();
        lines += fmt::format("{:.6f} {} {} {}\n", seconds, each.kind, each.subject, each.amount);
    }
    return lines;
}

} // namespace ise::sim
