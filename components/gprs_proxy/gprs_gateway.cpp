#include <components/gprs_proxy/gprs_gateway.hpp>

#include <components/gprs/line.hpp>
#include <components/gprs_proxy/services.hpp>

#include <ise/core/loop.hpp>
#include <ise/net/connect.hpp>
#include <ise/service/service_host.hpp>

#include <asio/buffer.hpp>
#include <asio/error.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <utility>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr std::string_view boat_mark = "{boat}";
} // namespace

struct gprs_gateway::call {
    explicit call(gprs_gateway& self)
        : late(self.on(), [this, &self] { self.refuse(*this, "it has not logged in within the time allowed"); }) {}

    std::unique_ptr<ise::stream> boat, proxy;
    std::unique_ptr<ise::net::fair_places::place> place;
    ise::timer late;
    gprs_call what; // `boat` is empty before its login
    std::string head;
    bool over = false;
};

gprs_gateway::gprs_gateway(gprs_gateway_options options) : options_(std::move(options)) {}
gprs_gateway::~gprs_gateway() = default;

ise::task<> gprs_gateway::run() {
    if (options_.proxy.find(boat_mark) == std::string::npos)
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("'{}' names one proxy for all boats: write {{boat}} for a boat's id, such as "
                                     "{{boat}}/shore/gprs",
                                     options_.proxy));
    if (options_.listen.empty())
        throw ise::error(ise::errc::invalid_argument,
                         "the boats have nowhere to call: name an endpoint such as tcp://0.0.0.0:7419");
    calls_.clear();
    places_.emplace(options_.max_connections);
    counts_ = {};
    std::vector<ise::endpoint> listening;
    for (const auto& text : options_.listen) {
        listening.push_back(open(ise::endpoint::parse(text).value()));
        counts_.listening.push_back(listening.back().text());
        log().info("boats can call", {{"at", listening.back().text()}});
    }
    publish_every(services::gprs_gateway, 2s, [this] { return state(); });
    if (options_.on_listening) options_.on_listening(listening);
    co_return;
}

ise::endpoint gprs_gateway::open(const ise::endpoint& at) {
    if (at.kind != ise::protocol::tcp && at.kind != ise::protocol::tls)
        throw ise::error(ise::errc::invalid_argument,
                         fmt::format("boats call the gateway over tcp or tls, not {}: such as tcp://0.0.0.0:7419 (a "
                                     "boat that sends datagrams calls its proxy)",
                                     at.text()));
    auto made = at.kind == ise::protocol::tls ? at.kind->listen(on(), at, services().peers().credentials())
                                              : env().listen(on(), at);
    std::shared_ptr<ise::listener> listener = std::move(made.value());
    auto where = listener->where();
    spawn("boats at " + where.text(),
          ise::net::accept_each(on(), std::move(listener), &*places_, ise::net::log_to(on(), log()),
                                [this](ise::net::admitted who) { take(std::move(who)); }));
    return where;
}

void gprs_gateway::take(ise::net::admitted who) {
    if (who.refused) {
        ++counts_.refused;
        counts_.trouble = "every place is taken";
        return;
    }
    auto made = std::make_shared<call>(*this);
    made->boat = std::move(who.line);
    made->place = std::move(who.place);
    made->what.from = made->boat->peer();
    made->place->on_displaced([this, whose = made.get()] { refuse(*whose, "every place is taken"); });
    made->late.arm(ise::saturating_add(now(), options_.login_time));
    calls_.push_back(made);
    spawn("connection", carry(std::move(made)));
}

ise::task<> gprs_gateway::carry(std::shared_ptr<call> of) {
    auto boat = co_await read_login(of);
    if (!boat || of->over) co_return;
    of->late.disarm();
    of->place->serve();
    auto proxy = co_await reach(*boat);
    if (of->over) co_return;
    if (!proxy) {
        refuse(*of, fmt::format("the GPRS proxy of '{}' is not reached: {}", *boat, proxy.error().message()));
        co_return;
    }
    of->proxy = std::move(*proxy);
    of->what.boat = std::move(*boat);
    of->what.since = std::chrono::floor<std::chrono::milliseconds>(wall());
    ++counts_.logins;
    log().info("a boat is relayed", {{"boat", of->what.boat}, {"from", of->what.from}});
    spawn("connection down", pump(of, false));
    co_await pump(std::move(of), true);
}

