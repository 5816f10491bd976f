#pragma once
#include <atomic>
#include <cstdint>
#include <utility>

namespace ise {

/// What `counted` values have in common, whatever their type.
struct counted_cell {
    explicit counted_cell(void (*how)(counted_cell*) noexcept) : destroy(how) {}
    void (*const destroy)(counted_cell*) noexcept;
    std::atomic<std::uint32_t> holders{1};
};

/// Holds a `counted` value without its type.
class counted_holder {
public:
    counted_holder() = default;
    counted_holder(const counted_holder& other) noexcept : cell_(other.cell_) {
        if (cell_) hold();
    }
    counted_holder(counted_holder&& other) noexcept : cell_(std::exchange(other.cell_, nullptr)) {}
    counted_holder& operator=(counted_holder other) noexcept {
        std::swap(cell_, other.cell_);
        return *this;
    }
    ~counted_holder() {
        if (cell_) release();
    }

    explicit operator bool() const noexcept { return cell_ != nullptr; }
    /// Whether nobody else holds it; what others did with it then happened before.
    bool alone() const noexcept { return cell_->holders.load(std::memory_order_acquire) == 1; }

private:
    template <class T>
    friend class counted;

    void hold() noexcept {
        // Nobody can join or leave meanwhile where this is the only holder: no locked instruction is needed.
        if (alone()) cell_->holders.store(2, std::memory_order_relaxed);
        else cell_->holders.fetch_add(1, std::memory_order_relaxed);
    }
    void release() noexcept {
        if (alone() || cell_->holders.fetch_sub(1, std::memory_order_acq_rel) == 1) cell_->destroy(cell_);
    }

    counted_cell* cell_ = nullptr;
};

/// A value that several hold, on any thread; the last one destroys it. Unlike a shared_ptr its maker can tell that it
/// is the only holder (again), and may then fill the value anew instead of allocating another one.
template <class T>
class counted {
public:
    counted() = default;
    /// One of this type.
    explicit counted(counted_holder untyped) noexcept : holder_(std::move(untyped)) {}

    template <class... A>
    static counted make(A&&... arguments) {
        counted made;
        made.holder_.cell_ = new cell(std::forward<A>(arguments)...);
        return made;
    }

    explicit operator bool() const noexcept { return static_cast<bool>(holder_); }
    T& operator*() const noexcept { return *get(); }
    T* get() const noexcept { return holder_ ? &static_cast<cell*>(holder_.cell_)->value : nullptr; }

    /// Whether nobody else holds it; what others did with it then happened before.
    bool alone() const noexcept { return holder_.alone(); }
    /// The same without its type.
    const counted_holder& untyped() const noexcept { return holder_; }

private:
    struct cell final : counted_cell {
        template <class... A>
        explicit cell(A&&... arguments)
            : counted_cell([](counted_cell* unheld) noexcept { delete static_cast<cell*>(unheld); }),
              value(std::forward<A>(arguments)...) {}
        T value;
    };

    counted_holder holder_;
};

} // namespace ise
