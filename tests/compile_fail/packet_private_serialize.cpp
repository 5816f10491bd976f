// expect: include <ise/packet/archive.hpp>
#ifdef WITHOUT_MISTAKE
    #include <ise/packet/archive.hpp>
#endif
#include <ise/packet/schema.hpp>

// Nothing of cereal was included: it must not be taken apart as a plain struct here, and go by its serialize elsewhere.
struct bad {
    int kept = 0;

private:
    friend class cereal::access;
    template <class A>
    void serialize(A& x) {
        x(kept);
    }
};

const ise::schema& use = ise::schema_of<bad>();
