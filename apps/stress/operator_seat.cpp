#include "operator_seat.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace atirma::stress {
namespace {

using namespace std::chrono_literals;

constexpr ise::duration grace = 2min; // after a telecommand's validity, until nobody is asked any more

void rethrow_if_cancelled(const ise::failure& why) {
    if (why.code() == ise::errc::cancelled) throw ise::error(why);
}

} // namespace

operator_seat::~operator_seat() {
    if (follower_ && !has_left_) self_.seen = follower_->seen; // killed; else somebody may sit here again already
}

ise::task<> operator_seat::run() {
    nodes_ = at(std::string(communication_role));
    follower_ = std::make_unique<telemetry_follower>(*this, nodes_, [this](const telemetry_packet& packet) {
        if (self_.shown.first_time(packet.boot, packet.sequence, packet.raw))
            book_.shown(self_.name, key_of(packet.boot, packet.sequence));
    });
    follower_->seen = self_.seen;
    spawn("telemetry", follow());
    listen(nodes_, services::authority_changes, [this](const authority_state&) { ++self_.authority_changes; });
    for (std::size_t i = 0; i < self_.commands.size(); ++i)
        if (self_.commands[i].decided.count() < 0) {
            if (self_.commands[i].request.id == 0) self_.commands[i].request.id = id_of(i);
            spawn("asks again", give(i));
        }
    try {
        auto working = work();
        co_await std::move(working);
    } catch (...) { // he leaves, and takes along what he has seen
        self_.seen = follower_->seen;
        has_left_ = true;
        throw;
    }
}

ise::task<> operator_seat::work() {
    while (!self_.may_begin) co_await sleep(200ms);
    for (; self_.next_order < self_.orders.size(); ++self_.next_order) {
        auto what = self_.orders[self_.next_order];
        if (what.at > time_()) co_await sleep(what.at - time_());
        spawn("order", carry_out(std::move(what)));
    }
    for (;;) co_await sleep(1h);
}

ise::task<> operator_seat::follow() {
    for (;;) {
        try {
            auto following = follower_->run();
            co_await std::move(following);
        } catch (const ise::error& problem) {
            // Also of a node that stops meanwhile (cancelled): our own end throws at the next suspension.
            log().debug("cannot subscribe to the communication nodes", {{"cause", problem.what()}});
        }
        co_await sleep(1s);
    }
}

ise::task<> operator_seat::carry_out(order what) {
    for (const auto& step : what.steps) {
        auto which = self_.commands.size();
        auto& one = self_.commands.emplace_back();
        one.asked = time_();
        if (!what.by_console) one.request.id = id_of(which);
        one.request.command = step;
        one.request.valid_s = what.valid_s;
        // However late it is taken.
        one.request.valid_until = std::chrono::floor<std::chrono::milliseconds>(wall()) +
                                  std::chrono::seconds(static_cast<std::int64_t>(what.valid_s));
        one.valid_until = one.asked + std::chrono::seconds(static_cast<std::int64_t>(what.valid_s));
        one.request.via = what.via;
        one.request.confirmed = !step.danger().empty();
        if (what.by_console) {
            auto giving = give_at_console(which);
            co_await std::move(giving);
        } else {
            auto giving = give(which);
            co_await std::move(giving);
        }
        if (self_.commands[which].state != telecommand_stage::acknowledged) co_return;
    }
}

std::uint32_t operator_seat::id_of(std::size_t which) const {
    return static_cast<std::uint32_t>((self_.index + 1) * 100'000 + which + 1);
}

ise::duration operator_seat::until(const given_command& one) const {
    return one.asked + std::chrono::duration_cast<ise::duration>(std::chrono::duration<float>(*one.request.valid_s)) +
           grace;
}

/// As by hand: the console chooses the id and asks on; what became of it is read off its list.
ise::task<> operator_seat::give_at_console(std::size_t which) {
    while (at_console_) co_await sleep(500ms);
    struct busy {
        bool& flag;
        explicit busy(bool& of) : flag(of) { flag = true; }
        ~busy() { flag = false; }
    } guard(at_console_);
    std::uint32_t newest = 0;
    auto own = [&] {
        std::vector<const console::command_entry*> all;
        auto shown = console_->latest()->commands;
        if (shown)
            for (const auto& one : *shown)
                if (one.own) all.push_back(&one);
        return std::pair(all, shown);
    };
    if (auto known = own().first; !known.empty()) newest = known.back()->id;
    console::give_command what;
    what.command = self_.commands[which].request.command;
    what.via = std::string(communication_role);
    what.valid_s = self_.commands[which].request.valid_s;
    what.over_limits = true; // random commands: their courses are nobody's
    auto last = until(self_.commands[which]);
    for (bool taken = false; !taken && time_() < last;) {
        taken = console_->act(what);
        self_.commands[which].valid_until =
            time_() + std::chrono::seconds(static_cast<std::int64_t>(what.valid_s.value_or(0)));
        if (!taken) co_await sleep(1s); // it is just starting
    }
    ++self_.commands[which].asks;
    while (time_() < last) {
        co_await sleep(1s);
        auto [all, shown] = own();
        if (all.empty() || all.back()->id == newest) continue;
        auto& one = self_.commands[which];
        one.request.id = all.back()->id;
        if (!console::is_over(all.back()->phase)) continue;
        one.decided = time_();
        one.text = all.back()->text;
        using enum console::command_phase;
        one.state = all.back()->phase == done      ? telecommand_stage::acknowledged
                    : all.back()->phase == expired ? telecommand_stage::expired
                                                   : telecommand_stage::failed;
        if (all.back()->phase == done) one.result = ack_code::done;
        co_return;
    }
}

ise::task<> operator_seat::take_authority() {
    authority_request request;
    auto now_held = co_await nodes_.try_call(services::authority, request, 10s);
    if (!now_held) {
        rethrow_if_cancelled(now_held.error());
        co_return;
    }
    if (now_held->holder == path()) co_return;
    request.action = authority_action::take;
    request.confirmed = true;
    auto taken = co_await nodes_.try_call(services::authority, request, 10s);
    if (!taken) rethrow_if_cancelled(taken.error());
}

/// Asks the role, whichever node serves it, until the telecommand is decided.
ise::task<> operator_seat::give(std::size_t which) {
    auto request = self_.commands[which].request;
    auto last = until(self_.commands[which]);
    bool steers = traits_of(request.command.kind()).needs_authority;
    unsigned refusals = 0;
    for (;;) {
        if (steers) {
            auto taking = take_authority();
            co_await std::move(taking);
        }
        ++self_.commands[which].asks;
        auto reply = co_await nodes_.try_call(services::telecommand, request, 60s);
        auto& one = self_.commands[which];
        if (reply && is_final(reply->state)) {
            one.decided = time_();
            one.state = reply->state;
            one.result = reply->result;
            one.text = reply->text;
            co_return;
        }
        if (!reply) {
            rethrow_if_cancelled(reply.error());
            if (reply.error().code() == ise::errc::refused && ++refusals >= 3) {
                one.decided = time_();
                one.state = telecommand_stage::failed;
                one.text = reply.error().message();
                co_return;
            }
            co_await sleep(1s);
        }
        if (time_() > last) co_return; // it stays undecided, and the report says so
    }
}

} // namespace atirma::stress
