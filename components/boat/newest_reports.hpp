#pragma once
#include <components/boat/duplicate_filter.hpp>
#include <components/boat/heard.hpp>
#include <components/boat/services.hpp>
#include <components/boat/telemetry.hpp>

#include <array>
#include <optional>

namespace atirma {

/// What is known of the boat now: the newest report of each kind, whichever link it came over. Pure; times are passed
/// in. A packet that came before, an older one and history change nothing. A boat's clock that runs ahead is not
/// believed: such a report is dated by its reception.
class newest_reports {
public:
    /// Takes a packet; the kind that is newer now: its place in telemetry_body. Nothing where nothing changed.
    std::optional<std::size_t> take(const telemetry_packet& packet);

    const std::optional<heard<atirma::location>>& location() const noexcept { return location_; } ///< only with a fix
    const std::optional<heard<atirma::navigation>>& navigation() const noexcept { return navigation_; }
    const std::optional<heard<atirma::wind>>& wind() const noexcept { return wind_; }
    const std::optional<heard<atirma::power>>& power() const noexcept { return power_; }
    const std::optional<heard<link_status>>& link(link_id which) const noexcept {
        return links_[static_cast<std::size_t>(which)];
    }

    std::uint64_t malformed() const noexcept { return malformed_; }

private:
    duplicate_filter seen_;
    std::optional<heard<atirma::location>> location_;
    std::optional<heard<atirma::navigation>> navigation_;
    std::optional<heard<atirma::wind>> wind_;
    std::optional<heard<atirma::power>> power_;
    std::array<std::optional<heard<link_status>>, link_count> links_;
    std::uint64_t malformed_ = 0;
};

} // namespace atirma
