#pragma once
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <limits>
#include <memory>
#include <new>
#include <utility>

namespace ise {

/// A queue in a ring. Costs nothing before the first element, allocates nothing in steady state, and gives back what an
/// exceptional burst took. Elements are default-constructible and cheap in their moved-from state.
template <class T>
class ring {
public:
    bool empty() const noexcept { return size_ == 0; }
    std::size_t size() const noexcept { return size_; }
    /// From the front.
    T& operator[](std::size_t place) noexcept { return slots_[slot_of(place)]; }
    const T& operator[](std::size_t place) const noexcept { return slots_[slot_of(place)]; }
    T& front() noexcept { return slots_[head_]; }
    const T& front() const noexcept { return slots_[head_]; }

    void push_back(T element) {
        if (size_ == capacity_) [[unlikely]]
            resize(std::max<std::size_t>(std::size_t{capacity_} * 2, 4));
        (*this)[size_++] = std::move(element);
    }

    T pop_front() {
        T first = std::move(slots_[head_]);
        head_ = (head_ + 1) & (capacity_ - 1);
        if (--size_ == 0) drained();
        else ++popped_;
        return first;
    }

    /// Removes what `condition(element)` holds for; the others keep their order.
    template <class Condition>
    void erase_if(Condition condition) {
        for (std::size_t left = size_; left > 0; --left) {
            T element = pop_front();
            if (!condition(element)) push_back(std::move(element));
        }
    }

    void clear() noexcept {
        slots_.reset();
        capacity_ = head_ = size_ = popped_ = 0;
    }

private:
    static constexpr std::size_t kept = 64;

    std::size_t slot_of(std::size_t place) const noexcept { return (head_ + place) & (std::size_t{capacity_} - 1); }

    void resize(std::size_t capacity) {
        if (capacity > std::numeric_limits<count>::max()) throw std::bad_alloc();
        auto grown = std::make_unique<T[]>(capacity);
        for (std::size_t place = 0; place < size_; ++place) grown[place] = std::move((*this)[place]);
        slots_ = std::move(grown);
        capacity_ = static_cast<count>(capacity);
        head_ = 0;
    }

    // What went through since it was last empty says how much room it is worth keeping.
    void drained() noexcept {
        if (capacity_ > kept && popped_ < capacity_ / 8) clear();
        head_ = popped_ = 0;
    }

    using count = std::uint32_t; // a connection has several, most of them empty

    std::unique_ptr<T[]> slots_;
    count capacity_ = 0;
    count head_ = 0;
    count size_ = 0;
    count popped_ = 0;
};

} // namespace ise
