#pragma once
#include "findings.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <iterator>
#include <string>
#include <string_view>

namespace atirma::stress::svg {

inline constexpr double radians = 3.14159265358979323846 / 180, metres_a_degree = 111'195;

struct box {
    double left, top, width, height;
    double right() const { return left + width; }
    double bottom() const { return top + height; }
};
inline constexpr box chart{40, 96, 1040, 820};
inline constexpr box panel{1104, 96, 256, 820};
inline constexpr box times{150, 968, 1210, 168};

enum shade : std::size_t { over_xbee, over_gprs, over_iridium, afterwards, shades };
struct style {
    const char* colour;
    const char* name;
};
/// The links as the page has them (--l0 to --l2 of components/web_server/page/style.css).
inline constexpr std::array<style, shades> styles{
    {{"#0b6fb8", "XBee"}, {"#137a4a", "GPRS"}, {"#8a3ea8", "Iridium"}, {"#8cc4a6", "GPRS, received later"}}};

/// Text as it may stand in the picture.
inline std::string xml(std::string_view text) {
    std::string safe;
    for (char c : text) {
        if (c == '&') safe += "&amp;";
        else if (c == '<') safe += "&lt;";
        else safe += c;
    }
    return safe;
}

class drawing {
public:
    template <class... A>
    void put(fmt::format_string<A...> how, A&&... what) {
        fmt::format_to(std::back_inserter(all), how, std::forward<A>(what)...);
        all += '\n';
    }
    std::string all;
};

/// Places to points of the picture: a plane is good enough for a bay.
class projection {
public:
    projection(double south, double north, double west, double east) {
        middle_latitude_ = (south + north) / 2;
        middle_longitude_ = (west + east) / 2;
        double wide = (east - west) * std::cos(middle_latitude_ * radians) * metres_a_degree,
               high = (north - south) * metres_a_degree;
        scale_ = std::min(chart.width / wide, chart.height / high);
    }
    double x(double longitude) const {
        return chart.left + chart.width / 2 +
               (longitude - middle_longitude_) * std::cos(middle_latitude_ * radians) * metres_a_degree * scale_;
    }
    double y(double latitude) const {
        return chart.top + chart.height / 2 - (latitude - middle_latitude_) * metres_a_degree * scale_;
    }
    double latitude(double y) const {
        return middle_latitude_ - (y - chart.top - chart.height / 2) / scale_ / metres_a_degree;
    }
    double longitude(double x) const {
        return middle_longitude_ +
               (x - chart.left - chart.width / 2) / scale_ / metres_a_degree / std::cos(middle_latitude_ * radians);
    }
    double pixels(double metres) const { return metres * scale_; }

private:
    double middle_latitude_, middle_longitude_, scale_;
};

/// So that course, track and coast are in the picture.
projection fit(const findings& found);
/// Sea, coast, track and marks, with the furniture of a chart around them.
void draw_chart(drawing& to, const projection& by, const account& of, const findings& found);

} // namespace atirma::stress::svg
