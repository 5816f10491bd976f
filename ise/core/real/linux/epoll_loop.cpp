#include <ise/core/real/linux/epoll_loop.hpp>

#include <ise/core/real/own_loop.hpp>
#include <ise/core/real/system.hpp>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <csignal>
#include <cstdint>
#include <limits>
#include <system_error>

#include <sys/eventfd.h>
#include <sys/timerfd.h>
#include <unistd.h>

namespace ise::real {
namespace {

thread_local const epoll_loop* running = nullptr;

constexpr std::uint32_t always = EPOLLIN | EPOLLRDHUP | EPOLLET;

descriptor::ready meaning_of(std::uint32_t events) noexcept {
    return {(events & EPOLLIN) != 0, (events & (EPOLLOUT | EPOLLHUP | EPOLLERR)) != 0,
            (events & (EPOLLRDHUP | EPOLLHUP | EPOLLERR)) != 0};
}

} // namespace

class epoll_loop::next_alarm final : public alarm {
public:
    explicit next_alarm(epoll_loop& owner) noexcept : owner_(owner) {}
    void arm(time_point at) override {
        const auto now = owner_.world_.now();
        const auto left = at > now ? (at - now).count() : std::int64_t{1}; // 0 would disarm it
        const auto seconds =
            std::min<std::int64_t>(left / 1'000'000'000, std::numeric_limits<decltype(timespec::tv_sec)>::max());
        const itimerspec once{{0, 0},
                              {static_cast<decltype(timespec::tv_sec)>(seconds),
                               static_cast<decltype(timespec::tv_nsec)>(left % 1'000'000'000)}};
        ::timerfd_settime(owner_.timer_.get(), 0, &once, nullptr);
    }

private:
    epoll_loop& owner_;
};

// The calling thread runs the loop.
class epoll_loop::inside {
public:
    explicit inside(const epoll_loop& owner) noexcept : before_(std::exchange(running, &owner)) {}
    ~inside() { running = before_; }
    inside(const inside&) = delete;
    inside& operator=(const inside&) = delete;

private:
    const epoll_loop* before_;
};

epoll_loop::epoll_loop(environment& world, const std::string& name, std::shared_ptr<void> held,
                       std::shared_ptr<poll_seats> seats)
    : held_(std::move(held)), world_(world), epoll_(::epoll_create1(EPOLL_CLOEXEC)),
      doorbell_(epoll_ ? ::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK) : -1),
      timer_(doorbell_ ? ::timerfd_create(CLOCK_MONOTONIC, TFD_CLOEXEC | TFD_NONBLOCK) : -1), seats_(std::move(seats)),
      asio_(1) {
    // Edge-triggered they need never be read.
    epoll_event rings{EPOLLIN | EPOLLET, {nullptr}};
    epoll_event expires{EPOLLIN | EPOLLET, {&timer_}};
    if (!timer_ || ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, doorbell_.get(), &rings) != 0 ||
        ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, timer_.get(), &expires) != 0)
        throw std::system_error(last_system_error(), "cannot make an event loop");
    loop_ = std::make_unique<ise::loop>(world, loop_executor(*this), [this] { return running_here(); });
    loop_->use_alarm(std::make_unique<next_alarm>(*this));
    thread_ = std::thread([this] { run(); });
    name_thread(thread_, name);
}

// What was posted since it ended holds parts of the loop, and so may what that drops.
epoll_loop::~epoll_loop() {
    end();
    drop_posted();
}

// As an io_context does: what was posted before runs once more, and what waits for objects of Asio is destroyed.
void epoll_loop::end() {
    if (!thread_.joinable()) return;
    stopped_ = true;
    wake();
    thread_.join();
    inside here(*this);
    loop_->abandon();
    loop_->use_alarm(nullptr);
    if (poller_) poller_->stop();
    {
        std::lock_guard lock(asio_mutex_);
        asio_over_ = true;
    }
    asio_work_.reset();
    asio_.stop();
    if (asio_thread_.joinable()) asio_thread_.join();
    asio_.restart();
    asio_.poll();
    for (take_posted(); !queue_.empty(); take_posted()) queue_.pop_front()();
    asio_.shutdown();
    drop_posted();
}

void epoll_loop::drop_posted() {
    inside here(*this);
    for (take_posted(); !queue_.empty(); take_posted()) auto dropped = queue_.pop_front();
}

void epoll_loop::poll(duration window) {
    post([this, window] {
        if (loop_->abandoned() || poller_) return;
        poller_ = std::make_unique<poller>(world_, loop_->get_executor(), window, seats_);
        loop_->use_watcher(poller_.get());
    });
}

bool epoll_loop::running_here() const noexcept { return running == this; }

void epoll_loop::post(work what) {
    if (running_here()) return queue_.push_back(std::move(what));
    {
        std::lock_guard lock(mutex_);
        posted_.push_back(std::move(what));
        has_posted_ = true;
    }
    if (sleeping_.exchange(false)) wake();
}

void epoll_loop::wake() noexcept {
    const std::uint64_t one = 1;
    while (::write(doorbell_.get(), &one, sizeof one) < 0 && errno == EINTR) {}
}

asio::execution_context& epoll_loop::objects() {
    std::lock_guard lock(asio_mutex_);
    if (asio_over_ || asio_thread_.joinable()) return asio_;
    // Signals are for the threads of the program.
    sigset_t all{}, before{};
    ::sigfillset(&all);
    ::pthread_sigmask(SIG_SETMASK, &all, &before);
    struct restore {
        const sigset_t& mask;
        ~restore() { ::pthread_sigmask(SIG_SETMASK, &mask, nullptr); }
    } afterwards{before};
    asio_work_.emplace(asio_.get_executor());
    asio_thread_ = std::thread([this] { asio_.run(); });
    name_thread(asio_thread_, "ise-asio");
    return asio_;
}

[[gnu::hot]] void epoll_loop::run() {
    inside here(*this);
    while (!stopped_.load(std::memory_order_relaxed)) {
        wait();
        if (ring_) ring_->deliver(*loop_);
        tell();
        if (!again_.empty()) tell_again();
        if (has_posted_.load(std::memory_order_relaxed)) take_posted();
        work_off();
    }
    ring_.reset(); // which belongs to this thread
}

// Others post, then look whether it sleeps; it says that it sleeps, then looks whether they posted.
[[gnu::hot]] void epoll_loop::wait() {
    const bool busy = !queue_.empty() || !again_.empty();
    if (!busy) sleeping_ = true;
    const bool sleeps = !busy && !has_posted_ && !stopped_;
    if (!ring_ || !ring_->receives()) take_events(sleeps ? -1 : 0);
    else if (ring_->wait(sleeps)) take_events(0);
    if (!busy) sleeping_ = false;
}

[[gnu::hot]] void epoll_loop::take_events(int timeout) noexcept {
    const int come = ::epoll_wait(epoll_.get(), events_.data(), static_cast<int>(events_.size()), timeout);
    if (ring_ && come == static_cast<int>(events_.size())) ring_->epoll_has_more();
    told_ = 0;
    come_ = std::max(come, 0); // interrupted: none
}

// A turn for each: what one brings may close another, whose events that are still to come are taken away then. The
// timers are last: a peer that has sent something is not silent.
[[gnu::hot]] void epoll_loop::tell() {
    bool timers_due = false;
    while (told_ < come_) {
        const auto& event = events_[static_cast<std::size_t>(told_++)];
        if (!event.data.ptr) continue;
        if (event.data.ptr == &timer_) {
            timers_due = true;
            continue;
        }
        loop::turn in(*loop_);
        static_cast<descriptor*>(event.data.ptr)->on_events(meaning_of(event.events));
    }
    told_ = come_ = 0;
    if (timers_due) loop_->on_alarm();
}

void epoll_loop::tell_again() {
    for (auto left = again_.size(); left > 0 && !again_.empty(); --left) {
        auto& one = *again_.front();
        again_.erase(again_.begin());
        loop::turn in(*loop_);
        one.on_again();
    }
}

void epoll_loop::take_posted() {
    std::lock_guard lock(mutex_);
    has_posted_ = false;
    while (!posted_.empty()) queue_.push_back(posted_.pop_front());
}

// What it posts itself comes after the sockets. What is left when it stops is worked off by who ends it.
[[gnu::hot]] void epoll_loop::work_off() {
    for (auto left = queue_.size(); left > 0 && !stopped_.load(std::memory_order_relaxed); --left) queue_.pop_front()();
}

std::error_code epoll_loop::add(descriptor& watched) {
    epoll_event wanted{always, {&watched}};
    return ::epoll_ctl(epoll_.get(), EPOLL_CTL_ADD, watched.fd(), &wanted) == 0 ? std::error_code()
                                                                                : last_system_error();
}

// A socket that waits for room to write leaves the ring. Until its last completion, epoll watches it for writing only.
std::error_code epoll_loop::change(descriptor& watched, bool to_write) {
    const bool told = !watched.receives();
    if (!told && to_write) ring_->leave(watched);
    const int how = told ? EPOLL_CTL_MOD : to_write ? EPOLL_CTL_ADD : EPOLL_CTL_DEL;
    epoll_event wanted{(told ? always : std::uint32_t{EPOLLET}) | (to_write ? std::uint32_t{EPOLLOUT} : 0u),
                       {&watched}};
    return ::epoll_ctl(epoll_.get(), how, watched.fd(), &wanted) == 0 ? std::error_code() : last_system_error();
}

// Explicitly: a child that was forked and has not begun its program yet keeps the socket, and its events, alive.
void epoll_loop::remove(descriptor& watched) noexcept {
    if (ring_) ring_->forget(watched);
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, watched.fd(), nullptr);
    for (int at = told_; at < come_; ++at)
        if (auto& event = events_[static_cast<std::size_t>(at)]; event.data.ptr == &watched) event.data.ptr = nullptr;
    std::erase(again_, &watched);
}

bool epoll_loop::receive(descriptor& watched) {
    if (stopped_) return false;
    if (!std::exchange(ring_sought_, true)) ring_ = receive_ring::make(epoll_.get());
    if (!ring_) return false;
    ring_->begin(watched);
    ::epoll_ctl(epoll_.get(), EPOLL_CTL_DEL, watched.fd(), nullptr);
    return true;
}

void epoll_loop::again(descriptor& watched) { again_.push_back(&watched); }

std::unique_ptr<loop_host> make_own_loop(environment& world, const std::string& name, std::shared_ptr<void> held) {
    static const auto seats = std::make_shared<poll_seats>(); // of the process
    return std::make_unique<epoll_loop>(world, name, std::move(held), seats);
}

} // namespace ise::real
