#include "observer.hpp"

#include <components/boat/find_component.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::size_t max_line = 1u << 20; // a snapshot with its whole track is one line
} // namespace

std::string observation::text() const {
    std::string types;
    std::uint64_t packets = 0;
    for (const auto& [type, count] : telemetry) {
        packets += count;
        types += fmt::format("{}{} {}", types.empty() ? "" : ", ", type, count);
    }
    auto out = fmt::format("telemetry     {} packets{}{}\n", packets, types.empty() ? "" : ": ", types);
    std::string by_link;
    for (const auto& [link, count] : links) by_link += fmt::format("{}{} {}", by_link.empty() ? "" : ", ", link, count);
    out += fmt::format("links         {}; {} of it history, {} came twice\n", by_link.empty() ? "none" : by_link,
                       history, twice);
    out += fmt::format("telecommands  {} sent, {} acknowledged by the boat, {} pending, {} failed\n", telecommands,
                       acknowledged, pending, failed);
    out += fmt::format("dropped       {} between proxy and here", lost);
    if (local)
        out += fmt::format(", {} duplicates, {} malformed, {} of other modems, {} bad frames", local->duplicates,
                           local->malformed, local->foreign, local->frames_refused);
    out += "\n";
    if (local)
        out += fmt::format("modem         {}, last packet at {}, duty cycle {}\n",
                           local->modem_ready ? "answers" : local->trouble,
                           local->rssi_dbm ? fmt::format("{} dBm", *local->rssi_dbm) : "?",
                           local->duty_cycle_percent ? fmt::format("{} %", *local->duty_cycle_percent) : "?");
    if (gprs)
        out += fmt::format("gprs          {}, acknowledged up to {}, {} resent, {} given up\n",
                           gprs->connected ? "the boat is there by " + gprs->from : gprs->trouble, gprs->acknowledged,
                           gprs->resends, gprs->given_up);
    out += fmt::format("page          {} events with telemetry{}{}\n", page_updates, page_trouble.empty() ? "" : "; ",
                       page_trouble);
    return out;
}

ise::task<> observer::run() {
    auto until = now() + options_.length;
    auto proxies = options_.telemetry;
    if (proxies.empty()) proxies.push_back(options_.proxy);
    for (const auto& from : proxies) spawn("telemetry of " + from, follow_telemetry(from));
    for (const auto& from : proxies)
        if (from.ends_with("gprs")) spawn("link", follow_gprs(from));
    spawn("modem", follow_modem());
    spawn("ping", ping());
    if (options_.page) spawn("page", read_page());
    co_await sleep_till(until);
    stop();
}

ise::task<> observer::follow_telemetry(std::string from) {
    auto proxy = find_component(*this, from);
    for (;;) {
        try {
            auto packets = co_await proxy.subscribe(services::telemetry, ise::subscribe_options::keep_last(1024));
            for (;;) {
                auto packet = co_await packets.next();
                if (!packet) break;
                seen_->lost += packet.lost_before().value_or(0);
                if (!seen_->known.first_time(packet->boot, packet->sequence, packet->raw)) {
                    ++seen_->twice;
                    continue;
                }
                auto message = parse_telemetry(packet->raw);
                ++seen_->links[std::string(name_of(packet->link))];
                if (packet->history) ++seen_->history;
                ++seen_->telemetry[message ? std::string(name_of(message->body)) : "unreadable"];
            }
        } catch (const ise::error& why) {
            // Also of a proxy that stops meanwhile (cancelled): our own end throws at the next suspension.
            log().debug(why.what());
        }
        co_await sleep(200ms);
    }
}

ise::task<> observer::follow_modem() {
    auto proxy = find_component(*this, options_.proxy);
    for (;;) {
        try {
            auto states = co_await proxy.subscribe(services::xb_local, ise::subscribe_options::keep_latest());
            for (;;) {
                auto state = co_await states.next();
                if (!state) break;
                seen_->local = *state;
            }
        } catch (const ise::error&) { // as above
        }
        co_await sleep(200ms);
    }
}

ise::task<> observer::follow_gprs(std::string from) {
    auto proxy = find_component(*this, from);
    for (;;) {
        try {
            auto states = co_await proxy.subscribe(services::gprs, ise::subscribe_options::keep_latest());
            for (;;) {
                auto state = co_await states.next();
                if (!state) break;
                seen_->gprs = *state;
            }
        } catch (const ise::error&) { // as above
        }
        co_await sleep(200ms);
    }
}

ise::task<> observer::ping() {
    auto proxy = find_component(*this, options_.proxy);
    for (;;) {
        auto next = now() + options_.ping_period;
        telecommand_request request; // a ping, under an id that the proxy chooses
        request.valid_s = 60;
        ++seen_->telecommands;
        auto reply = co_await proxy.try_call(services::telecommand, request, 10s);
        if (!reply && reply.error().code() == ise::errc::cancelled) {
            --seen_->telecommands; // the time is over: it says nothing about the boat
        } else if (!reply) {
            ++seen_->failed;
            log().warning(reply.error().message());
        } else if (reply->state == telecommand_stage::acknowledged) {
            ++seen_->acknowledged;
        } else if (reply->state == telecommand_stage::pending) {
            ++seen_->pending;
        } else {
            ++seen_->failed;
        }
        co_await sleep_till(next);
    }
}

ise::task<> observer::read_page() {
    auto page = *options_.page;
    for (;;) {
        auto why = co_await read_stream(page);
        seen_->page_trouble = why;
        co_await sleep(500ms);
    }
}

/// Reads the event stream until it ends; says why.
ise::task<std::string> observer::read_stream(ise::endpoint from) {
    auto connected = co_await env().connect(on(), from);
    if (!connected) co_return connected.error().message();
    auto& line = **connected;
    auto request =
        fmt::format("GET /events HTTP/1.1\r\nHost: {}:{}\r\nAccept: text/event-stream\r\n\r\n", from.host, from.port);
    std::string_view rest = request;
    while (!rest.empty()) {
        asio::const_buffer piece(rest.data(), rest.size());
        auto moved = line.try_write(std::span(&piece, 1));
        rest.remove_prefix(moved.bytes);
        if (moved.problem == asio::error::would_block) {
            auto problem = co_await line.wait_writable();
            if (problem) co_return problem.message();
        } else if (moved.problem) {
            co_return moved.problem.message();
        }
    }
    std::string text;
    std::array<char, 4096> buffer;
    std::string event;
    seen_->page_trouble.clear();
    for (;;) {
        auto got = co_await line.read_some(asio::buffer(buffer));
        text.append(buffer.data(), got.bytes);
        for (std::size_t end; (end = text.find('\n')) != std::string::npos; text.erase(0, end + 1)) {
            std::string_view output(text.data(), end);
            if (output.starts_with("event: ")) event = output.substr(7);
            // What came by telemetry, not that the server lives.
            if (output.starts_with("data: ") && event.starts_with("update") &&
                output.find("\"position\"") != std::string_view::npos)
                ++seen_->page_updates;
        }
        if (text.size() > max_line) co_return "the page's event stream is malformed";
        if (got.problem == asio::error::operation_aborted) co_return std::string(); // our time is over
        if (got.problem) co_return "the page's event stream ended: " + got.problem.message();
    }
}

} // namespace atirma
