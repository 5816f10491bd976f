#include <ise/http/web_socket.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <utility>

namespace ise {
namespace {

constexpr std::size_t max_control_waiting = 16 * 1024; // bytes of pongs that a client does not read
constexpr std::size_t max_unread = 16 * 1024 * 1024;   // bytes that a client sends after it was closed
constexpr std::size_t max_unsent = 64 * 1024;          // bytes in the system's queue
constexpr std::size_t max_kept = 256 * 1024;           // capacity of a batch

} // namespace

web_socket::web_socket(loop& on, std::shared_ptr<http_requests> over, web_socket_limits limits, web_socket_times times)
    : loop_(on), over_(std::move(over)), reader_(web_socket_reader::from::clients, limits), times_(times), room_(on),
      timer_(on, [this] { on_timer(); }) {
    over_->line().on_late(nullptr);
    over_->line().until(time_point::max());
    over_->line().line().limit_unsent(max_unsent);
    pinged_at_ = loop_.now();
    timer_.arm(saturating_add(pinged_at_, times_.idle_ping));
}

task<std::optional<web_socket_message>> web_socket::next() {
    std::optional<web_socket_message> message;
    while (!aborted_) {
        if (rest_.empty()) {
            rest_ = co_await over_->read_raw();
            if (rest_.empty()) abort(); // the client has gone
            continue;                   // it may have been closed meanwhile
        }
        if (closing_) { // who closes on bytes that were not read may take the close frame back
            unread_ += rest_.size();
            rest_ = {};
            if (unread_ > max_unread) abort();
            continue;
        }
        auto used = reader_.feed(rest_);
        if (!used) {
            close(reader_.refusal(), used.error().message());
            continue;
        }
        rest_ = rest_.subspan(*used);
        if (!reader_.complete()) continue;
        auto got = reader_.take();
        if (got.kind == web_socket_opcode::text || got.kind == web_socket_opcode::binary) {
            ++counts_.received;
            message = std::move(got);
            break;
        }
        if (got.kind == web_socket_opcode::ping) {
            append_frame(control_, web_socket_opcode::pong, got.payload);
            if (control_.size() > max_control_waiting) close(web_socket_code::policy, "pongs are not read");
            wake();
        } else if (got.kind == web_socket_opcode::pong) {
            on_pong(got.payload);
        } else { // the same code goes back; a close frame without one is answered by 1000
            end(got.code == web_socket_code::no_status ? web_socket_code::normal : got.code, {});
        }
    }
    co_return message;
}

void web_socket::close(web_socket_code code, std::string reason) {
    if (over()) return;
    cause_ = reason;
    end(code, std::move(reason));
}

void web_socket::end(web_socket_code code, std::string reason) {
    if (over()) return;
    auto& made = closing_.emplace();
    made.code = code;
    made.reason = std::move(reason);
    timer_.arm(saturating_add(loop_.now(), times_.closing));
    wake();
}

void web_socket::abort() noexcept {
    if (std::exchange(aborted_, true)) return;
    timer_.disarm();
    over_->line().line().close();
    wake();
}

void web_socket::wake() {
    woken_ = true;
    room_.resume({});
}

bool web_socket::held() const { return ping_unanswered_ && loop_.now() - pinged_at_ >= times_.hold; }

void web_socket::on_pong(std::string_view payload) {
    if (!ping_unanswered_ || payload != std::to_string(ping_)) return; // one that nobody asked for is allowed
    ping_unanswered_ = false;
    counts_.round_trip = loop_.now() - pinged_at_;
    timer_.arm(saturating_add(loop_.now(), times_.idle_ping));
    if (std::exchange(counts_.held, false)) wake();
}

void web_socket::on_timer() {
    if (closing_) return abort();
    if (!ping_unanswered_) {
        append_frame(control_, web_socket_opcode::ping, std::to_string(++ping_));
        ping_unanswered_ = true;
        pinged_at_ = loop_.now();
        timer_.arm(saturating_add(pinged_at_, times_.lost));
        wake();
        return;
    }
    cause_ = fmt::format("the client did not answer a ping for {} s",
                         std::chrono::duration_cast<std::chrono::seconds>(times_.lost).count());
    abort();
}

/// What is to be sent next.
void web_socket::collect(std::string& to) {
    to.append(control_);
    control_.clear();
    if (closing_) {
        append_close(to, closing_->code, closing_->reason);
        close_sent_ = true;
        return;
    }
    counts_.held = held();
    if (counts_.held || !fill_) return;
    const auto before = to.size();
    fill_(to);
    if (to.size() == before || ping_unanswered_ || loop_.now() - pinged_at_ < times_.ping) return;
    append_frame(to, web_socket_opcode::ping, std::to_string(++ping_));
    ping_unanswered_ = true;
    pinged_at_ = loop_.now();
    timer_.arm(saturating_add(pinged_at_, times_.lost));
}

task<> web_socket::write(std::shared_ptr<web_socket> self) {
    auto held = std::move(self);
    auto& me = *held;
    auto& line = me.over_->line();
    struct leaving {
        web_socket& mine;
        ~leaving() {
            if (!mine.close_sent_) mine.abort();
        }
    } guard{me};
    std::string batch;
    while (!me.aborted_ && !me.close_sent_) {
        me.woken_ = false;
        batch.clear();
        me.collect(batch);
        if (batch.empty()) {
            if (!me.woken_) co_await me.room_.wait();
            continue;
        }
        line.until(saturating_add(me.loop_.now(), me.times_.write));
        auto unsent = co_await line.write_all(batch);
        line.until(time_point::max());
        if (unsent) {
            if (line.late()) me.cause_ = "the client takes nothing";
            me.abort();
            co_return;
        }
        me.counts_.sent_bytes += batch.size();
        if (batch.capacity() > max_kept) batch = std::string();
    }
    if (!me.aborted_) line.line().shutdown_write();
}

} // namespace ise
