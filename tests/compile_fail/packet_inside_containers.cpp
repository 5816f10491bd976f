// expect: use double
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    std::map<int, std::vector<std::optional<double>>> deep;
};
#else
struct bad {
    std::map<int, std::vector<std::optional<long double>>> deep;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
