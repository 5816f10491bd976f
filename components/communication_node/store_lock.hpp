#pragma once
#include <ise/core/result.hpp>

#include <memory>
#include <string>

namespace atirma {

/// The exclusive right to write to the file of a store: a second store on that file would use positions twice. Copies
/// share it. It ends with the last copy, or with the process. `FILE-lock` is locked and has the id of the process; it
/// stays there when the file is set aside. Another process may read the file meanwhile (`store_reader`).
class store_lock {
public:
    /// "memory:NAME" needs none. Errors: io_failed, also while another store has it, in this process or another;
    /// unauthorized (`ise::check_own_file`).
    static ise::result<store_lock> take(const std::string& file);

private:
    std::shared_ptr<const void> held_;
};

} // namespace atirma
