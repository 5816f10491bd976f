// environment-boundary: libcurl owns its sockets
#include <components/curl/curl_channel.hpp>

#include <components/curl/curl_easy.hpp>

#include <ise/core/waiter.hpp>

#include <asio/error.hpp>
#include <asio/posix/stream_descriptor.hpp>
#include <fmt/format.h>

#include <fcntl.h>

namespace atirma {

/// Waits of its own for libcurl's socket, which the engine watches no more: on a duplicate, since one descriptor is not
/// registered twice.
struct curl_channel::waits {
    waits(ise::loop& on, int socket)
        : loop(on), wake(on), descriptor(on.get_executor(), ::fcntl(socket, F_DUPFD_CLOEXEC, 0)) {}
    ise::loop& loop;
    ise::waiter<std::error_code> wake;
    asio::posix::stream_descriptor descriptor;
    bool under_way = false;
};

curl_channel::curl_channel(curl_transfers& on, std::unique_ptr<curl_easy> made) : on_(on), easy_(std::move(made)) {}

curl_channel::~curl_channel() {
    waits_.reset();
    on_.remove(*easy_);
}

ise::task<ise::result<std::unique_ptr<curl_channel>>> curl_channel::open(curl_transfers& on,
                                                                         std::unique_ptr<curl_easy> options,
                                                                         ise::duration within) {
    std::unique_ptr<curl_channel> made(new curl_channel(on, std::move(options))); // it removes the transfer in any case
    made->easy_->set(CURLOPT_CONNECT_ONLY, 1L);
    made->easy_->set(CURLOPT_FORBID_REUSE, 0L); // else it is closed as soon as it is made; libcurl reuses none of these
    on.add(*made->easy_);
    auto outcome = co_await on.end_of(*made->easy_, within);
    if (!outcome) co_return outcome.error();
    curl_socket_t socket = CURL_SOCKET_BAD;
    curl_easy_getinfo(made->easy_->handle(), CURLINFO_ACTIVESOCKET, &socket);
    if (socket == CURL_SOCKET_BAD) co_return made->lost("the connection is gone at once");
    made->waits_ = std::make_shared<waits>(on.on(), socket);
    co_return made;
}

std::string curl_channel::server() const { return easy_->server(); }

ise::failure curl_channel::lost(std::string_view why) const {
    return ise::failure(ise::errc::peer_lost, fmt::format("{}: {}", easy_->server(), why), ise::execution::unknown);
}

ise::result<std::size_t> curl_channel::try_read(std::span<char> into) {
    std::size_t got = 0;
    auto code = curl_easy_recv(easy_->handle(), into.data(), into.size(), &got);
    if (code == CURLE_AGAIN) return std::size_t{0};
    if (code != CURLE_OK) return lost(curl_easy_strerror(code));
    if (got == 0) return lost("the server ended the connection");
    return got;
}

ise::task<ise::result<std::size_t>> curl_channel::read_some(std::span<char> into, ise::time_point until) {
    for (;;) {
        auto got = try_read(into);
        if (!got || *got > 0) co_return got;
        bool may = co_await ready(false, until);
        if (!may)
            co_return ise::failure(ise::errc::timed_out, fmt::format("{}: the server does not answer", easy_->server()),
                                   ise::execution::unknown);
    }
}

ise::task<ise::result<void>> curl_channel::write(std::string what, ise::time_point until) {
    std::string_view rest = what;
    while (!rest.empty()) {
        std::size_t moved = 0;
        auto code = curl_easy_send(easy_->handle(), rest.data(), rest.size(), &moved);
        if (code == CURLE_OK) {
            rest.remove_prefix(moved);
            continue;
        }
        if (code != CURLE_AGAIN) co_return lost(curl_easy_strerror(code));
        bool may = co_await ready(true, until);
        if (!may)
            co_return ise::failure(ise::errc::timed_out, fmt::format("{}: the server does not read", easy_->server()),
                                   ise::execution::unknown);
    }
    co_return ise::result<void>();
}

ise::task<bool> curl_channel::ready(bool to_write, ise::time_point until) {
    auto here = waits_;
    bool late = false;
    ise::timer alarm(here->loop, [&] {
        late = true;
        here->wake.resume({});
    });
    alarm.arm(until);
    if (here->under_way) here->descriptor.cancel(); // of a wait that was given up; its end is not heard
    here->under_way = true;
    auto kind = to_write ? asio::posix::descriptor_base::wait_write : asio::posix::descriptor_base::wait_read;
    here->descriptor.async_wait(kind, [weak = std::weak_ptr(here)](std::error_code problem) {
        auto self = weak.lock();
        if (!self || problem == asio::error::operation_aborted) return;
        self->under_way = false;
        ise::loop::turn in(self->loop);
        self->wake.resume({});
    });
    co_await here->wake.wait(); // throws what it was resumed with
    co_return !late;
}

} // namespace atirma
