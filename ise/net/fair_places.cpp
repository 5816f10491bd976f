#include <ise/net/fair_places.hpp>

#include <ise/core/transport.hpp>

#include <asio/ip/address.hpp>
#include <fmt/format.h>

#include <algorithm>
#include <system_error>
#include <utility>

namespace ise::net {

std::string host_of(std::string_view peer) {
    auto at = peer;
    if (auto scheme = at.find("://"); scheme != std::string_view::npos) at.remove_prefix(scheme + 3);
    if (at.starts_with('[')) at = at.substr(1, at.find(']') - 1);
    else at = at.substr(0, at.rfind(':'));
    std::error_code none;
    auto address = asio::ip::make_address(std::string(at), none);
    if (none) {
        const auto* over = transport_of(peer);
        return std::string(over && over->address != address_form::host_and_port ? peer : at);
    }
    if (address.is_v6() && address.to_v6().is_v4_mapped())
        address = asio::ip::make_address_v4(asio::ip::v4_mapped, address.to_v6());
    if (address.is_loopback()) return "127.0.0.1";
    if (address.is_v4()) return address.to_string();
    auto bytes = address.to_v6().to_bytes();
    std::string network;
    for (std::size_t i = 0; i < 8; i += 2) network += fmt::format("{:x}:", bytes[i] << 8 | bytes[i + 1]);
    return network + ":/64";
}

fair_places::place::place(fair_places& of, host& whose) : of_(of), host_(&whose) {
    enlist(host_->waiting);
    ++of_.taken_;
}

fair_places::place::~place() { leave(); }

void fair_places::place::enlist(std::list<place*>& in) {
    since_ = ++of_.order_;
    if (list_) in.splice(in.end(), *list_, entry_);
    else entry_ = in.insert(in.end(), this);
    list_ = &in;
}

void fair_places::place::leave() noexcept {
    if (!host_) return;
    list_->erase(entry_);
    --of_.taken_;
    auto* left = std::exchange(host_, nullptr);
    if (left->count() > 0) return;
    auto found = of_.hosts_.find(left->name);
    if (found != of_.hosts_.end()) of_.hosts_.erase(found);
}

void fair_places::place::serve() {
    if (host_ && list_ != &host_->served) enlist(host_->served);
}

void fair_places::place::wait() {
    if (host_) enlist(host_->waiting);
}

std::unique_ptr<fair_places::place> fair_places::take(std::string_view peer) {
    auto name = host_of(peer);
    if (taken_ >= most_) {
        auto known = hosts_.find(name);
        const auto mine = (known == hosts_.end() ? 0 : known->second.count()) + 1; // with the newcomer
        auto count_of = [&](const host& one) { return one.count() + (one.name == name ? 1 : 0); };
        auto top = mine;
        for (const auto& [key, one] : hosts_) top = std::max(top, count_of(one));
        place *waits = nullptr, *served = nullptr;
        auto oldest = [](place*& so_far, const std::list<place*>& of) {
            if (!of.empty() && (!so_far || of.front()->since_ < so_far->since_)) so_far = of.front();
        };
        for (const auto& [key, one] : hosts_) {
            if (count_of(one) != top) continue;
            oldest(waits, one.waiting);
            oldest(served, one.served);
        }
        auto* loses = waits ? waits : top > mine ? served : nullptr;
        if (!loses) {
            ++refused_;
            return nullptr;
        }
        displace(*loses);
    }
    auto& whose = hosts_[name];
    whose.name = std::move(name);
    return std::unique_ptr<place>(new place(*this, whose));
}

bool fair_places::make_way() {
    const host* greediest = nullptr;
    for (const auto& [key, one] : hosts_) {
        if (one.waiting.empty()) continue;
        if (!greediest || one.count() > greediest->count() ||
            (one.count() == greediest->count() && one.waiting.front()->since_ < greediest->waiting.front()->since_))
            greediest = &one;
    }
    if (!greediest) return false;
    displace(*greediest->waiting.front());
    return true;
}

void fair_places::displace(place& who) {
    ++displaced_;
    auto give_up = std::move(who.give_up_);
    who.leave();
    if (give_up) give_up(); // may destroy the place
}

} // namespace ise::net
