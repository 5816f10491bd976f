#pragma once
#include <ise/core/error.hpp>

#include <memory>
#include <optional>
#include <type_traits>
#include <utility>

namespace ise {

/// A value or a failure. `value()` throws a failure as `ise::error`.
template <class T>
class [[nodiscard]] result {
public:
    /// The type of the value.
    using value_type = T;

    /// Used by Asio together with an exception: a failure without meaning.
    result() : result(failure(errc::cancelled, "there is no outcome")) {}
    /// Success.
    result(T value) : value_(std::move(value)), has_value_(true) {}
    /// Failure.
    result(failure why) : why_(std::move(why)) {}
    /// Copies, if T can be copied.
    result(const result& other) requires std::is_copy_constructible_v<T> { take(other); }
    /// Moves the other's value or failure.
    result(result&& other) noexcept(std::is_nothrow_move_constructible_v<T>) { take(std::move(other)); }
    /// The same, or a copy. If moving the value throws, the result is the failure `cancelled`.
    result& operator=(result other) noexcept(std::is_nothrow_move_constructible_v<T>) {
        drop();
        if constexpr (std::is_nothrow_move_constructible_v<T>) {
            take(std::move(other));
        } else {
            try {
                take(std::move(other));
            } catch (...) {
                std::construct_at(&why_, errc::cancelled, "not moved");
                has_value_ = false;
                throw;
            }
        }
        return *this;
    }
    ~result() { drop(); }

    /// Whether there is a value.
    bool has_value() const noexcept { return has_value_; }
    /// Whether there is a value.
    explicit operator bool() const noexcept { return has_value(); }

    /// Returns the value, or throws the failure as `ise::error`; so do the two below.
    T& value() & { return check(), value_; }
    /// As above.
    const T& value() const& { return check(), value_; }
    /// As above; moves the value out.
    T&& value() && { return check(), std::move(value_); }

    /// The value; requires `has_value()`, as do the three below.
    T& operator*() noexcept { return value_; }
    /// As above.
    const T& operator*() const noexcept { return value_; }
    /// As above.
    T* operator->() noexcept { return &value_; }
    /// As above.
    const T* operator->() const noexcept { return &value_; }

    /// The failure; requires `!has_value()`.
    const failure& error() const noexcept { return why_; }

private:
    void check() const {
        if (!has_value()) throw ise::error(error());
    }

    // By hand: std::variant costs every file of a user more than all of this. Which of the two is there is read once
    // each time: else g++ 12 warns that one is used that was never made.
    void drop() noexcept {
        if (has_value_) std::destroy_at(&value_);
        else std::destroy_at(&why_);
    }
    template <class Other>
    void take(Other&& other) {
        const bool from_value = other.has_value_;
        if (from_value) std::construct_at(&value_, std::forward<Other>(other).value_);
        else std::construct_at(&why_, std::forward<Other>(other).why_);
        has_value_ = from_value;
    }

    union {
        T value_;
        failure why_;
    };
    bool has_value_ = false;
};

/// Success without a value, or a failure.
template <>
class [[nodiscard]] result<void> {
public:
    /// Success has no value.
    using value_type = void;

    result() = default;
    /// Failure.
    result(failure why) : why_(std::move(why)) {}

    /// Whether it is a success.
    bool has_value() const noexcept { return !why_; }
    /// Whether it is a success.
    explicit operator bool() const noexcept { return has_value(); }
    /// Throws the failure as `ise::error`, if there is one.
    void value() const {
        if (why_) throw ise::error(*why_);
    }
    /// The failure; requires `!has_value()`.
    const failure& error() const noexcept { return *why_; }

private:
    std::optional<failure> why_;
};

} // namespace ise
