#include <components/coast/coast.hpp>

#include <nlohmann/json.hpp>

namespace atirma {

extern const char* const coast_text; // coast.json

namespace {

struct coast {
    std::vector<coast_ring> rings;
    std::string attribution;
};

const coast& read() {
    static const coast made = [] {
        auto file = nlohmann::json::parse(coast_text);
        coast c;
        c.attribution = file.at("attribution").get<std::string>();
        for (const auto& feature : file.at("features")) {
            coast_ring ring;
            ring.name = feature.at("properties").at("name").get<std::string>();
            for (const auto& point : feature.at("geometry").at("coordinates").at(0))
                ring.points.push_back({point.at(1).get<double>(), point.at(0).get<double>()});
            c.rings.push_back(std::move(ring));
        }
        return c;
    }();
    return made;
}

} // namespace

const std::vector<coast_ring>& coast_rings() { return read().rings; }

const std::vector<coast_place>& coast_places() {
    static const std::vector<coast_place> places{
        {"Gran Canaria", {27.97, -15.60}, false},    {"La Isleta", {28.1640, -15.4245}, false},
        {"Las Palmas", {28.106, -15.433}, false},    {"Bahía del Confital", {28.143, -15.456}, true},
        {"El Confital", {28.1555, -15.4375}, false},
    };
    return places;
}

const std::string& coast_attribution() { return read().attribution; }

} // namespace atirma
