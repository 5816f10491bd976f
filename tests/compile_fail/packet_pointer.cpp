// expect: std::optional
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    int n;
    std::string who;
};
#else
struct bad {
    int n;
    const char* who;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
