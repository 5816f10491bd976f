// expect: give it a type
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
enum loose : std::uint8_t { one, two };
struct bad {
    loose l;
};
#else
enum loose { one, two };
struct bad {
    loose l;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
