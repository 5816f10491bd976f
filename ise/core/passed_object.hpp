#pragma once
#include <ise/core/bytes.hpp>

#include <cstddef>
#include <memory>
#include <new>
#include <type_traits>
#include <utility>

namespace ise {

class buffer;

/// What a `passed_object` knows of the type that it holds: one constant for each, whose address tells them apart.
struct object_type {
    void (*relocate)(void* from, void* to) noexcept; ///< moves it, and destroys what is left at `from`
    void (*destroy)(void* at) noexcept;
    void (*write)(const void* at, buffer& out); ///< appends the bytes that stand for it; throws what encoding throws
    bytes_view (*encoded)(const void* at) noexcept = nullptr; ///< of an encoded packet: its bytes; else null

    template <class T>
    static constexpr object_type of(void (*write)(const void* at, buffer& out),
                                    bytes_view (*encoded)(const void* at) noexcept = nullptr) {
        return {[](void* from, void* to) noexcept {
                    ::new (to) T(std::move(*static_cast<T*>(from)));
                    static_cast<T*>(from)->~T();
                },
                [](void* at) noexcept { static_cast<T*>(at)->~T(); }, write, encoded};
    }
};

/// An object on its way from one owner to the next, who may be on another thread; or none. Move-only, without an
/// allocation.
class passed_object {
public:
    /// What is larger, or cannot be moved for sure, is held by a pointer.
    static constexpr std::size_t max_bytes = 64;
    template <class T>
    static constexpr bool fits = sizeof(T) <= max_bytes &&
                                 alignof(T) <= alignof(std::max_align_t) && std::is_nothrow_move_constructible_v<T>;

    passed_object() noexcept = default;
    /// `weight`: the bytes that it counts for where bytes are bounded.
    template <class T>
    requires fits<T> passed_object(const object_type& type, T value, std::size_t weight)
    noexcept : type_(&type), weight_(weight) { ::new (static_cast<void*>(storage_)) T(std::move(value)); }
    passed_object(passed_object&& other) noexcept { take(other); }
    passed_object& operator=(passed_object&& other) noexcept {
        if (this == &other) return *this;
        reset();
        take(other);
        return *this;
    }
    ~passed_object() { reset(); }

    explicit operator bool() const noexcept { return type_ != nullptr; }
    /// Null where there is none.
    const object_type* type() const noexcept { return type_; }
    std::size_t weight() const noexcept { return weight_; }
    void* at() noexcept { return storage_; }
    /// Appends the bytes that stand for it; only where there is one. Throws what encoding throws.
    void write(buffer& out) const { type_->write(storage_, out); }
    /// Whether it is an encoded packet, on loan from another process; only where there is one.
    bool is_encoded() const noexcept { return type_->encoded != nullptr; }
    /// Its bytes. Their owner may change them at any time: a reader must read each byte once.
    bytes_view encoded() const noexcept { return type_->encoded(storage_); }

private:
    void reset() noexcept {
        if (const auto* held = std::exchange(type_, nullptr)) held->destroy(storage_);
    }
    void take(passed_object& other) noexcept {
        type_ = std::exchange(other.type_, nullptr);
        weight_ = std::exchange(other.weight_, 0);
        if (type_) type_->relocate(other.storage_, storage_);
    }

    const object_type* type_ = nullptr;
    std::size_t weight_ = 0;
    alignas(std::max_align_t) std::byte storage_[max_bytes];
};

} // namespace ise
