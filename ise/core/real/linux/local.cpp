#include <ise/core/real/socket_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/error.hpp>
#include <asio/local/stream_protocol.hpp>

#include <fmt/format.h>

#include <cerrno>
#include <cstring>

#include <sys/stat.h>
#include <unistd.h>

namespace ise::real {
namespace {

using local = asio::local::stream_protocol;

// `@name` is Linux' abstract namespace: no file, gone with its process.
local::endpoint address_of(const endpoint& at) {
    std::string path = at.path;
    if (path.starts_with('@')) path.front() = '\0';
    return local::endpoint(path);
}

using accepted = std::pair<std::error_code, std::unique_ptr<stream>>;

class local_listener final : public listener {
public:
    local_listener(loop& on, owned_fd listening, endpoint where, ino_t file)
        : on_(on), acceptor_(on, std::move(listening)), where_(std::move(where)), file_(file) {}
    ~local_listener() override { remove_file(); }

    std::error_code watch() { return acceptor_.watch(); }
    task<accepted> accept() override {
        auto& on = on_; // this may be gone afterwards
        auto peer = where_.text();
        auto [problem, socket] = co_await acceptor_.accept();
        if (problem) co_return accepted(problem, nullptr);
        co_return socket_stream::of(on, std::move(socket), std::move(peer));
    }
    void close() override {
        acceptor_.close();
        remove_file();
    }
    endpoint where() const override { return where_; }

private:
    // Only the file that this listener made: another may have taken its place.
    void remove_file() {
        struct stat now {};
        if (file_ != 0 && ::stat(where_.path.c_str(), &now) == 0 && now.st_ino == file_) ::unlink(where_.path.c_str());
        file_ = 0;
    }

    loop& on_;
    socket_acceptor acceptor_;
    endpoint where_;
    ino_t file_;
};

// Whether there is a file that is no socket.
bool is_other_file(const std::string& path) {
    struct stat found {};
    return ::lstat(path.c_str(), &found) == 0 && !S_ISSOCK(found.st_mode);
}

// A socket's file outlives a killed process: one at which nobody listens any more may be replaced.
bool nobody_listens(const local::endpoint& at) {
    auto probe = new_socket(AF_UNIX, SOCK_STREAM);
    return probe && ::connect(probe.get(), at.data(), static_cast<socklen_t>(at.size())) != 0 && errno == ECONNREFUSED;
}

bool bind_to(const owned_fd& socket, const local::endpoint& at) {
    return ::bind(socket.get(), at.data(), static_cast<socklen_t>(at.size())) == 0;
}

} // namespace

task<result<std::unique_ptr<stream>>> connect_local(loop& on, endpoint to) {
    auto address = address_of(to);
    sockaddr_storage target{};
    std::memcpy(&target, address.data(), address.size());
    auto size = static_cast<socklen_t>(address.size());
    auto [problem, line] = co_await socket_stream::connect(on, target, size, to.text());
    if (problem == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
    if (problem) co_return connect_failure(to, problem);
    co_return std::move(line);
}

result<std::unique_ptr<listener>> listen_local(loop& on, const endpoint& at) {
    std::error_code problem;
    auto refuse = [&] { return io_failure(fmt::format("cannot listen on {}", at.text()), problem); };
    auto refuse_for_last = [&] {
        problem = last_system_error();
        return refuse();
    };

    auto socket = new_socket(AF_UNIX, SOCK_STREAM);
    if (!socket) return refuse_for_last();
    const auto address = address_of(at);
    const bool file = !at.path.starts_with('@');
    bool bound = bind_to(socket, address);
    if (!bound) {
        problem = last_system_error();
        if (problem.value() == EADDRINUSE && file && is_other_file(at.path)) // a refused connection does not say so
            return failure(errc::io_failed,
                           fmt::format("cannot listen on {}: there is a file that is not a socket", at.text()));
        if (problem.value() != EADDRINUSE || !file || !nobody_listens(address)) return refuse();
        ::unlink(at.path.c_str());
        bound = bind_to(socket, address);
    }
    if (!bound || ::listen(socket.get(), SOMAXCONN) != 0) return refuse_for_last();
    struct stat made {};
    if (file) ::stat(at.path.c_str(), &made);
    auto ear = std::make_unique<local_listener>(on, std::move(socket), at, made.st_ino);
    problem = ear->watch();
    if (problem) return refuse();
    return std::unique_ptr<listener>(std::move(ear));
}

} // namespace ise::real
