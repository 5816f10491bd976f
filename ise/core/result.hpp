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
    using value_type = T;

    /// What Asio passes beside an exception: a failure that nobody looks at.
    result() : result(failure(errc::cancelled, "there is no outcome")) {}
    result(T value) : state_(std::in_place_index<0>, std::move(value)) {}
    result(failure why) : state_(std::in_place_index<1>, std::move(why)) {}

    bool has_value() const noexcept { return state_.index() == 0; }
    explicit operator bool() const noexcept { return has_value(); }

    T& value() & { return check(), *std::get_if<0>(&state_); }
    const T& value() const& { return check(), *std::get_if<0>(&state_); }
    T&& value() && { return check(), std::move(*std::get_if<0>(&state_)); }

    T& operator*() noexcept { return *std::get_if<0>(&state_); }
    const T& operator*() const noexcept { return *std::get_if<0>(&state_); }
    T* operator->() noexcept { return std::get_if<0>(&state_); }
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
    using value_type = void;

    result() = default;
    result(failure why) : why_(std::move(why)) {}

    bool has_value() const noexcept { return !why_; }
    explicit operator bool() const noexcept { return has_value(); }
    void value() const {
        if (why_) throw ise::error(*why_);
    }
    /// Only where `!has_value()`.
    const failure& error() const noexcept { return *why_; }

private:
    std::optional<failure> why_;
};

} // namespace ise
