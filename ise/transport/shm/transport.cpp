#include <ise/core/environment.hpp>
#include <ise/core/little_endian.hpp>
#include <ise/core/loop.hpp>
#include <ise/core/real/socket_stream.hpp>
#include <ise/core/verified_peer.hpp>
#include <ise/transport/loans.hpp>
#include <ise/transport/shm/row.hpp>
#include <ise/transport/shm/stream.hpp>
#include <ise/transport/system_streams.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <fmt/format.h>

#include <array>
#include <cstring>
#include <optional>
#include <span>
#include <string_view>

// The agreement over a local socket (FORMAT.md, section 12.1). Whatever keeps one side from shared memory, the
// connection goes on over the socket.
namespace ise::net::shm {
namespace {

constexpr std::string_view mark = "ISE-shm";
// mark, version, bytes of a ring (0: no memory is offered), reserved
constexpr std::size_t offer_bytes = 16;
constexpr std::byte version{1};
// mark, answer
constexpr std::size_t answer_bytes = 8;
constexpr std::byte over_socket{0}, over_memory{1};
constexpr std::string_view suffix = ".shm";
constexpr std::size_t max_name = 107 - suffix.size();

bool is_marked(std::span<const std::byte> bytes) { return std::memcmp(bytes.data(), mark.data(), mark.size()) == 0; }
void put_mark(std::span<std::byte> into) { std::memcpy(into.data(), mark.data(), mark.size()); }

// An abstract name of its own beside that of local://; a file is the file.
endpoint below(endpoint at) {
    at.kind = protocol::local;
    if (at.path.starts_with('@')) at.path += suffix;
    return at;
}

failure too_long(const endpoint& at) {
    return {errc::invalid_argument, fmt::format("{}: a name has at most {} bytes", at.text(), max_name)};
}
bool is_too_long(const endpoint& at) { return at.path.starts_with('@') && at.path.size() > max_name; }

// Reads exactly that many bytes. Cancellation: terminal.
task<std::error_code> fill(stream& from, std::span<std::byte> whole) {
    while (!whole.empty()) {
        auto got = co_await from.read_some(asio::buffer(whole.data(), whole.size()));
        if (got.problem) co_return got.problem;
        whole = whole.subspan(got.bytes);
    }
    co_return std::error_code();
}

// What this side offers; nothing where there can be no memory between the two.
struct offer {
    descriptors passed;
    mapping memory;
    owned_fd socket; // the one of the line once more
    std::uint32_t ring_bytes = 0;
};
std::optional<offer> offer_over(const real::socket_stream* line) {
    if (!line || !is_kindred(line->fd())) return std::nullopt;
    offer made;
    made.ring_bytes = ring_bytes_here();
    auto passed = make_descriptors(made.ring_bytes);
    if (!passed) return std::nullopt;
    made.passed = std::move(*passed);
    auto memory = mapping::of(made.passed.memory, made.ring_bytes);
    if (!memory) return std::nullopt;
    made.memory = std::move(*memory);
    made.socket = duplicate(line->fd());
    if (!made.socket) return std::nullopt;
    return made;
}

ends ends_of(offer from, bool connecting) {
    ends made;
    made.socket = std::move(from.socket);
    made.own_bell = std::move(connecting ? from.passed.connecting_bell : from.passed.accepting_bell);
    made.peer_bell = std::move(connecting ? from.passed.accepting_bell : from.passed.connecting_bell);
    made.memory = std::move(from.memory);
    made.connecting = connecting;
    return made;
}

bool send_offer(stream& line, const std::optional<offer>& mine) {
    std::array<std::byte, offer_bytes> bytes{};
    put_mark(bytes);
    bytes[mark.size()] = version;
    detail::store_little(bytes.data() + 8, mine ? mine->ring_bytes : std::uint32_t{0});
    if (mine) return send_with(dynamic_cast<real::socket_stream&>(line).fd(), bytes, mine->passed);
    asio::const_buffer whole(bytes.data(), bytes.size());
    return line.try_write(std::span(&whole, 1)).bytes == bytes.size();
}

// Of the side that connects. Errors: errc::unreachable, errc::cancelled. Cancellation: terminal, nothing stays open.
task<result<std::unique_ptr<stream>>> agree(loop& on, std::unique_ptr<stream> line, endpoint to) {
    auto mine = offer_over(dynamic_cast<real::socket_stream*>(line.get()));
    const auto named = to.text();
    auto refuse = [&named](std::string_view how) {
        return failure(errc::unreachable, fmt::format("cannot connect to {}: {}", named, how));
    };
    if (!send_offer(*line, mine)) co_return refuse("the peer ended the connection");
    std::array<std::byte, answer_bytes> answer{};
    auto problem = co_await fill(*line, answer);
    if (problem == asio::error::operation_aborted) co_return failure(errc::cancelled, "connecting was cancelled");
    if (problem) co_return refuse("the peer ended the connection before it answered; it may not listen on shm://");
    const bool memory = answer.back() == over_memory;
    if (!is_marked(answer) || answer.back() > over_memory || (memory && !mine))
        co_return refuse("the peer does not answer like a listener on shm://");
    if (!memory) co_return std::move(line);
    line.reset();
    auto made = make_stream(on, ends_of(std::move(*mine), true), named);
    if (!made) co_return refuse(made.error().message());
    co_return std::move(*made);
}

// Of the side that was called: agrees in its first read.
class accepted_stream final : public stream, public verified_stream, public loans {
public:
    accepted_stream(loop& on, std::unique_ptr<stream> line, std::string peer)
        : on_(on), now_(std::move(line)), peer_(std::move(peer)) {}

