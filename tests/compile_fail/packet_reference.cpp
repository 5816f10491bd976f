// expect: fields of this struct cannot be counted
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    int n;
    int who;
};
#else
struct bad {
    int n;
    int& who;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