/// The boat's id. Nothing: the connection was closed.
ise::task<std::optional<std::string>> gprs_gateway::read_login(std::shared_ptr<call> of) {
    std::array<std::byte, gprs::max_line> buffer;
    std::size_t begin = 0; // of the line; empty ones count for nothing
    for (;;) {
        auto got = co_await of->boat->read_some(asio::buffer(buffer));
        if (of->over) co_return std::nullopt;
        of->head += ise::as_text(ise::bytes_view(buffer).first(got.bytes));
        begin = std::min(of->head.find_first_not_of("\r\n", begin), of->head.size());
        auto end = of->head.find_first_of("\r\n", begin);
        if (end != std::string::npos) {
            auto line = gprs::parse(std::string_view(of->head).substr(begin, end - begin));
            const auto* login = line ? std::get_if<gprs::login>(&*line) : nullptr;
            if (login) co_return login->id;
            refuse(*of, line ? std::string("its first line is not a login") : line.error().message());
            co_return std::nullopt;
        }
        if (got.problem || of->head.size() > gprs::max_line + 2) {
            refuse(*of, got.problem ? "it ended without a login: " + got.problem.message()
                                    : std::string("its first line is too long for a login"));
            co_return std::nullopt;
        }
    }
}

/// A connection to the proxy of that boat, which says itself where it listens.
ise::task<ise::result<std::unique_ptr<ise::stream>>> gprs_gateway::reach(std::string boat) {
    auto path = options_.proxy;
    path.replace(path.find(boat_mark), boat_mark.size(), boat);
    auto until = ise::saturating_add(now(), options_.login_time);
    std::vector<std::string> listening;
    try {
        auto options = ise::subscribe_options::keep_latest();
        options.deadline = options_.login_time;
        auto proxy = at(path);
        auto states = co_await proxy.subscribe(services::gprs, options);
        auto state = co_await states.next();
        if (state) listening = state->listening;
    } catch (const ise::error& problem) {
        co_return problem.why();
    }
    for (const auto& text : listening) {
        auto where = ise::endpoint::parse(text);
        if (!where || where->kind != ise::protocol::tcp) continue;
        auto made = co_await ise::net::connect_until(on(), *where, until);
        co_return made;
    }
    co_return ise::failure(ise::errc::unreachable, path + " listens on no tcp endpoint; give it one that the gateway "
                                                          "reaches, such as --boat-listen tcp://127.0.0.1:0");
}

/// Passes on what comes, until either side ends. Reads no more than the other side takes.
ise::task<> gprs_gateway::pump(std::shared_ptr<call> of, bool up) {
    auto& from = up ? *of->boat : *of->proxy;
    auto& to = up ? *of->proxy : *of->boat;
    std::string bytes = up ? std::move(of->head) : std::string();
    std::array<std::byte, 2048> buffer;
    std::error_code problem;
    while (!problem && !of->over) {
        for (std::size_t written = 0; written < bytes.size();) {
            std::array<asio::const_buffer, 1> rest{asio::buffer(bytes.data() + written, bytes.size() - written)};
            auto done = to.try_write(rest);
            written += done.bytes;
            problem = done.problem;
            if (problem == asio::error::would_block) problem = co_await to.wait_writable();
            if (problem || of->over) break;
        }
        if (problem || of->over) break;
        auto got = co_await from.read_some(asio::buffer(buffer));
        bytes.assign(ise::as_text(ise::bytes_view(buffer).first(got.bytes)));
        if (bytes.empty()) problem = got.problem; // else the next read says it again
    }
    end(*of);
}

void gprs_gateway::refuse(call& of, const std::string& why) {
    if (of.over) return;
    ++counts_.refused;
    counts_.trouble = why;
    if (auto left_out = refusals_.admit(now()))
        log().warning("a connection was closed",
                      {{"from", of.what.from}, {"cause", why}, {"not_told_before", std::to_string(*left_out)}});
    end(of);
}

void gprs_gateway::end(call& of) {
    if (std::exchange(of.over, true)) return;
    of.late.disarm();
    of.place.reset();
    of.boat->close();
    if (of.proxy) of.proxy->close();
    auto listed = std::find_if(calls_.begin(), calls_.end(), [&](const auto& one) { return one.get() == &of; });
    on().later([held = *listed] {}); // its own timer may have brought us here
    calls_.erase(listed);
}

gprs_gateway_state gprs_gateway::state() const {
    auto made = counts_;
    for (const auto& one : calls_)
        if (!one->what.boat.empty()) made.calls.push_back(one->what);
    return made;
}

} // namespace atirma