    task<transfer> read_some(asio::mutable_buffer into) override {
        return agreed_ ? now_->read_some(into) : agree_and_read(into);
    }
    bool deliver_to(stream_reader& reader) override { return agreed_ && now_->deliver_to(reader); }
    transfer try_write(std::span<const asio::const_buffer> from) override { return now_->try_write(from); }
    task<std::error_code> wait_writable() override { return now_->wait_writable(); }
    void limit_unsent(std::size_t most) override { now_->limit_unsent(most); }
    void shutdown_write() override { now_->shutdown_write(); }
    void close() override {
        closed_ = true;
        now_->close();
    }
    std::string peer() const override { return peer_; }
    std::optional<failure> verdict() const override { return verdict_; }
    void add_verified(verified_peer& to) const override {
        if (auto* known = dynamic_cast<const verified_stream*>(now_.get())) known->add_verified(to);
    }

    large_memory_source* memory() noexcept override { return loans_ ? loans_->memory() : nullptr; }
    std::optional<loan_reference> loan(const shared_bytes& content) override {
        return loans_ ? loans_->loan(content) : std::nullopt;
    }
    result<passed_object> borrow(const loan_reference& what) override {
        if (loans_) return loans_->borrow(what);
        return failure(errc::protocol_error, "a packet refers to shared memory, and there is none");
    }

private:
    task<transfer> agree_and_read(asio::mutable_buffer into) {
        auto problem = co_await agree();
        if (closed_) problem = asio::error::operation_aborted;
        if (problem) co_return transfer{problem, 0};
        agreed_ = true;
        auto got = co_await now_->read_some(into);
        co_return got;
    }
    task<std::error_code> agree();
    result<std::unique_ptr<stream>> shared(std::uint32_t ring_bytes, std::vector<owned_fd> passed);
    std::error_code refuse(failure why) {
        verdict_ = std::move(why);
        return asio::error::invalid_argument;
    }

