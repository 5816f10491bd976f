#pragma once
#include <cstddef>
#include <string>
#include <utility>
#include <vector>

namespace bench {

/// A socket that closes itself. All of these throw std::system_error that names what failed.
class fd {
public:
    fd() = default;
    explicit fd(int raw) noexcept : raw_(raw) {}
    fd(fd&& other) noexcept : raw_(std::exchange(other.raw_, -1)) {}
    fd& operator=(fd&& other) noexcept {
        std::swap(raw_, other.raw_);
        return *this;
    }
    ~fd();

    int get() const noexcept { return raw_; }

private:
    int raw_ = -1;
};

/// Listens on the loopback (tcp) or in the abstract namespace (local: leaves no file); the address for connect_to.
std::pair<fd, std::string> listen_on(const std::string& transport);
fd accept_from(const fd& listener, const std::string& transport);
fd connect_to(const std::string& transport, const std::string& address);
void set_non_blocking(const fd& socket);

/// Sends every datagram back to where it came from; never returns.
[[noreturn]] void echo_datagrams(const fd& socket);
/// False at the end of the stream, or when the peer reset it.
bool read_exactly(const fd& socket, char* out, std::size_t size);
bool write_all(const fd& socket, const char* data, std::size_t size);

} // namespace bench
