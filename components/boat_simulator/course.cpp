#include <components/boat_simulator/course.hpp>

namespace atirma::simulator {

std::optional<course> find_course(std::string_view name) {
    if (name == "T1") return course{"T1", {{28.1530, -15.4480}, {28.1600, -15.4520}, {28.1545, -15.4580}}};
    if (name == "T2") return course{"T2", {{28.1600, -15.4600}, {28.1680, -15.4560}, {28.1640, -15.4690}}};
    return std::nullopt;
}

} // namespace atirma::simulator
