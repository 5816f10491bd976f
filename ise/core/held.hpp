#pragma once
#include <cstddef>
#include <memory>
#include <utility>

namespace ise {

/// Kept alive by those who use it on its loop. They have one share of it together: each of them costs an ordinary
/// count, where a share of its own would cost two locked instructions.
class holdable {
public:
    holdable(const holdable&) = delete;
    holdable& operator=(const holdable&) = delete;

protected:
    holdable() = default;
    ~holdable() = default;

private:
    template <class T>
    friend class held;
    virtual std::shared_ptr<void> share() = 0;

    std::size_t holders_ = 0;
    std::shared_ptr<void> kept_; // while there are holders
};

/// Keeps a `holdable` alive; or nothing. On the loop of that only.
template <class T>
class held {
public:
    held() = default;
    explicit held(T& of) : of_(&of) {
        holdable& base = of;
        if (base.holders_++ == 0) base.kept_ = base.share();
    }
    held(held&& other) noexcept : of_(std::exchange(other.of_, nullptr)) {}
    held& operator=(held&& other) noexcept {
        reset();
        of_ = std::exchange(other.of_, nullptr);
        return *this;
    }
    ~held() { reset(); }

    T* get() const noexcept { return of_; }
    T& operator*() const noexcept { return *of_; }
    T* operator->() const noexcept { return of_; }

    void reset() noexcept {
        if (!of_) return;
        holdable& base = *std::exchange(of_, nullptr);
        if (--base.holders_ == 0) auto last = std::move(base.kept_); // may be the last of all
    }

private:
    T* of_ = nullptr;
};

} // namespace ise
