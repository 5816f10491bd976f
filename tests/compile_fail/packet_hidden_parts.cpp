// expect: make it a plain struct
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
class shut {
public:
    int a = 0;
};
struct bad {
    shut s;
};
#else
class shut {
    int a = 0;
};
struct bad {
    shut s;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
