#include <components/gui_client/leg_check.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <optional>
#include <set>

namespace atirma::console {
namespace {

constexpr std::size_t max_lines = 4;
constexpr double heading_ahead_s = 600, heading_at_least_m = 500;

/// A place with the name that people know it by.
struct named_place {
    std::string name;
    waypoint at;
};

class problems {
public:
    explicit problems(const leg_context& now) : now_(now) {}

    std::optional<named_place> boat() const {
        if (!now_.boat.position) return std::nullopt;
        const auto& at = now_.boat.position->value;
        return named_place{"the boat", {at.latitude_deg, at.longitude_deg}};
    }
    void leg(const std::optional<named_place>& from, const named_place& to) {
        if (!from) return place(to);
        if (auto why = now_.limits.trouble(point_of(from->at), point_of(to.at)))
            add(fmt::format("the leg from {} to {} {}", from->name, to.name, *why));
    }
    void place(const named_place& at) {
        if (auto why = now_.limits.trouble(point_of(at.at))) add(fmt::format("{} {}", at.name, *why));
    }
    void course(double heading_deg, double metres) {
        auto from = boat();
        if (!from) return;
        auto land =
            now_.limits.metres_to_land(point_of(from->at), flat_destination(point_of(from->at), heading_deg, metres));
        if (land) add(fmt::format("the heading {:03.0f}° meets land after {:.0f} m", heading_deg, *land));
    }
    void add(std::string line) {
        if (said_.insert(line).second) lines_.push_back(std::move(line));
    }
    std::string text() const {
        std::string made;
        for (std::size_t i = 0; i < std::min(lines_.size(), max_lines); ++i) made += (i ? "\n" : "") + lines_[i];
        if (lines_.size() > max_lines) made += fmt::format("\nand {} more", lines_.size() - max_lines);
        return made;
    }

private:
    const leg_context& now_;
    std::vector<std::string> lines_;
    std::set<std::string> said_;
};

named_place waypoint_of(const std::vector<waypoint>& list, std::size_t i) {
    return {fmt::format("waypoint {}", i + 1), list[i]};
}

void check_list(problems& found, const std::vector<waypoint>& list, std::size_t first) {
    if (list.empty()) return;
    found.leg(found.boat(), waypoint_of(list, std::min(first, list.size() - 1)));
    for (std::size_t i = 0; i < list.size(); ++i)
        if (list.size() == 1) found.place(waypoint_of(list, i));
        else found.leg(waypoint_of(list, i), waypoint_of(list, (i + 1) % list.size()));
}

/// A waypoint that comes to that place of the list, and the legs to and from it.
void check_new(problems& found, std::vector<waypoint> list, std::size_t at, const waypoint& point) {
    at = std::min(at, list.size());
    list.insert(list.begin() + static_cast<std::ptrdiff_t>(at), point);
    auto here = waypoint_of(list, at);
    if (list.size() == 1) return found.leg(found.boat(), here);
    found.leg(waypoint_of(list, (at + list.size() - 1) % list.size()), here);
    found.leg(here, waypoint_of(list, (at + 1) % list.size()));
}

struct check_command {
    problems& found;
    const leg_context& now;

    void operator()(const commands::waypoint_add& to) const { check_new(found, now.mission.points, 255, to.point); }
    void operator()(const commands::waypoint_insert& to) const {
        check_new(found, now.mission.points, to.index, to.point);
    }
    void operator()(const commands::waypoint_delete& which) const {
        auto list = now.mission.points;
        if (which.index >= list.size() || list.size() < 3) return;
        auto before = waypoint_of(list, (which.index + list.size() - 1) % list.size());
        found.leg(before, waypoint_of(list, (which.index + 1u) % list.size()));
    }
    void operator()(const commands::waypoint_select& to) const {
        if (to.index < now.mission.points.size()) found.leg(found.boat(), waypoint_of(now.mission.points, to.index));
    }
    void operator()(const commands::set_mode& to) const {
        if (to.mode == sailing_mode::automatic) check_list(found, now.mission.points, now.mission.active);
        if (to.mode != sailing_mode::hold || !now.boat.sailing) return;
        double speed = now.boat.position ? static_cast<double>(now.boat.position->value.speed_over_ground_mps) : 0;
        found.course(static_cast<double>(now.boat.sailing->value.heading_deg),
                     std::max(heading_at_least_m, heading_ahead_s * speed));
    }
    void operator()(const auto&) const {}
};

} // namespace

std::string leg_trouble(const leg_context& now, const boat_command& command) {
    problems found(now);
    command.visit(check_command{found, now});
    return found.text();
}

std::string leg_trouble(const leg_context& now, const std::vector<waypoint>& list) {
    problems found(now);
    check_list(found, list, 0);
    return found.text();
}

std::string leg_trouble(const leg_context& now, const waypoint& place) {
    problems found(now);
    named_place there{"the place", place};
    found.leg(found.boat(), there);
    const auto& list = now.mission.points; // which it sails on from there
    if (now.mission.active < list.size()) found.leg(there, waypoint_of(list, now.mission.active));
    for (std::size_t i = 0; i < list.size() && list.size() > 1; ++i)
        found.leg(waypoint_of(list, i), waypoint_of(list, (i + 1) % list.size()));
    return found.text();
}

std::string needs_override(const std::string& trouble) {
    auto line = trouble;
    std::replace(line.begin(), line.end(), '\n', ';');
    return "not sent: " + line + "; it takes an override";
}

} // namespace atirma::console
