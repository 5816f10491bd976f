#pragma once
#include <atomic>
#include <exception>
#include <memory>
#include <optional>
#include <type_traits>
#include <utility>
#include <variant>

namespace ise {

/// Thrown to who waits for an outcome that nobody can give any more.
struct outcome_dropped {};

/// What a thread waits for while a coroutine on some loop makes it: as a std::promise and its future, without the
/// weight of <future> in everybody's file. Move-only; dropping it unfulfilled ends the wait by `outcome_dropped`.
template <class T>
class blocking_outcome {
    using value_type = std::conditional_t<std::is_void_v<T>, std::monostate, T>;
    struct shared {
        std::atomic<bool> ended{false};
        std::exception_ptr problem;
        std::optional<value_type> value;
    };

public:
    /// The other end.
    class waiting {
    public:
        explicit waiting(std::shared_ptr<shared> from) noexcept : from_(std::move(from)) {}
        /// Blocks until there is an outcome; once. Throws what the other side gave.
        T get() {
            from_->ended.wait(false);
            if (from_->problem) std::rethrow_exception(std::exchange(from_->problem, nullptr));
            if constexpr (!std::is_void_v<T>) return std::move(*from_->value);
        }

    private:
        std::shared_ptr<shared> from_;
    };

    blocking_outcome() : to_(std::make_shared<shared>()) {}
    blocking_outcome(blocking_outcome&&) noexcept = default;
    blocking_outcome& operator=(blocking_outcome&&) = delete;
    ~blocking_outcome() {
        if (to_) fail(std::make_exception_ptr(outcome_dropped()));
    }

    waiting other_end() const { return waiting(to_); }
    /// Ends the wait; one of the two, once. An exception goes over whole: who gives it keeps no reference, so that the
    /// waiting thread alone reads and destroys it.
    template <class... V>
    void fulfil(V&&... value) {
        to_->value.emplace(std::forward<V>(value)...);
        end();
    }
    void fail(std::exception_ptr problem) {
        to_->problem = std::move(problem);
        end();
    }

private:
    void end() {
        auto to = std::move(to_);
        to->ended.store(true);
        to->ended.notify_all();
    }

    std::shared_ptr<shared> to_;
};

} // namespace ise
