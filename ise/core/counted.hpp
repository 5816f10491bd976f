#pragma once
#include <atomic>
#include <cstdint>
#include <utility>

namespace ise {

/// A value that several hold, on any thread; the last one destroys it. Unlike a shared_ptr its maker can tell that it
/// is the only holder (again), and may then fill the value anew instead of allocating another one.
template <class T>
class counted {
public:
    counted() = default;
    counted(const counted& other) noexcept : cell_(other.cell_) {
        if (cell_) hold();
    }
    counted(counted&& other) noexcept : cell_(std::exchange(other.cell_, nullptr)) {}
    counted& operator=(counted other) noexcept {
        std::swap(cell_, other.cell_);
        return *this;
    }
    ~counted() {
        if (cell_) release();
    }

    template <class... A>
    static counted make(A&&... arguments) {
        counted made;
        made.cell_ = new cell(std::forward<A>(arguments)...);
        return made;
    }

    explicit operator bool() const noexcept { return cell_ != nullptr; }
    T& operator*() const noexcept { return cell_->value; }
    T* get() const noexcept { return cell_ ? &cell_->value : nullptr; }

    /// Whether nobody else holds it; what others did with it then happened before.
    bool alone() const noexcept { return cell_->holders.load(std::memory_order_acquire) == 1; }

private:
    struct cell {
        template <class... A>
        explicit cell(A&&... arguments) : value(std::forward<A>(arguments)...) {}
        T value;
        std::atomic<std::uint32_t> holders{1};
    };

    void hold() noexcept {
        // Nobody can join or leave meanwhile where this is the only holder: no locked instruction is needed.
        if (alone()) cell_->holders.store(2, std::memory_order_relaxed);
        else cell_->holders.fetch_add(1, std::memory_order_relaxed);
    }
    void release() noexcept {
        if (alone() || cell_->holders.fetch_sub(1, std::memory_order_acq_rel) == 1) delete cell_;
    }

    cell* cell_ = nullptr;
};

} // namespace ise
