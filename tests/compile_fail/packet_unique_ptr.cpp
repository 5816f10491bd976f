// expect: ise: a packet cannot hold a pointer
#include <ise/packet/schema.hpp>

#include <memory>
#include <optional>

#ifdef WITHOUT_MISTAKE
struct bad {
    std::optional<int> next;
};
#else
struct bad {
    std::unique_ptr<int> next;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
