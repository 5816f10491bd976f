#include <components/gprs_link/stream_relay.hpp>

#include <ise/core/sleep.hpp>
#include <ise/net/connect.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration connect_time = 10s, room_pause = 50ms;
constexpr std::size_t up = 0;
} // namespace

ise::result<ise::endpoint> stream_relay::open(const ise::endpoint& at) {
    auto made = loop_.env().listen(loop_, at);
    if (!made) return made.error();
    std::shared_ptr<ise::listener> listener = std::move(*made);
    auto where = listener->where();
    spawn_("boats at " + where.text(),
           ise::net::accept_each(loop_, std::move(listener), &places_, ise::net::log_to(loop_, log_),
                                 [this](ise::net::admitted who) { take(std::move(who)); }));
    return where;
}

void stream_relay::take(ise::net::admitted who) {
    if (!air_.up || who.refused) {
        ++air_.turned_away;
        return;
    }
    auto made = std::make_shared<call>(*this);
    made->boat = std::move(who.line);
    made->place = std::move(who.place);
    made->place->on_displaced([this, whose = made.get()] { end(*whose); });
    calls_.push_back(made);
    spawn_("connection", carry(std::move(made)));
}

ise::task<> stream_relay::carry(std::shared_ptr<call> of) {
    auto made = co_await ise::net::connect_until(loop_, proxy_, ise::saturating_add(loop_.now(), connect_time));
    if (of->over) co_return;
    if (!made) {
        ++air_.turned_away;
        log_.warning("the proxy is not reached", {{"cause", made.error().message()}});
        end(*of);
        co_return;
    }
    of->proxy = std::move(*made);
    of->halves[up].from = of->halves[1 - up].to = of->boat.get();
    of->halves[up].to = of->halves[1 - up].from = of->proxy.get();
    spawn_("connection up", pump(of, up));
    spawn_("connection down", pump(std::move(of), 1 - up));
}

/// Takes what comes from one side until that ends.
ise::task<> stream_relay::pump(std::shared_ptr<call> of, std::size_t which) {
    auto& way = of->halves[which];
    std::array<std::byte, 4096> buffer;
    while (!of->over) {
        if (way.held >= max_held) {
            co_await ise::sleep_for(loop_, room_pause);
            continue;
        }
        auto got = co_await way.from->read_some(asio::buffer(buffer));
        if (of->over) co_return;
        if (got.bytes > 0) {
            auto due = ise::saturating_add(loop_.now(), air_.flight());
            if (!way.under_way.empty()) due = std::max(due, way.under_way.back().due); // in order
            way.under_way.push_back(piece{due, std::string(ise::as_text(ise::bytes_view(buffer).first(got.bytes)))});
            way.held += got.bytes;
        }
        if (got.problem == asio::error::operation_aborted) co_return;
        if (got.problem == asio::error::eof) way.ended = true;
        if (got.problem && !way.ended && !of->frozen) end(*of);
        if (got.problem && of->frozen) way.ended = true; // nobody is told
        if (of->over) co_return;
        turn(*of);
        if (got.problem) co_return;
    }
}

/// Lets what is due go.
void stream_relay::turn(call& of) {
    if (of.over) return;
    if (of.frozen) {
        if (of.halves[0].ended && of.halves[1].ended) end(of);
        return;
    }
    if (!air_.up) return;
    auto now = loop_.now(), next = ise::time_point::max();
    for (std::size_t which = 0; which < of.halves.size(); ++which) {
        auto& way = of.halves[which];
        while (!way.under_way.empty() && way.under_way.front().due <= now) {
            way.unwritten.add(way.under_way.front().bytes);
            way.under_way.pop_front();
        }
        write(of, way, which == up);
        if (of.over) return;
        if (!way.under_way.empty()) next = std::min(next, way.under_way.front().due);
        if (way.unwritten.size() > 0) next = std::min(next, ise::saturating_add(now, room_pause));
    }
    if (of.halves[0].shut && of.halves[1].shut) return end(of);
    if (next == ise::time_point::max()) of.due.disarm();
    else of.due.arm(next);
}

void stream_relay::write(call& of, half& way, bool upward) {
    auto before = way.unwritten.size();
    if (before > 0) {
        if (way.unwritten.write(*way.to)) return end(of);
        auto gone = before - way.unwritten.size();
        way.held -= gone;
        (upward ? air_.bytes_up : air_.bytes_down) += gone;
    }
    if (!way.ended || way.shut || way.unwritten.size() > 0 || !way.under_way.empty()) return;
    way.shut = true;
    way.to->shutdown_write();
}

void stream_relay::end(call& of) {
    if (std::exchange(of.over, true)) return;
    of.due.disarm();
    of.place.reset();
    of.boat->close();
    if (of.proxy) of.proxy->close();
    auto listed = std::find_if(calls_.begin(), calls_.end(), [&](const auto& one) { return one.get() == &of; });
    loop_.later([held = *listed] {}); // its own timer may have brought us here
    calls_.erase(listed);
}

void stream_relay::look_again() {
    for (const auto& one : std::list(calls_)) turn(*one);
}

void stream_relay::drop_all() {
    for (const auto& one : std::list(calls_)) {
        if (!one->frozen) ++air_.dropped;
        end(*one);
    }
}

void stream_relay::freeze_all() {
    for (const auto& one : calls_) {
        one->frozen = true;
        one->due.disarm();
    }
}

std::size_t stream_relay::frozen() const {
    return static_cast<std::size_t>(
        std::count_if(calls_.begin(), calls_.end(), [](const auto& one) { return one->frozen; }));
}

std::size_t stream_relay::held() const {
    std::size_t all = 0;
    for (const auto& one : calls_) all += one->halves[0].held + one->halves[1].held;
    return all;
}

} // namespace atirma
