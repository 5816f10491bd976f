#pragma once
#include <sqlite3.h>

namespace seal_store_test {

/// While it lives, what SQLite does to files goes through it: the n-th change (open, write, fsync, truncate, delete)
/// fails, and so do all later ones, as if the host had died there. One at a time.
class failing_disk {
public:
    enum class fault { io_error, full };

    failing_disk();
    ~failing_disk();
    failing_disk(const failing_disk&) = delete;
    failing_disk& operator=(const failing_disk&) = delete;

    /// The change number `n` from now on, counted from 0, fails.
    void fail_at(int n, fault how = fault::io_error, bool for_ever = true);
    /// Nothing fails any more.
    void repair();
    /// Whether a change failed since `fail_at`.
    bool failed() const;
};

} // namespace seal_store_test
