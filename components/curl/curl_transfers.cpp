// environment-boundary: libcurl owns its sockets
#include <components/curl/curl_transfers.hpp>

#include <components/curl/curl_easy.hpp>

#include <ise/core/environment.hpp>
#include <ise/core/waiter.hpp>

#include <asio/posix/stream_descriptor.hpp>
#include <fmt/format.h>

#include <map>
#include <optional>
#include <set>

#include <sys/socket.h>
#include <unistd.h>

namespace atirma {

class curl_transfers::state : public std::enable_shared_from_this<state> {
public:
    explicit state(ise::loop& owner) : loop(owner), due_(owner, [this] { act(CURL_SOCKET_TIMEOUT, 0); }) {}
    state(const state&) = delete;
    state& operator=(const state&) = delete;
    ~state() {
        // libcurl would wait for answers to its goodbyes: nobody listens any more.
        for (auto socket : open_) ::shutdown(socket, SHUT_RD);
        multi_.reset();
    }

    void start() {
        multi_.reset(curl_multi_init());
        auto* m = multi_.get();
        curl_multi_setopt(m, CURLMOPT_SOCKETFUNCTION, on_socket);
        curl_multi_setopt(m, CURLMOPT_SOCKETDATA, this);
        curl_multi_setopt(m, CURLMOPT_TIMERFUNCTION, on_timer);
        curl_multi_setopt(m, CURLMOPT_TIMERDATA, this);
    }

    struct transfer {
        explicit transfer(ise::loop& on) : wake(on) {}
        std::optional<CURLcode> code;
        ise::waiter<std::error_code> wake;
    };

    void add(curl_easy& what) {
        transfers_.try_emplace(what.handle(), std::make_unique<transfer>(loop));
        curl_easy_setopt(what.handle(), CURLOPT_OPENSOCKETFUNCTION, on_open);
        curl_easy_setopt(what.handle(), CURLOPT_OPENSOCKETDATA, this);
        curl_easy_setopt(what.handle(), CURLOPT_CLOSESOCKETFUNCTION, on_close);
        curl_easy_setopt(what.handle(), CURLOPT_CLOSESOCKETDATA, this);
        curl_multi_add_handle(multi_.get(), what.handle());
    }
    void remove(curl_easy& what) noexcept {
        auto found = transfers_.find(what.handle());
        if (found == transfers_.end()) return;
        // No goodbye that waits.
        if (!found->second->code && open_.contains(what.socket)) ::shutdown(what.socket, SHUT_RDWR);
        transfers_.erase(found);
        curl_multi_remove_handle(multi_.get(), what.handle());
    }
    transfer* find(curl_easy& what) {
        auto found = transfers_.find(what.handle());
        return found == transfers_.end() ? nullptr : found->second.get();
    }

    ise::loop& loop;

private:
    /// A socket that libcurl wants to hear of. Waits that are under way hold on to it weakly.
    struct watch {
        watch(ise::loop& on, curl_socket_t of) : socket(of), descriptor(on.get_executor(), of) {}
        curl_socket_t socket;
        asio::posix::stream_descriptor descriptor;
        int wanted = 0;
        bool reading = false, writing = false;
        bool gone = false;
    };

    static int on_socket(CURL* easy, curl_socket_t socket, int what, void* self, void*) {
        auto& me = *static_cast<state*>(self);
        if (what == CURL_POLL_REMOVE) {
            me.forget(socket);
            return 0;
        }
        void* owner = nullptr;
        if (curl_easy_getinfo(easy, CURLINFO_PRIVATE, &owner) == CURLE_OK && owner)
            static_cast<curl_easy*>(owner)->socket = socket;
        auto& known = me.watched_[socket];
        if (!known) known = std::make_shared<watch>(me.loop, socket);
        known->wanted = what;
        me.wait(known);
        return 0;
    }
    static int on_timer(CURLM*, long after_ms, void* self) {
        auto& me = *static_cast<state*>(self);
        if (after_ms < 0) me.due_.disarm();
        else me.due_.arm(ise::saturating_add(me.loop.now(), std::chrono::milliseconds(after_ms)));
        return 0;
    }
    static curl_socket_t on_open(void* self, curlsocktype, curl_sockaddr* to) {
        auto made = ::socket(to->family, to->socktype | SOCK_CLOEXEC, to->protocol);
        if (made >= 0) static_cast<state*>(self)->open_.insert(made);
        return made < 0 ? CURL_SOCKET_BAD : made;
    }
    static int on_close(void* self, curl_socket_t socket) {
        auto& me = *static_cast<state*>(self);
        me.forget(socket);
        me.open_.erase(socket);
        return ::close(socket);
    }

