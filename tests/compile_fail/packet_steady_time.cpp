// expect: use a std::chrono::system_clock time point
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    std::chrono::system_clock::time_point at;
};
#else
struct bad {
    std::chrono::steady_clock::time_point at;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
