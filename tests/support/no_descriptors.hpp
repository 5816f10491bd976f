#pragma once
#include <sys/resource.h>
#include <unistd.h>

namespace ise_test {

/// This process has all the descriptors that it may open, as long as this lives.
class no_descriptors {
public:
    no_descriptors() {
        ::getrlimit(RLIMIT_NOFILE, &before_);
        int next = ::dup(0);
        ::close(next);
        rlimit none = before_;
        none.rlim_cur = static_cast<rlim_t>(next); // what is open below it stays
        ::setrlimit(RLIMIT_NOFILE, &none);
    }
    ~no_descriptors() { end(); }
    void end() { ::setrlimit(RLIMIT_NOFILE, &before_); }

private:
    rlimit before_{};
};

} // namespace ise_test
