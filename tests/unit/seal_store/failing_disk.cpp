#include "failing_disk.hpp"

#include <new>

namespace seal_store_test {
namespace {

struct counting {
    int left = -1; // -1: nothing fails
    failing_disk::fault how = failing_disk::fault::io_error;
    bool for_ever = true, failed = false;
};
counting now;          // NOLINT: SQLite's functions have no place for it
sqlite3_vfs* original; // NOLINT
sqlite3_vfs shim;      // NOLINT

bool fails() {
    if (now.left < 0) return false;
    if (now.left > 0) {
        --now.left;
        return false;
    }
    now.failed = true;
    if (!now.for_ever) now.left = -1;
    return true;
}
int code(int of_io) { return now.how == failing_disk::fault::full ? SQLITE_FULL : of_io; }

// A file of the original stands behind it.
struct file {
    sqlite3_file base;
    sqlite3_file* inner() { return reinterpret_cast<sqlite3_file*>(this + 1); }
};
file* of(sqlite3_file* f) { return reinterpret_cast<file*>(f); }
template <class Function, class... Args>
int pass(Function sqlite3_io_methods::*what, sqlite3_file* f, Args... args) {
    auto* inner = of(f)->inner();
    return (inner->pMethods->*what)(inner, args...);
}

int io_close(sqlite3_file* f) { return pass(&sqlite3_io_methods::xClose, f); }
int io_read(sqlite3_file* f, void* to, int n, sqlite3_int64 at) {
    return pass(&sqlite3_io_methods::xRead, f, to, n, at);
}
int io_write(sqlite3_file* f, const void* from, int n, sqlite3_int64 at) {
    if (!fails()) return pass(&sqlite3_io_methods::xWrite, f, from, n, at);
    if (n > 1) pass(&sqlite3_io_methods::xWrite, f, from, n / 2, at); // torn
    return code(SQLITE_IOERR_WRITE);
}
int io_truncate(sqlite3_file* f, sqlite3_int64 size) {
    return fails() ? code(SQLITE_IOERR_TRUNCATE) : pass(&sqlite3_io_methods::xTruncate, f, size);
}
int io_sync(sqlite3_file* f, int flags) {
    return fails() ? code(SQLITE_IOERR_FSYNC) : pass(&sqlite3_io_methods::xSync, f, flags);
}
int io_size(sqlite3_file* f, sqlite3_int64* size) { return pass(&sqlite3_io_methods::xFileSize, f, size); }
int io_lock(sqlite3_file* f, int how) { return pass(&sqlite3_io_methods::xLock, f, how); }
int io_unlock(sqlite3_file* f, int how) { return pass(&sqlite3_io_methods::xUnlock, f, how); }
int io_reserved(sqlite3_file* f, int* out) { return pass(&sqlite3_io_methods::xCheckReservedLock, f, out); }
int io_control(sqlite3_file* f, int what, void* with) { return pass(&sqlite3_io_methods::xFileControl, f, what, with); }
int io_sector(sqlite3_file* f) { return pass(&sqlite3_io_methods::xSectorSize, f); }
int io_traits(sqlite3_file* f) { return pass(&sqlite3_io_methods::xDeviceCharacteristics, f); }
int io_shm_map(sqlite3_file* f, int page, int size, int extend, void volatile** to) {
    return pass(&sqlite3_io_methods::xShmMap, f, page, size, extend, to);
}
int io_shm_lock(sqlite3_file* f, int offset, int n, int flags) {
    return pass(&sqlite3_io_methods::xShmLock, f, offset, n, flags);
}
void io_shm_barrier(sqlite3_file* f) {
    auto* inner = of(f)->inner();
    inner->pMethods->xShmBarrier(inner);
}
int io_shm_unmap(sqlite3_file* f, int remove) { return pass(&sqlite3_io_methods::xShmUnmap, f, remove); }

const sqlite3_io_methods* methods() {
    static const sqlite3_io_methods all = [] {
        sqlite3_io_methods made{};
        made.iVersion = 2; // with shared memory, without mapped files
        made.xClose = io_close, made.xRead = io_read, made.xWrite = io_write, made.xTruncate = io_truncate;
        made.xSync = io_sync, made.xFileSize = io_size, made.xLock = io_lock, made.xUnlock = io_unlock;
        made.xCheckReservedLock = io_reserved, made.xFileControl = io_control, made.xSectorSize = io_sector;
        made.xDeviceCharacteristics = io_traits, made.xShmMap = io_shm_map, made.xShmLock = io_shm_lock;
        made.xShmBarrier = io_shm_barrier, made.xShmUnmap = io_shm_unmap;
        return made;
    }();
    return &all;
}

int fs_open(sqlite3_vfs*, const char* name, sqlite3_file* f, int flags, int* out) {
    auto* made = new (f) file;
    made->base.pMethods = nullptr;
    if ((flags & SQLITE_OPEN_CREATE) != 0 && fails()) return code(SQLITE_CANTOPEN);
    int done = original->xOpen(original, name, made->inner(), flags, out);
    if (made->inner()->pMethods) made->base.pMethods = methods();
    return done;
}
int fs_delete(sqlite3_vfs*, const char* name, int sync) {
    return fails() ? code(SQLITE_IOERR_DELETE) : original->xDelete(original, name, sync);
}

} // namespace

failing_disk::failing_disk() {
    original = sqlite3_vfs_find(nullptr);
    shim = *original;
    shim.zName = "failing";
    shim.szOsFile = static_cast<int>(sizeof(file)) + original->szOsFile;
    shim.xOpen = fs_open;
    shim.xDelete = fs_delete;
    repair();
    sqlite3_vfs_register(&shim, 1);
}

failing_disk::~failing_disk() {
    sqlite3_vfs_unregister(&shim);
    sqlite3_vfs_register(original, 1);
}

void failing_disk::fail_at(int n, fault how, bool for_ever) {
    now.left = n;
    now.how = how;
    now.for_ever = for_ever;
    now.failed = false;
}
void failing_disk::repair() { now = counting(); }
bool failing_disk::failed() const { return now.failed; } // NOLINT: of the one that lives

} // namespace seal_store_test
