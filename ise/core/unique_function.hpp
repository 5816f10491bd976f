#pragma once
#include <concepts>
#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>

namespace ise {

template <class Signature, std::size_t InlineSize = 48>
class unique_function;

/// A move-only `std::function`: what fits into `InlineSize` bytes is held without an allocation.
template <class R, class... A, std::size_t InlineSize>
class unique_function<R(A...), InlineSize> {
    struct operations {
        R (*call)(void*, A...);
        void (*move)(void* from, void* to) noexcept; // constructs at `to`, destroys at `from`
        void (*destroy)(void*) noexcept;
    };

    template <class F>
    static constexpr bool fits = sizeof(F) <= InlineSize &&
                                 alignof(F) <= alignof(std::max_align_t) && std::is_nothrow_move_constructible_v<F>;

    template <class F>
    static constexpr operations inline_operations{
        [](void* at, A... arguments) -> R { return (*static_cast<F*>(at))(std::forward<A>(arguments)...); },
        [](void* from, void* to) noexcept {
            ::new (to) F(std::move(*static_cast<F*>(from)));
            static_cast<F*>(from)->~F();
        },
        [](void* at) noexcept { static_cast<F*>(at)->~F(); }};

    template <class F>
    static constexpr operations heap_operations{
        [](void* at, A... arguments) -> R { return (**static_cast<F**>(at))(std::forward<A>(arguments)...); },
        [](void* from, void* to) noexcept { ::new (to) F*(*static_cast<F**>(from)); },
        [](void* at) noexcept { delete *static_cast<F**>(at); }};

public:
    unique_function() noexcept = default;
    unique_function(std::nullptr_t) noexcept {}

    template <class F>
    requires(!std::same_as<std::remove_cvref_t<F>, unique_function> && std::is_invocable_r_v<R, F&, A...>)
        unique_function(F&& callable) {
        hold(std::forward<F>(callable));
    }
    template <class F>
    requires(!std::same_as<std::remove_cvref_t<F>, unique_function> &&
             std::is_invocable_r_v<R, F&, A...>) unique_function&
    operator=(F&& callable) {
        reset();
        hold(std::forward<F>(callable));
        return *this;
    }

    unique_function(unique_function&& other) noexcept { take(other); }
    unique_function& operator=(unique_function&& other) noexcept {
        if (this != &other) {
            reset();
            take(other);
        }
        return *this;
    }
    ~unique_function() { reset(); }

    explicit operator bool() const noexcept { return operations_ != nullptr; }
    R operator()(A... arguments) { return operations_->call(storage_, std::forward<A>(arguments)...); }

private:
    template <class F>
    void hold(F&& callable) {
        using held = std::decay_t<F>;
        if constexpr (fits<held>) {
            ::new (static_cast<void*>(storage_)) held(std::forward<F>(callable));
            operations_ = &inline_operations<held>;
        } else {
            ::new (static_cast<void*>(storage_)) held*(new held(std::forward<F>(callable)));
            operations_ = &heap_operations<held>;
        }
    }
    void reset() noexcept {
        if (auto* held = std::exchange(operations_, nullptr)) held->destroy(storage_);
    }
    void take(unique_function& other) noexcept {
        operations_ = std::exchange(other.operations_, nullptr);
        if (operations_) operations_->move(other.storage_, storage_);
    }

    alignas(std::max_align_t) std::byte storage_[InlineSize];
    const operations* operations_ = nullptr;
};

} // namespace ise
