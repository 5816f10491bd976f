// expect: ise: a packet cannot hold a view, which owns nothing
#include <ise/packet/schema.hpp>

#include <string>
#include <string_view>

#ifdef WITHOUT_MISTAKE
struct bad {
    std::string text;
};
#else
struct bad {
    std::string_view text;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
