#pragma once
#include <ise/core/asio_names.hpp>

#include <memory>
#include <utility>

namespace ise {

/// An executor of the embedding program, or none. Made of any executor of Asio, where <ise/asio.hpp> is included.
class program_executor {
public:
    program_executor() = default;
    template <class Executor>
    program_executor(Executor executor) // NOLINT: converts, as asio::any_io_executor does
        : executor_(std::make_shared<const asio::any_io_executor>(std::move(executor))) {
        static_assert(
            requires { sizeof(detail::asio_edge<Executor>); }, "ise: to pass an executor, include <ise/asio.hpp>");
    }

    explicit operator bool() const noexcept { return executor_ != nullptr; }
    const asio::any_io_executor& operator*() const noexcept { return *executor_; }

private:
    std::shared_ptr<const asio::any_io_executor> executor_;
};

} // namespace ise
