// expect: use char and std::string
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct bad {
    char letter;
};
#else
struct bad {
    wchar_t letter;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
