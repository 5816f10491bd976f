#pragma once
#include <ise/core/loop.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/core/time.hpp>

#include <memory>

namespace atirma {

class curl_easy;

/// Runs libcurl's transfers on one loop, by its multi-socket interface: no thread of its own (but libcurl's for
/// resolving names), no call that blocks. Real world only. Lifetime: outlives its transfers and what was made on it;
/// used on its loop.
class curl_transfers {
public:
    /// Throws ise::error (invalid_argument) on a virtual loop.
    explicit curl_transfers(ise::loop& on);
    ~curl_transfers();
    curl_transfers(const curl_transfers&) = delete;
    curl_transfers& operator=(const curl_transfers&) = delete;

    ise::loop& on() const noexcept;

    /// Begins a transfer. It ends with `remove`, at once if it still runs; its connection too, unless it has ended.
    void add(curl_easy& what);
    void remove(curl_easy& what) noexcept;
    /// Waits until a transfer has ended. Success: it went well. Errors: those of `curl_easy::failure`, timed_out after
    /// `within`. Cancellation: terminal. In both cases the transfer goes on until it is removed.
    ise::task<ise::result<void>> end_of(curl_easy& what, ise::duration within);
    /// All of it: add, end_of, remove; also when it is cancelled.
    ise::task<ise::result<void>> run(curl_easy& what, ise::duration within);

private:
    class state;
    std::shared_ptr<state> state_;
};

} // namespace atirma
