#pragma once
#include <components/boat/notifier.hpp>
#include <components/communication_node/node_context.hpp>
#include <components/communication_node/peer_watch.hpp>
#include <components/communication_node/services.hpp>

#include <functional>
#include <utility>

namespace atirma {

/// The other node as this one sees it: whether it lives, what of this store it has, and waiting for more of it.
class other_node : peer_watch {
public:
    /// `on_silence` is called when the other node may have become silent.
    other_node(node_context& here, std::function<void()> on_silence)
        : peer_watch(here.has_peer(), here.options.silence, here.now()), here_(here), news_(here.self.on()),
          progress_(here.self.on()), silence_(here.self.on(), std::move(on_silence)) {}

    /// It requests more. `shared`: what it has of the present store.
    void on_request(const replication_request& request, const store_part& shared) {
        peer_watch::on_request(here_.now(), request.keeps, shared.packets, shared.commands, request.authority_epoch,
                               request.authority_change);
        watch_silence();
    }
    void watch_silence() {
        if (!silent()) silence_.arm(silent_at());
    }

    using peer_watch::forget;
    using peer_watch::has_authority;
    using peer_watch::has_commands;
    using peer_watch::has_packets;
    using peer_watch::misses;
    bool silent() const { return peer_watch::silent(here_.now()); }
    bool lives() const { return peer_watch::lives(here_.now()); }
    std::uint64_t shown(std::uint64_t head) const { return peer_watch::shown(head, here_.now()); }

    void notify_news() { news_.notify(); } ///< there is something that the other node does not have
    ise::task<> wait_for_news(ise::time_point until) { return news_.wait(until); }
    void notify_progress() { progress_.notify(); } ///< it has more, or is silent
    ise::task<> wait_for_progress() { return progress_.wait(silent_at()); }

private:
    node_context& here_;
    notifier news_, progress_;
    ise::timer silence_;
};

} // namespace atirma
