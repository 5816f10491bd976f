#pragma once
#if __has_include(<catch2/catch_all.hpp>)
    #include <catch2/catch_all.hpp>
    #define ISE_CATCH2_3
#else
    #include <catch2/catch.hpp>
#endif

#include <string>

#ifdef ISE_CATCH2_3
using Catch::Approx; // as in Catch2 2
#endif

namespace ise_test {

using Catch::Matchers::EndsWith;
using Catch::Matchers::Equals;
using Catch::Matchers::StartsWith;
#ifdef ISE_CATCH2_3
/// Matches a text with this part. (Contains is for elements of a range in Catch2 3.)
inline auto Contains(const std::string& part) { return Catch::Matchers::ContainsSubstring(part); }
#else
using Catch::Matchers::Contains;
#endif

/// This test cannot run here: ctest reports it as skipped. To be followed by `return` (Catch2 2 has no SKIP of its
/// own), before anything was checked.
inline void skip(const std::string& why) {
#ifdef SKIP
    SKIP(why);
#else
    WARN("test skipped: " << why);
#endif
}

} // namespace ise_test
