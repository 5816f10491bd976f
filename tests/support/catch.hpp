#pragma once
#if __has_include(<catch2/catch_all.hpp>)
    #include <catch2/catch_all.hpp>
#else
    #include <catch2/catch.hpp>
#endif

#include <string>

namespace ise_test {

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
