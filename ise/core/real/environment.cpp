#include <ise/core/real/environment.hpp>

#include <ise/core/executor.hpp>
#include <ise/core/inproc.hpp>
#include <ise/core/real/own_loop.hpp>
#include <ise/core/real/sockets.hpp>
#include <ise/core/real/system.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/strand.hpp>
#include <asio/thread_pool.hpp>

#include <fmt/format.h>

#include <array>
#include <condition_variable>
#include <cstdlib>
#include <mutex>
#include <thread>

namespace ise {
namespace {

time_point steady_now() {
    return time_point(std::chrono::duration_cast<duration>(std::chrono::steady_clock::now().time_since_epoch()));
}

// The loops that live, so that the environment can outlive them.
struct loop_count {
    std::mutex mutex;
    std::condition_variable none;
    int count = 0;
};

// A place in the count.
class counted_loop {
public:
    explicit counted_loop(std::shared_ptr<loop_count> in) : in_(std::move(in)) {
        std::lock_guard lock(in_->mutex);
        ++in_->count;
    }
    ~counted_loop() {
        std::lock_guard lock(in_->mutex);
        if (--in_->count == 0) in_->none.notify_all();
    }
    counted_loop(const counted_loop&) = delete;
    counted_loop& operator=(const counted_loop&) = delete;

private:
    std::shared_ptr<loop_count> in_;
};

class adopted_loop final : public loop_host {
public:
    adopted_loop(environment& environment, asio::any_io_executor executor, std::function<bool()> running_here)
        : loop_(environment, std::move(executor), std::move(running_here)) {
        loop_.use_alarm(std::make_unique<real::asio_alarm>(loop_));
    }
    ~adopted_loop() override { end(); }
    void end() override {
        if (std::exchange(ended_, true)) return;
        loop_.abandon();
        loop_.use_alarm(nullptr);
    }
    ise::loop& loop() noexcept override { return loop_; }

private:
    ise::loop loop_;
    bool ended_ = false;
};

task<result<std::unique_ptr<stream>>> given(result<std::unique_ptr<stream>> outcome) { co_return outcome; }

} // namespace

struct real_environment::state {
    process_identity identity = real::this_process();
    std::shared_ptr<loop_count> loops = std::make_shared<loop_count>();
    inproc_registry inproc;
    std::mutex random_mutex;
    // Tickets and incarnations must not be guessed: each is drawn from the kernel, a batch at a time.
    std::array<std::uint64_t, 64> drawn{};
    std::size_t left = 0;
    // Last: its threads end before what they use.
    std::mutex workers_mutex;
    std::optional<asio::thread_pool> workers;
};

real_environment::real_environment() : state_(std::make_unique<state>()) {}

// A thread that a node had to leave behind uses the environment until it comes back.
real_environment::~real_environment() {
    std::unique_lock lock(state_->loops->mutex);
    state_->loops->none.wait(lock, [this] { return state_->loops->count == 0; });
}

time_point real_environment::now() const { return steady_now(); }

time_point real_environment::recently() const { return real::recent_time(); }

wall_time real_environment::wall() const { return std::chrono::system_clock::now(); }
const process_identity& real_environment::identity() const { return state_->identity; }

std::uint64_t real_environment::random() {
    std::lock_guard lock(state_->random_mutex);
    if (state_->left == 0) {
        real::draw_random(state_->drawn);
        state_->left = state_->drawn.size();
    }
    return state_->drawn[--state_->left];
}

std::optional<std::string> real_environment::variable(const std::string& name) const {
    if (const char* value = std::getenv(name.c_str())) return value;
    return std::nullopt;
}

std::unique_ptr<loop_host> real_environment::make_loop(const std::string& name) {
    return real::make_own_loop(*this, name, std::make_shared<counted_loop>(state_->loops));
}

std::unique_ptr<loop_host> real_environment::adopt(asio::any_io_executor executor, bool one_thread) {
    if (one_thread) {
        auto* context = executor_cast<asio::io_context::executor_type>(executor);
        auto running = context ? std::function<bool()>([on = *context] { return on.running_in_this_thread(); })
                               : std::function<bool()>([] { return true; }); // promised
        return std::make_unique<adopted_loop>(*this, std::move(executor), std::move(running));
    }
    auto strand = asio::make_strand(executor);
    return std::make_unique<adopted_loop>(*this, strand, [strand] { return strand.running_in_this_thread(); });
}

void real_environment::offload(std::function<void()> work) {
    std::lock_guard lock(state_->workers_mutex);
    if (!state_->workers) state_->workers.emplace(std::max(2u, std::thread::hardware_concurrency()));
    asio::post(*state_->workers, std::move(work));
}

task<result<std::unique_ptr<stream>>> real_environment::connect(loop& on, endpoint to) {
    if (to.kind == protocol::tcp) return real::connect_tcp(on, std::move(to));
    if (to.kind == protocol::local) return real::connect_local(on, std::move(to));
    if (to.kind == protocol::inproc) return given(state_->inproc.connect(on, to.path));
    return given(failure(errc::invalid_argument, fmt::format("{} is not an endpoint of a plain stream", to.text())));
}

result<std::unique_ptr<listener>> real_environment::listen(loop& on, const endpoint& at) {
    if (at.kind == protocol::tcp) return real::listen_tcp(on, at);
    if (at.kind == protocol::local) return real::listen_local(on, at);
    if (at.kind == protocol::inproc) return state_->inproc.listen(on, at.path);
    return failure(errc::invalid_argument, fmt::format("{} is not an endpoint that accepts plain streams", at.text()));
}

result<std::unique_ptr<datagram_socket>> real_environment::open_datagram(loop& on, const endpoint& at) {
    return real::open_udp(on, at);
}

result<std::unique_ptr<stream>> real_environment::open_serial(loop& on, const serial_options& options) {
    return real::open_serial(on, options);
}

result<pseudo_terminal> real_environment::open_pseudo_terminal(loop& on, const std::string& link) {
    return real::open_pseudo_terminal(on, link);
}

std::vector<std::string> real_environment::interface_addresses() const { return real::interface_addresses(); }

} // namespace ise
