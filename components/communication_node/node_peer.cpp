// The other node: each asks the other for what it does not have, and says by that what it has.
#include <components/communication_node/node_core.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t page_size = 256;

} // namespace

ise::task<> communication_node::follow_peer() {
    auto& c = *core_;
    auto other = find_component(*this, options_.peer);
    for (;;) {
        replication_request request;
        request.node = path();
        request.secondary = options_.secondary;
        request.store = c.store.number();
        request.keeps = c.trouble.empty();
        request.your_store = c.store.peer().store;
        request.packets = c.store.peer().packets;
        request.commands = c.store.peer().commands;
        request.authority_epoch = c.authority.now().epoch;
        request.authority_change = c.authority.change();
        request.wait_s = std::chrono::duration<float>(options_.silence / 3).count();
        auto got = co_await other.try_call(services::replication, request, options_.silence);
        std::string why;
        if (!got) {
            // Also where it was stopped while it answered (cancelled): our own end throws at the next suspension.
            why = got.error().message();
        } else {
            bool more = got->more;
            auto taken = take_page(std::move(*got));
            if (!taken) why = taken.error().message();
            else c.caught_up = !more;
        }
        if (why != c.peer_trouble && !why.empty())
            log().warning("the other node tells nothing", {{"peer", options_.peer}, {"cause", why}});
        c.peer_trouble = why;
        consider_serving();
        if (!why.empty()) co_await sleep(500ms);
    }
}

ise::result<void> communication_node::take_page(replication_page page) {
    auto& c = *core_;
    if (page.store == c.store.number())
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("'{}' has the same store: give each node a file of its own", options_.peer));
    if (page.secondary == options_.secondary)
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("'{}' is {} too: start one of them as secondary, and one not", options_.peer,
                                        page.secondary ? "secondary" : "primary"));
    std::vector<command_record> news;
    for (const auto& record : page.commands) {
        const auto* known = c.desk.find(record.status.id);
        std::optional<command_record> on_disk;
        if (!known) {
            auto found = c.store.command(record.status.id);
            if (!found) return found.error();
            on_disk = std::move(*found);
            if (on_disk) known = &*on_disk;
        }
        if (!known || knows_more(record, *known)) news.push_back(record);
    }
    bool authority_is_news = c.authority.is_newer(page.authority, page.authority_change);
    bool nothing = page.packets.empty() && news.empty() && !authority_is_news && page.store == c.store.peer().store &&
                   page.commands_up_to <= c.store.peer().commands;
    if (nothing && c.trouble.empty()) return {};
    for (auto& one : page.packets)
        if (one.packet && c.newest.is_history(*one.packet)) one.packet->history = true;
    auto fresh = c.store.apply(page, news, authority_is_news);
    if (!fresh) {
        if (fresh.error().code() == ise::errc::io_failed) disk(&fresh.error());
        return fresh.error();
    }
    disk(nullptr);
    for (const auto& record : news) {
        if (!c.desk.know(now(), clock(), record, path())) continue;
        tell(record.status);
        if (record.status.boat_obeys) c.authority.boat_obeys(*record.status.boat_obeys, record.status.authority);
    }
    if (authority_is_news) {
        c.authority.apply(page.authority, page.authority_change);
        c.authorities(page.authority);
    }
    if (*fresh > 0 || !news.empty()) c.news.ring();
    show();
    work();
    return {};
}

ise::task<replication_page> communication_node::tell_peer(replication_request request) {
    auto& c = *core_;
    if (request.store == c.store.number())
        throw ise::error(ise::errc::refused, fmt::format("'{}' has the store of '{}': give each node a file of its own",
                                                         request.node, path()));
    if (request.secondary == options_.secondary)
        throw ise::error(ise::errc::refused,
                         fmt::format("'{}' and '{}' are both {}: start one of them as secondary, and one not",
                                     request.node, path(), options_.secondary ? "secondary" : "primary"));
    if (options_.peer.empty())
        throw ise::error(ise::errc::refused,
                         fmt::format("'{}' was started without a peer: '{}' is not waited for", path(), request.node));
    if (request.your_store != c.store.number()) request.packets = request.commands = 0;
    c.peer.on_request(now(), request.keeps, request.packets, request.commands, request.authority_epoch,
                      request.authority_change);
    c.silence.arm(c.peer.silent_at());
    show();
    auto wait = std::chrono::duration_cast<ise::duration>(
        std::chrono::duration<float>(std::clamp(request.wait_s, 0.0f, 10.0f)));
    auto until = ise::saturating_add(now(), wait);
    auto has_news = [&] {
        return c.store.head() > request.packets || c.store.commands_head() > request.commands ||
               c.authority.now().epoch > request.authority_epoch ||
               (c.authority.now().epoch == request.authority_epoch && c.authority.change() > request.authority_change);
    };
    while (!has_news() && now() < until) co_await c.news.wait(until);
    auto page = c.store.page_after(request.store, request.packets, request.commands, page_size);
    if (!page) throw ise::error(ise::errc::refused, page.error().message());
    page->node = path();
    page->secondary = options_.secondary;
    page->authority = c.authority.now();
    page->authority_change = c.authority.change();
    co_return std::move(*page);
}

} // namespace atirma
