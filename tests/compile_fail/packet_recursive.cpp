// expect: a packet cannot contain itself
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    int n;
    std::vector<int> children;
};
#else
struct bad {
    int n;
    std::vector<bad> children;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
