// expect: make the base its first field
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct base {
    int a;
};
struct bad {
    int b;
};
#else
struct base {
    int a;
};
struct bad : base {
    int b;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
