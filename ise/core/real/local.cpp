#include <ise/core/real/descriptor_stream.hpp>
#include <ise/core/real/sockets.hpp>

#include <asio/local/stream_protocol.hpp>

#include <fmt/format.h>

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

std::unique_ptr<stream> as_stream(local::socket socket, std::string peer) {
    std::error_code ignored;
    socket.non_blocking(true, ignored);
    return std::make_unique<descriptor_stream<local::socket>>(std::move(socket), std::move(peer));
}

class local_listener final : public listener {
public:
    local_listener(local::acceptor acceptor, endpoint where, ino_t file)
        : acceptor_(std::move(acceptor)), where_(std::move(where)), file_(file) {}
    ~local_listener() override { remove_file(); }

    task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() override {
        auto [problem, socket] = co_await acceptor_.async_accept(as_tuple);
        std::unique_ptr<stream> accepted;
        if (!problem) accepted = as_stream(std::move(socket), where_.text());
        co_return std::pair(problem, std::move(accepted));
    }
    void close() override {
        std::error_code ignored;
        acceptor_.close(ignored);
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

    local::acceptor acceptor_;
    endpoint where_;
    ino_t file_;
};

// A socket's file outlives a killed process: one at which nobody listens any more may be replaced.
bool nobody_listens(loop& on, const endpoint& at) {
    std::error_code problem;
    local::socket probe(on.get_executor());
    probe.connect(address_of(at), problem);
    return problem == asio::error::connection_refused;
}

} // namespace

task<result<std::unique_ptr<stream>>> connect_local(loop& on, endpoint to) {
    local::socket socket(on.get_executor());
    auto [problem] = co_await socket.async_connect(address_of(to), as_tuple);
    if (problem == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
    if (problem) co_return connect_failure(to, problem);
    co_return as_stream(std::move(socket), to.text());
}

result<std::unique_ptr<listener>> listen_local(loop& on, const endpoint& at) {
    std::error_code problem;
    auto refuse = [&] { return io_failure(fmt::format("cannot listen on {}", at.text()), problem); };

    local::acceptor acceptor(on.get_executor());
    acceptor.open(local(), problem);
    if (problem) return refuse();
    acceptor.bind(address_of(at), problem);
    bool file = !at.path.starts_with('@');
    if (problem == asio::error::address_in_use && file && nobody_listens(on, at)) {
        ::unlink(at.path.c_str());
        acceptor.bind(address_of(at), problem);
    }
    if (problem) return refuse();
    acceptor.listen(asio::socket_base::max_listen_connections, problem);
    if (problem) return refuse();
    struct stat made {};
    if (file) ::stat(at.path.c_str(), &made);
    return std::unique_ptr<listener>(std::make_unique<local_listener>(std::move(acceptor), at, made.st_ino));
}

} // namespace ise::real
