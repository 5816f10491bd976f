#pragma once
#include <ise/core/error.hpp>

#include <optional>
#include <utility>
#include <variant>

namespace ise {

/// A value or the failure that stands in its place. `value()` throws `ise::error` on a failure.
template <class T>
class [[nodiscard]] result {
public:
    /// What it holds on success.
    using value_type = T;

    /// What Asio passes beside an exception: a failure that nobody looks at.
    result() : result(failure(errc::cancelled, "there is no outcome")) {}
    /// Success.
    result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
    /// Failure.
    result(failure why) : state_(std::in_place_index<1>, std::move(why)) {}

    /// Whether there is a value.
    bool has_value() const noexcept { return state_.index() == 0; }
    /// Whether there is a value.
    explicit operator bool() const noexcept { return has_value(); }

    /// The value, or throws the failure as `ise::error`; so do the two below.
    T& value() & { return check(), *std::get_if<0>(&state_); }
    /// As above.
    const T& value() const& { return check(), *std::get_if<0>(&state_); }
    /// As above; moves the value out.
    T&& value() && { return check(), std::move(*std::get_if<0>(&state_)); }

    /// The value; only where `has_value()`, as the three below.
    T& operator*() noexcept { return *std::get_if<0>(&state_); }
    /// As above.
    const T& operator*() const noexcept { return *std::get_if<0>(&state_); }
    /// As above.
    T* operator->() noexcept { return std::get_if<0>(&state_); }
    /// As above.
    const T* operator->() const noexcept { return std::get_if<0>(&state_); }

    /// Only where `!has_value()`.
    const failure& error() const noexcept { return *std::get_if<1>(&state_); }

private:
    void check() const {
        if (!has_value()) throw ise::error(error());
    }

    std::variant<T, failure> state_;
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

    /// Whether it went well.
    bool has_value() const noexcept { return !why_; }
    /// Whether it went well.
    explicit operator bool() const noexcept { return has_value(); }
    /// Throws the failure as `ise::error`, if there is one.
    void value() const {
        if (why_) throw ise::error(*why_);
    }
    /// Only where `!has_value()`.
    const failure& error() const noexcept { return *why_; }

private:
    std::optional<failure> why_;
};

} // namespace ise
