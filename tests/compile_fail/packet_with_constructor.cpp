// expect: ise: this class is no aggregate
#include <ise/packet/schema.hpp>

#include <string>

#ifdef WITHOUT_MISTAKE
struct bad {
    std::string text;
};
#else
struct bad {
    bad() = default;
    explicit bad(std::string of) : text(std::move(of)) {}
    std::string text;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
