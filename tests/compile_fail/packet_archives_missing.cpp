// expect: include <ise/packet/archive.hpp>
#ifdef WITHOUT_MISTAKE
    #include <ise/packet/archive.hpp>
#endif
#include <ise/packet/schema.hpp>

struct bad {
    int kept = 0;
    template <class A>
    void serialize(A& x) {
        x(kept);
    }
};

const ise::schema& use = ise::schema_of<bad>();
