// expect: specialise ise::opaque_type
#include <ise/packet/archive.hpp>
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct loose {
    std::vector<int> v;
    template <class A>
    void serialize(A& x) {
        x(v);
    }
};
struct bad {
    loose l;
};
#else
struct loose {
    std::vector<int> v;
    template <class A>
    void serialize(A& x) {
        x(cereal::make_size_tag(v.size()));
    }
};
struct bad {
    loose l;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
