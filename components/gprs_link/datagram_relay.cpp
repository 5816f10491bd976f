#include <components/gprs_link/datagram_relay.hpp>

#include <ise/core/sleep.hpp>

#include <asio/error.hpp>

#include <algorithm>

namespace atirma {
namespace {
using namespace std::chrono_literals;
constexpr ise::duration pause_after_error = 250ms;
} // namespace

ise::result<ise::endpoint> datagram_relay::open(const ise::endpoint& at) {
    auto made = loop_.env().open_datagram(loop_, at);
    if (!made) return made.error();
    std::shared_ptr<ise::datagram_socket> channel = std::move(*made);
    auto where = channel->where();
    spawn_("boats at " + where.text(), from_boats(std::move(channel)));
    return where;
}

ise::task<> datagram_relay::from_boats(std::shared_ptr<ise::datagram_socket> channel) {
    for (;;) {
        auto [problem, got] = co_await channel->receive();
        if (problem == asio::error::operation_aborted) co_return;
        if (problem) {
            log_.warning("the socket for datagrams failed", {{"cause", problem.message()}});
            co_await ise::sleep_for(loop_, pause_after_error);
            continue;
        }
        if (auto of = flow_of(channel, got->peer)) send(*of, true, got->content);
    }
}

ise::task<> datagram_relay::from_proxy(std::shared_ptr<flow> of, std::shared_ptr<ise::datagram_socket> out) {
    for (;;) {
        auto [problem, got] = co_await out->receive();
        if (of->over || of->out != out) co_return;
        if (problem == asio::error::operation_aborted) co_return;
        if (problem) co_await ise::sleep_for(loop_, pause_after_error);
        else send(*of, false, got->content);
    }
}

std::shared_ptr<datagram_relay::flow> datagram_relay::flow_of(const std::shared_ptr<ise::datagram_socket>& channel,
                                                              const ise::endpoint& boat) {
    auto known = std::find_if(flows_.begin(), flows_.end(),
                              [&](const auto& one) { return one->channel == channel && one->boat == boat; });
    if (known != flows_.end()) {
        flows_.splice(flows_.begin(), flows_, known);
        return flows_.front();
    }
    if (flows_.size() >= max_flows) end(*flows_.back());
    auto made = std::make_shared<flow>(*this);
    made->channel = channel;
    made->boat = boat;
    if (!connect(made)) return nullptr;
    flows_.push_front(made);
    return made;
}

bool datagram_relay::connect(const std::shared_ptr<flow>& of) {
    ise::endpoint any;
    any.kind = ise::protocol::udp;
    any.host = proxy_.host.find(':') == std::string::npos ? "0.0.0.0" : "::";
    auto opened = loop_.env().open_datagram(loop_, any);
    if (!opened) {
        log_.warning("no socket towards the proxy", {{"cause", opened.error().message()}});
        return false;
    }
    if (of->out) of->out->close();
    of->out = std::move(*opened);
    spawn_("datagrams of the proxy", from_proxy(of, of->out));
    return true;
}

void datagram_relay::send(flow& of, bool upward, ise::bytes content) {
    of.used = loop_.now();
    if (!air_.up || of.frozen || air_.loses() || of.under_way.size() >= max_held) ++air_.datagrams_lost;
    else of.under_way.emplace(ise::saturating_add(of.used, air_.flight()), std::pair(upward, std::move(content)));
    turn(of);
}

void datagram_relay::turn(flow& of) {
    while (!of.over && !of.under_way.empty() && of.under_way.begin()->first <= loop_.now()) {
        auto [upward, content] = std::move(of.under_way.begin()->second);
        of.under_way.erase(of.under_way.begin());
        auto problem = !air_.up || of.frozen ? std::error_code(asio::error::network_down)
                       : upward              ? of.out->try_send(proxy_, content)
                                             : of.channel->try_send(of.boat, content);
        if (problem) ++air_.datagrams_lost;
        else (upward ? air_.bytes_up : air_.bytes_down) += content.size();
    }
    if (of.over) return;
    auto idle_until = ise::saturating_add(of.used, max_idle);
    if (!of.under_way.empty()) of.due.arm(of.under_way.begin()->first);
    else if (loop_.now() < idle_until) of.due.arm(idle_until);
    else end(of);
}

void datagram_relay::end(const flow& of) {
    auto found = std::find_if(flows_.begin(), flows_.end(), [&](const auto& one) { return one.get() == &of; });
    if (found == flows_.end()) return;
    auto held = std::move(*found); // until here, whoever else has it
    flows_.erase(found);
    held->over = true;
    held->due.disarm();
    held->out->close();
}

void datagram_relay::change_addresses() {
    for (const auto& one : flows_) connect(one);
}

void datagram_relay::freeze_all() {
    for (const auto& one : flows_) one->frozen = true;
}

std::size_t datagram_relay::frozen() const {
    return static_cast<std::size_t>(
        std::count_if(flows_.begin(), flows_.end(), [](const auto& one) { return one->frozen; }));
}

} // namespace atirma
