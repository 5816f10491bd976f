#include "sides.hpp"

#include <cstdlib>
#include <string_view>

namespace conformance {
namespace {

std::string_view told() {
    const char* said = std::getenv("ISE_CONFORMANCE_DYNAMIC");
    return said ? said : "";
}

} // namespace

bool dynamic_provider() { return told() == "provider" || told() == "both"; }
bool dynamic_requester() { return told() == "both"; }

} // namespace conformance
