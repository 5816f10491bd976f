#include <ise/core/real/descriptor.hpp>

#include <ise/core/executor.hpp>
#include <ise/core/loop_executor.hpp>
#include <ise/core/real/watched_object.hpp>

#include <asio/error.hpp>

namespace ise::real {

// Waits through Asio; its handlers may come after the descriptor is gone.
struct descriptor::asio_watch {
    asio_watch(loop& on, descriptor& whose, int fd) : of(&whose), object(on.get_executor(), fd) {}

    static void wait(const std::shared_ptr<asio_watch>& self, bool to_write) {
        auto& waits = to_write ? self->writing : self->reading;
        if (std::exchange(waits, true)) return;
        auto kind = to_write ? watched_object::wait_write : watched_object::wait_read;
        self->object.async_wait(kind, [self, to_write](std::error_code problem) {
            (to_write ? self->writing : self->reading) = false;
            // Any other error is the next read's or write's.
            if (problem == asio::error::operation_aborted || !self->of || self->of->on_.abandoned()) return;
            loop::turn in(self->of->on_);
            if (to_write) self->of->on_writable();
            else self->of->come_readable(false);
        });
    }

    descriptor* of; // null: closed
    watched_object object;
    bool reading = false;
    bool writing = false;
};

std::error_code descriptor::watch() {
    if (auto* own = executor_cast<loop_executor>(on_.get_executor())) {
        auto& through = dynamic_cast<readiness&>(own->queue());
        auto problem = through.add(*this);
        if (!problem) own_ = &through;
        return problem;
    }
    try {
        asio_ = std::make_shared<asio_watch>(on_, *this, fd_.get());
    } catch (const std::system_error& wrong) {
        return wrong.code();
    }
    return {};
}

void descriptor::close_descriptor() noexcept {
    if (own_) {
        own_->remove(*this);
        own_ = nullptr;
    } else if (asio_) {
        asio_->of = nullptr;
        std::error_code ignored;
        asio_->object.close(ignored);
        asio_.reset();
        fd_.release();
    }
    fd_.reset();
}

[[gnu::hot]] void descriptor::want_read() {
    if (asio_) return asio_watch::wait(asio_, false);
    if (own_ && readable_ && !std::exchange(again_, true)) own_->again(*this);
}

std::error_code descriptor::want_write() {
    if (asio_) {
        asio_watch::wait(asio_, true);
    } else if (own_ && !waits_to_write_) {
        if (auto problem = own_->change(*this, true)) return problem;
        waits_to_write_ = true;
    }
    return {};
}

void descriptor::come_readable(bool over) {
    readable_ = true;
    over_ = over_ || over;
    reads_left_ = reads_in_a_row;
    on_readable();
}

void descriptor::on_again() {
    again_ = false;
    if (!receives()) come_readable(false);
}

bool descriptor::is_received_for_after(bool short_event) {
    constexpr unsigned enough = 64;
    short_events_ = short_event ? short_events_ + 1 : 0;
    if (short_events_ < enough) return false;
    short_events_ = 0;
    return receive();
}

// Not where an event is under way that would not be repeated: the end, or room to write.
bool descriptor::receive() {
    if (!own_ || over_ || waits_to_write_ || !own_->receive(*this)) return false;
    readable_ = false;
    return true;
}

// From here on epoll reports its events again, the first at once if there is something to read.
void descriptor::on_received_all() {
    if (!own_) return; // closed
    if (auto problem = waits_to_write_ ? own_->change(*this, true) : own_->add(*this)) on_unwatched(problem);
}

[[gnu::hot]] void descriptor::on_events(ready what) {
    if (what.to_write && std::exchange(waits_to_write_, false)) {
        own_->change(*this, false);
        on_writable();
    }
    if ((what.to_read || what.over) && !receives()) come_readable(what.over);
}

} // namespace ise::real
