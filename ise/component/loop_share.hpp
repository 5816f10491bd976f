#pragma once
#include <ise/core/loop.hpp>

#include <atomic>
#include <memory>

namespace ise {

/// A loop that one component runs on, or several together.
struct loop_share {
    loop_share(std::unique_ptr<loop_host> runs, bool on_foreign_executor) : host(std::move(runs)), adopted(on_foreign_executor) {}

    std::unique_ptr<loop_host> host;
    const bool adopted;             ///< it runs on an executor of the embedding program
    std::atomic<int> unfinished{0}; ///< components that have not stopped; the last one ends an adopted loop
};

} // namespace ise