    loop& on_;
    std::unique_ptr<stream> now_;
    loans* loans_ = nullptr; // the same, where it goes through memory
    std::string peer_;
    std::optional<failure> verdict_;
    bool agreed_ = false;
    bool closed_ = false;
};

// Without its descriptors nothing of the offer is used, whatever else it says.
result<std::unique_ptr<stream>> accepted_stream::shared(std::uint32_t ring_bytes, std::vector<owned_fd> passed) {
    auto& socket = dynamic_cast<real::socket_stream&>(*now_);
    auto taken = take_descriptors(passed);
    if (!taken) return taken.error();
    offer theirs;
    theirs.passed = std::move(*taken);
    auto memory = mapping::of(theirs.passed.memory, ring_bytes);
    if (!memory) return memory.error();
    theirs.memory = std::move(*memory);
    theirs.socket = duplicate(socket.fd());
    if (!theirs.socket) return failure(errc::io_failed, "no shared memory: no file descriptor is left (ulimit -n)");
    return make_stream(on_, ends_of(std::move(theirs), false), peer_);
}

task<std::error_code> accepted_stream::agree() {
    auto* socket = dynamic_cast<real::socket_stream*>(now_.get());
    std::vector<owned_fd> passed;
    std::array<std::byte, offer_bytes> asked{};
    const bool kindred = socket && is_kindred(socket->fd());
    if (kindred) socket->keep_passed(&passed);
    const auto first = co_await now_->read_some(asio::buffer(asked));
    if (closed_) co_return asio::error::operation_aborted;
    if (kindred) socket->keep_passed(nullptr); // they come with the first byte, and what comes later is dropped
    auto problem = first.problem;
    const auto rest = std::span<std::byte>(asked).subspan(first.bytes);
    if (!problem) problem = co_await fill(*now_, rest);
    if (closed_) co_return asio::error::operation_aborted;
    if (problem) co_return problem;
    if (!is_marked(asked) || asked[mark.size()] != version)
        co_return refuse({errc::protocol_error, "it does not begin with an offer of shared memory, as on shm://"});
    const auto ring_bytes = detail::load_little<std::uint32_t>(asked.data() + 8);
    std::unique_ptr<stream> memory;
    if (kindred && ring_bytes != 0) {
        auto made = shared(ring_bytes, std::move(passed));
        if (!made && made.error().code() == errc::protocol_error) co_return refuse(made.error());
        if (made) memory = std::move(*made);
    }
    std::array<std::byte, answer_bytes> answer{};
    put_mark(answer);
    answer.back() = memory ? over_memory : over_socket;
    asio::const_buffer whole(answer.data(), answer.size());
    const auto wrote = now_->try_write(std::span(&whole, 1));
    if (wrote.bytes != answer.size()) co_return wrote.problem ? wrote.problem : asio::error::broken_pipe;
    if (memory) {
        now_ = std::move(memory);
        loans_ = dynamic_cast<loans*>(now_.get());
    }
    co_return std::error_code();
}

class agreeing_listener final : public listener {
public:
    agreeing_listener(loop& on, std::unique_ptr<listener> from, endpoint where)
        : on_(on), from_(std::move(from)), where_(std::move(where)) {}

    task<std::pair<std::error_code, std::unique_ptr<stream>>> accept() override {
        auto& on = on_; // this may be gone afterwards
        auto named = where_.text();
        auto [problem, stranger] = co_await from_->accept();
        std::unique_ptr<stream> accepted;
        if (stranger) accepted = std::make_unique<accepted_stream>(on, std::move(stranger), std::move(named));
        co_return std::pair(problem, std::move(accepted));
    }
    void close() override { from_->close(); }
    endpoint where() const override { return where_; }

private:
    loop& on_;
    std::unique_ptr<listener> from_;
    endpoint where_;
};

task<result<std::unique_ptr<stream>>> connect(loop& on, endpoint to, security with) {
    if (is_too_long(to)) co_return too_long(to);
    auto line = co_await on.env().connect(on, below(to));
    if (!line) co_return line.error();
    auto made = co_await agree(on, std::move(*line), to);
    if (!made) co_return made.error();
    auto sealed = co_await seal(on, std::move(*made), std::move(to), std::move(with));
    co_return sealed;
}

result<std::unique_ptr<listener>> listen(loop& on, const endpoint& at, security with) {
    if (is_too_long(at)) return too_long(at);
    auto from = on.env().listen(on, below(at));
    if (!from) return from.error();
    std::unique_ptr<listener> agreeing = std::make_unique<agreeing_listener>(on, std::move(*from), at);
    return seal(on, std::move(agreeing), std::move(with));
}

} // namespace
} // namespace ise::net::shm

namespace ise {

constinit const transport transports::shm{
    .scheme = "shm",
    .example = "shm://@name, shm:///path/of.sock",
    .address = address_form::file_or_name,
    .rank = 40,
    .same_host = true,
    .by_default = true,
    .connect = net::shm::connect,
    .listen = net::shm::listen,
};

} // namespace ise
