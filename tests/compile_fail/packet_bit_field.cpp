// expect: cannot have bit-fields
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    unsigned a;
    unsigned b;
};
#else
struct bad {
    unsigned a : 3;
    unsigned b : 5;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
