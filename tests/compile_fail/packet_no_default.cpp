// expect: give this type or the field a default
#include <ise/packet/archive.hpp>
#include <ise/packet/schema.hpp>

#include <chrono>
#include <map>
#include <optional>
#include <string>
#include <vector>

#ifdef WITHOUT_MISTAKE
struct strict {
    strict();
    int a;
    template <class A>
    void serialize(A& x) {
        x(a);
    }
};
struct bad {
    strict s;
};
#else
struct strict {
    strict(int);
    int a;
    template <class A>
    void serialize(A& x) {
        x(a);
    }
};
struct bad {
    strict s;
};
#endif

const ise::schema& use = ise::schema_of<bad>();
