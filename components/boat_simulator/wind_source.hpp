#pragma once
#include <components/boat_simulator/boat_model.hpp>

#include <ise/core/result.hpp>

#include <memory>
#include <string_view>
#include <vector>

namespace atirma::simulator {

/// The wind in nautical terms.
struct wind_sample {
    double speed_mps = 0;
    double from_deg = 0; ///< true direction of its origin, 0 <= x < 360
};
wind_vector to_vector(wind_sample w);

/// Wind as a function of model time. Immutable: the same time gives the same wind, in any order of calls.
class wind_source {
public:
    virtual ~wind_source() = default;
    virtual wind_sample at(double time_s) const = 0;
};

std::unique_ptr<wind_source> constant_wind(wind_sample mean);

struct gust_settings {
    double speed_deviation = 0.2; ///< of the mean speed
    double direction_deviation_deg = 12;
    double period_s = 60; ///< of the slowest shift; gusts are several times as frequent
};
/// Smooth gusts and shifts around a mean, from a seed: the same on every machine.
std::unique_ptr<wind_source> gusting_wind(wind_sample mean, std::uint64_t seed, gust_settings gusts = {});

/// A recorded series, interpolated linearly (directions along the shorter arc), repeated at its end.
class recorded_wind final : public wind_source {
public:
    struct entry {
        double time_s;
        wind_sample wind;
    };
    /// At least one entry, times strictly increasing; throws `ise::error` (invalid_argument) otherwise.
    explicit recorded_wind(std::vector<entry> entries);
    wind_sample at(double time_s) const override;
    std::size_t size() const { return entries_.size(); }
    double length_s() const;

private:
    std::vector<entry> entries_;
};

/// A series from CSV text with a header line. Columns by name: time `t_s`; speed `tws_mps`, or in knots `tws_kn` or
/// `tws_vwt_kn`; direction `twd_deg` or `twd_est_deg`. Rows with an empty speed or direction are skipped. All other
/// errors are `malformed`, with `name` and the line number.
ise::result<std::unique_ptr<recorded_wind>> parse_wind_csv(std::string_view csv, std::string_view name);

} // namespace atirma::simulator
