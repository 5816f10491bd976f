#pragma once
#include <components/curl/curl_transfers.hpp>

#include <memory>
#include <span>
#include <string>

namespace atirma {

/// A connection that libcurl made, encrypted and logged in, as a stream of bytes. Used on its loop, one task at a time.
/// Lifetime: `curl_transfers` outlives it.
class curl_channel {
public:
    /// Connects as `options` say. Errors: those of `curl_easy::failure`, timed_out. Cancellation: terminal.
    static ise::task<ise::result<std::unique_ptr<curl_channel>>> open(curl_transfers& on,
                                                                      std::unique_ptr<curl_easy> options,
                                                                      ise::duration within);
    ~curl_channel();
    curl_channel(const curl_channel&) = delete;
    curl_channel& operator=(const curl_channel&) = delete;

    /// At least one byte. Errors: peer_lost (also at the end of the stream), timed_out (at `until`; nothing is lost).
    /// Cancellation: terminal, nothing is lost.
    ise::task<ise::result<std::size_t>> read_some(std::span<char> into, ise::time_point until);
    /// What can be read at once; 0 where there is nothing. Errors: peer_lost.
    ise::result<std::size_t> try_read(std::span<char> into);
    /// All of it. Errors: peer_lost, timed_out. Cancellation: terminal, a part may have been written.
    ise::task<ise::result<void>> write(std::string what, ise::time_point until);

    std::string server() const;

private:
    struct waits;
    curl_channel(curl_transfers& on, std::unique_ptr<curl_easy> made);
    ise::task<bool> ready(bool to_write, ise::time_point until);
    ise::failure lost(std::string_view why) const;

    curl_transfers& on_;
    std::unique_ptr<curl_easy> easy_;
    std::shared_ptr<waits> waits_;
};

} // namespace atirma
