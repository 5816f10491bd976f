// expect: use std::variant
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct one {
    int a;
};
struct bad {
    one o;
};
#else
union one {
    int a;
};
struct bad {
    one o;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
