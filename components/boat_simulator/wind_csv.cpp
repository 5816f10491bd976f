#include <components/boat_simulator/wind_source.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <optional>

namespace atirma::simulator {
namespace {

constexpr double mps_per_knot = 1852.0 / 3600.0;

std::vector<std::string_view> fields_of(std::string_view line) {
    std::vector<std::string_view> fields;
    for (;;) {
        auto comma = line.find(',');
        auto field = line.substr(0, comma);
        while (!field.empty() && field.front() == ' ') field.remove_prefix(1);
        while (!field.empty() && field.back() == ' ') field.remove_suffix(1);
        fields.push_back(field);
        if (comma == std::string_view::npos) return fields;
        line.remove_prefix(comma + 1);
    }
}

std::optional<std::size_t> column(const std::vector<std::string_view>& header,
                                  std::initializer_list<std::string_view> names) {
    for (auto name : names)
        if (auto at = std::find(header.begin(), header.end(), name); at != header.end())
            return static_cast<std::size_t>(at - header.begin());
    return std::nullopt;
}

std::optional<double> number(std::string_view text) {
    double value = 0;
    auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    if (error != std::errc{} || end != text.data() + text.size() || !std::isfinite(value)) return std::nullopt;
    return value;
}

} // namespace

ise::result<std::unique_ptr<recorded_wind>> parse_wind_csv(std::string_view csv, std::string_view name) {
    auto wrong = [&](std::size_t line, std::string what) {
        return ise::failure(ise::errc::malformed, fmt::format("{}:{}: {}", name, line, what));
    };
    std::optional<std::size_t> time, speed, direction;
    double unit = 1;
    std::vector<recorded_wind::entry> entries;
    std::size_t line_number = 0;
    if (csv.substr(0, 3) == "\xEF\xBB\xBF") csv.remove_prefix(3);
    while (!csv.empty()) {
        auto end = csv.find('\n');
        auto line = csv.substr(0, end);
        csv.remove_prefix(end == std::string_view::npos ? csv.size() : end + 1);
        ++line_number;
        if (!line.empty() && line.back() == '\r') line.remove_suffix(1);
        if (line.empty() || line.front() == '#') continue;
        auto fields = fields_of(line);
        if (!time) {
            time = column(fields, {"t_s"});
            speed = column(fields, {"tws_mps"});
            if (!speed) speed = column(fields, {"tws_kn", "tws_vwt_kn"}), unit = mps_per_knot;
            direction = column(fields, {"twd_deg", "twd_est_deg"});
            if (!time) return wrong(line_number, "the header names no column t_s (seconds)");
            if (!speed) return wrong(line_number, "the header names no wind speed: tws_mps, tws_kn or tws_vwt_kn");
            if (!direction) return wrong(line_number, "the header names no wind direction: twd_deg or twd_est_deg");
            continue;
        }
        if (fields.size() <= std::max({*time, *speed, *direction}))
            return wrong(line_number, fmt::format("{} columns, {} are needed", fields.size(),
                                                  std::max({*time, *speed, *direction}) + 1));
        if (fields[*speed].empty() || fields[*direction].empty()) continue; // no measurement
        auto t = number(fields[*time]), v = number(fields[*speed]), d = number(fields[*direction]);
        if (!t) return wrong(line_number, fmt::format("time \"{}\" is not a number", fields[*time]));
        if (!v) return wrong(line_number, fmt::format("wind speed \"{}\" is not a number", fields[*speed]));
        if (!d) return wrong(line_number, fmt::format("wind direction \"{}\" is not a number", fields[*direction]));
        if (*v < 0) return wrong(line_number, fmt::format("wind speed {} is negative", *v));
        if (!entries.empty() && *t <= entries.back().time_s)
            return wrong(line_number, fmt::format("time {} does not follow {}", *t, entries.back().time_s));
        entries.push_back({*t, {*v * unit, wrap_deg(*d)}});
    }
    if (!time) return ise::failure(ise::errc::malformed, fmt::format("{}: no header line", name));
    if (entries.empty())
        return ise::failure(ise::errc::malformed, fmt::format("{}: no row has both wind speed and direction", name));
    return std::make_unique<recorded_wind>(std::move(entries));
}

} // namespace atirma::simulator
