#include "sides.hpp"

#include <cstdlib>
#include <string_view>

namespace conformance {
namespace {

std::string_view dynamic_sides() {
    const char* said = std::getenv("ISE_CONFORMANCE_DYNAMIC");
    return said ? said : "";
}

} // namespace

bool dynamic_provider() { return dynamic_sides() == "provider" || dynamic_sides() == "both"; }
bool dynamic_requester() { return dynamic_sides() == "both"; }

} // namespace conformance