    void forget(curl_socket_t socket) {
        auto found = watched_.find(socket);
        if (found == watched_.end()) return;
        found->second->gone = true;
        found->second->descriptor.release(); // libcurl closes it
        watched_.erase(found);
    }

    void wait(const std::shared_ptr<watch>& on) {
        auto wait_for = [this, &on](int what, bool watch::*waits, asio::posix::descriptor_base::wait_type kind) {
            if (!(on->wanted & what) || (*on).*waits) return;
            (*on).*waits = true;
            on->descriptor.async_wait(
                kind, [weak = std::weak_ptr(on), owner = weak_from_this(), what, waits](std::error_code problem) {
                    auto self = owner.lock();
                    auto here = weak.lock();
                    if (!self || !here || here->gone) return;
                    (*here).*waits = false;
                    self->act(here->socket, problem                ? CURL_CSELECT_ERR
                                            : what == CURL_POLL_IN ? CURL_CSELECT_IN
                                                                   : CURL_CSELECT_OUT);
                    if (!here->gone && !problem) self->wait(here);
                });
        };
        wait_for(CURL_POLL_IN, &watch::reading, asio::posix::descriptor_base::wait_read);
        wait_for(CURL_POLL_OUT, &watch::writing, asio::posix::descriptor_base::wait_write);
    }

    void act(curl_socket_t socket, int events) {
        ise::loop::turn in(loop);
        int running = 0;
        curl_multi_socket_action(multi_.get(), socket, events, &running);
        int left = 0;
        while (auto* message = curl_multi_info_read(multi_.get(), &left)) {
            if (message->msg != CURLMSG_DONE) continue;
            auto found = transfers_.find(message->easy_handle);
            if (found == transfers_.end()) continue;
            found->second->code = message->data.result;
            found->second->wake.resume({});
        }
    }

    std::set<curl_socket_t> open_;
    std::map<curl_socket_t, std::shared_ptr<watch>> watched_;
    std::map<CURL*, std::unique_ptr<transfer>> transfers_;
    ise::timer due_;
    std::unique_ptr<CURLM, decltype([](CURLM* multi) { curl_multi_cleanup(multi); })> multi_;
};

curl_transfers::curl_transfers(ise::loop& on) {
    if (on.env().is_virtual())
        throw ise::error(ise::errc::invalid_argument,
                         "libcurl needs the real world: in the virtual one use what stands in for it (memory_mail)");
    state_ = std::make_shared<state>(on);
    state_->start();
}
curl_transfers::~curl_transfers() = default;

ise::loop& curl_transfers::on() const noexcept { return state_->loop; }
void curl_transfers::add(curl_easy& what) { state_->add(what); }
void curl_transfers::remove(curl_easy& what) noexcept { state_->remove(what); }

ise::task<ise::result<void>> curl_transfers::end_of(curl_easy& what, ise::duration within) {
    auto* here = state_->find(what);
    if (!here) co_return ise::failure(ise::errc::invalid_argument, "a transfer that was not begun");
    bool late = false;
    ise::timer alarm(state_->loop, [&] {
        late = true;
        here->wake.resume({});
    });
    alarm.arm(ise::saturating_add(state_->loop.now(), within));
    while (!here->code && !late) co_await here->wake.wait(); // throws what it was resumed with
    if (!here->code) {
        auto seconds = std::chrono::duration<double>(within).count();
        co_return ise::failure(ise::errc::timed_out, fmt::format("{}: no answer within {} s", what.server(), seconds),
                               what.executed());
    }
    if (*here->code != CURLE_OK) co_return what.failure(*here->code);
    co_return ise::result<void>();
}

ise::task<ise::result<void>> curl_transfers::run(curl_easy& what, ise::duration within) {
    struct added {
        curl_transfers& to;
        curl_easy& what;
        added(curl_transfers& transfers, curl_easy& easy) : to(transfers), what(easy) { to.add(what); }
        ~added() { to.remove(what); }
    } guard(*this, what);
    auto outcome = co_await end_of(what, within);
    co_return outcome;
}

} // namespace atirma
