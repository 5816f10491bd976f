#include <ise/session/host_memory.hpp>

#include <ise/net/connection.hpp>
#include <ise/net/fair_places.hpp>

#include <algorithm>

namespace ise {

host_memory::held host_memory::with(net::connection& one) {
    auto& all = by_host_[net::host_of(one.terms().peer.verified.from)];
    all.insert(&one);
    held sum;
    for (auto at = all.begin(); at != all.end();) {
        const held its{(*at)->out().pending_call_bytes(), (*at)->unfinished_bytes()};
        if (*at != &one && std::max(its.unread_replies, its.unfinished_messages) <= free_bytes) {
            at = all.erase(at);
            continue;
        }
        sum.unread_replies += its.unread_replies;
        sum.unfinished_messages += its.unfinished_messages;
        ++at;
    }
    return sum;
}

void host_memory::forget(net::connection& one) noexcept {
    for (auto host = by_host_.begin(); host != by_host_.end();) {
        host->second.erase(&one);
        host = host->second.empty() ? by_host_.erase(host) : std::next(host);
    }
}

} // namespace ise
