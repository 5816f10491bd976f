// The C++ header of `ise types --cpp`: compared with one that this file includes, whose packets are the originals'.
#include "generated_header.inc"

#include <apps/ise/cpp_header.hpp>

#include <ise/packet/schema.hpp>
#include <ise/service/action.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/session/contract.hpp>

#include <support/catch.hpp>

#include <array>
#include <chrono>
#include <cstdint>
#include <fstream>
#include <limits>
#include <map>
#include <optional>
#include <set>
#include <sstream>
#include <string>
#include <test_folders.hpp>
#include <tuple>
#include <variant>
#include <vector>

namespace header_test {

enum class tack : std::int8_t { port = -1, none = 0, starboard = 1 };
struct place {
    double latitude_deg = 28.15, longitude_deg = -15.0;
};
struct log_entry {
    std::uint64_t number = 18'446'744'073'709'551'615u;
    std::int64_t least = std::numeric_limits<std::int64_t>::min();
    float factor = 0.1f;
    double never = std::numeric_limits<double>::infinity();
    bool good = true;
    char letter = 'x';
    std::string text = "say \"hello\"\n\xc3\xb1?";
    tack on = tack::starboard;
    std::chrono::milliseconds length{1500};
    std::chrono::sys_time<std::chrono::microseconds> at{};
    std::optional<place> where;
    std::vector<place> track;
    std::array<double, 3> axes{};
    std::map<std::string, std::uint16_t> counts;
    std::set<tack> tacks;
    std::variant<std::string, place> either;
    std::tuple<int, std::string> both;
};
struct place_2 { // of another service, by the same name as a copy of `place`
    std::string name;
};
struct grid {
    bool operator<(const grid& other) const { return x < other.x; }
    int x = 0;
};
struct chart {
    std::map<grid, int> soundings;
};
struct order {
    std::string mode = "hold";
};

constexpr ise::request_response<order, log_entry> helm{"helm"};
constexpr ise::subscription<place> position{"position"};
constexpr ise::subscription<place, order> watched{"watched.by-name"};
constexpr ise::subscription<chart> charts{"charts"};
constexpr ise::action<place, place_2, log_entry> sail_to{"sail_to"};

std::string committed() {
    std::ifstream file(ISE_SOURCE_DIR "/tests/unit/cli/generated_header.inc");
    std::ostringstream text;
    text << file.rdbuf();
    return text.str();
}

std::string written() {
    std::vector<ise::cli::header_part> parts(2);
    parts[0].component = "atirma/boat";
    parts[0].services = {ise::dynamic_contract::of(helm), ise::dynamic_contract::of(position),
                         ise::dynamic_contract::of(watched), ise::dynamic_contract::of(charts)};
    parts[1].component = "atirma/new/7th";
    parts[1].services = {ise::dynamic_contract::of(sail_to)};
    return ise::cli::cpp_header(parts);
}

template <class A, class B>
void same(const A&, const B&) {
    CHECK(A::types().fingerprints == B::types().fingerprints);
}

} // namespace header_test

TEST_CASE("cli: the header of a component is the one that is compiled here") {
    using namespace header_test;
    CHECK(written() == committed());
}

TEST_CASE("cli: packets of a written header have the fingerprints and the defaults of the originals") {
    using namespace header_test;
    same(helm, atirma::boat::helm);
    same(position, atirma::boat::position);
    same(watched, atirma::boat::watched_by_name);
    same(sail_to, atirma::new_::_7th::sail_to);
    CHECK(atirma::boat::watched_by_name.name() == "watched.by-name");
    CHECK(ise::schema_of<atirma::boat::log_entry>().text() == ise::schema_of<log_entry>().text());
    CHECK(ise::schema_of<atirma::boat::place>().text() == ise::schema_of<place>().text());
}
