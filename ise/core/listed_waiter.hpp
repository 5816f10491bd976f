#pragma once
#include <ise/core/waiter.hpp>

#include <vector>

namespace ise {

/// A waiter in a list, for as long as it lives: one of several coroutines that wait for the same. The list outlives it,
/// and is resumed one by one.
class listed_waiter {
public:
    listed_waiter(loop& owner, std::vector<waiter<>*>& among) : waiter_(owner), among_(among) {
        among_.push_back(&waiter_);
    }
    ~listed_waiter() { std::erase(among_, &waiter_); }
    listed_waiter(const listed_waiter&) = delete;
    listed_waiter& operator=(const listed_waiter&) = delete;

    waiter<>::operation wait() noexcept { return waiter_.wait(); }
    void resume() { waiter_.resume(); }

private:
    waiter<> waiter_;
    std::vector<waiter<>*>& among_;
};

} // namespace ise
