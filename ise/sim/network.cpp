#include <ise/sim/network.hpp>

#include <algorithm>

namespace ise::sim {

link& network::between(const std::string& a, const std::string& b) {
    auto key = a <= b ? std::pair(a, b) : std::pair(b, a);
    auto& found = links_[key];
    if (!found) {
        found.reset(new link(generator(world_.seed(), "link " + key.first + " " + key.second)));
        if (a == b) found->latency = std::chrono::microseconds(20);
    }
    return *found;
}

void network::partition(const std::string& a, const std::string& b) {
    between(a, b).partitioned_ = true;
    world_.note("partition", a + "|" + b);
}

void network::heal(const std::string& a, const std::string& b) {
    between(a, b).partitioned_ = false;
    world_.note("heal", a + "|" + b);
    look_again();
}

void network::look_again() {
    // What is still stopped, by another link or by a host that is down, comes back here.
    for (auto& each : std::exchange(held_, {}))
        if (auto life = each.life.lock()) each.go_on();
}

void network::isolate(const std::string& host) {
    for (const auto& [other, _] : hosts_)
        if (other != host) partition(host, other);
}

void network::heal_all() {
    for (auto& [names, each] : links_)
        if (each->partitioned_) heal(names.first, names.second);
}

void network::cut(const std::string& client, const std::string& server, direction which, std::uint64_t after_bytes) {
    cuts_to_come_.push_back({client, server, which, after_bytes});
}

std::optional<network::cut_rule> network::take_cut(const machine& client, const machine& server) {
    auto found = std::find_if(cuts_to_come_.begin(), cuts_to_come_.end(), [&](const cut_rule& rule) {
        return rule.client == client.name() && rule.server == server.name();
    });
    if (found == cuts_to_come_.end()) return {};
    auto taken = *found;
    cuts_to_come_.erase(found);
    return taken;
}

machine* network::find(const std::string& wanted) const {
    if (auto found = hosts_.find(wanted); found != hosts_.end()) return found->second;
    for (const auto& [_, each] : hosts_)
        if (each->address() == wanted) return each;
    return nullptr;
}

bool network::passes(const machine& from, const machine& to) {
    return to.up() && !between(from.name(), to.name()).partitioned_;
}

network::flight network::send(link& over, bool upward, std::size_t size) {
    flight made{world_.now(), {}};
    if (over.bandwidth_bytes_per_second > 0) {
        auto& free_at = over.free_at_[upward];
        made.departs = std::max(free_at, world_.now()) +
                       duration(static_cast<duration::rep>(size * 1'000'000'000ull / over.bandwidth_bytes_per_second));
        free_at = made.departs;
    }
    made.arrives = made.departs + over.latency;
    if (over.jitter.count() > 0)
        made.arrives +=
            duration(static_cast<duration::rep>(over.random_.below(static_cast<std::uint64_t>(over.jitter.count()))));
    return made;
}

duration network::queue(const link& over, bool upward) const {
    return over.free_at_[upward] > world_.now() ? over.free_at_[upward] - world_.now() : duration{};
}

void network::hold_until_heal(std::weak_ptr<void> life, std::function<void()> go_on) {
    std::erase_if(held_, [](const held& each) { return each.life.expired(); });
    held_.push_back({std::move(life), std::move(go_on)});
}

} // namespace ise::sim
