#include <ise/session/unread_replies.hpp>

#include <ise/net/connection.hpp>
#include <ise/net/fair_places.hpp>

namespace ise {

std::size_t unread_replies::with(net::connection& one) {
    auto& all = by_host_[net::host_of(one.peer_name())];
    all.insert(&one);
    std::size_t total = 0;
    for (auto at = all.begin(); at != all.end();) {
        auto waiting = (*at)->out().pending_call_bytes();
        if (waiting > free_bytes || *at == &one) total += waiting, ++at;
        else at = all.erase(at);
    }
    return total;
}

void unread_replies::forget(net::connection& one) noexcept {
    for (auto host = by_host_.begin(); host != by_host_.end();) {
        host->second.erase(&one);
        host = host->second.empty() ? by_host_.erase(host) : std::next(host);
    }
}

} // namespace ise
