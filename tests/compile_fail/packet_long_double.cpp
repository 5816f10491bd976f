// expect: use double
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    int first;
    double second;
};
#else
struct bad {
    int first;
    long double second;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
