// The other node: each asks the other for what it does not have, and says by that what it has.
#include <components/communication_node/communication_node.hpp>
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
        request.origin = c.store.origin();
        request.store = c.store.number();
        request.keeps = c.trouble.empty();
        request.yours = c.store.known_of_peer();
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
    if (page.origin == c.store.origin())
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("'{}' has the same store: give each node a file of its own", options_.peer));
    if (page.secondary == options_.secondary)
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("'{}' is {} too: start one of them as secondary, and one not", options_.peer,
                                        page.secondary ? "secondary" : "primary"));
    auto found = news_among(page.commands);
    if (!found) return found.error();
    const auto& news = *found;
    bool authority_is_news = c.authority.is_newer(page.authority, page.authority_change);
    bool nothing = page.packets.empty() && news.empty() && !authority_is_news && page.store == c.store.peer().store &&
                   page.commands_up_to <= c.store.peer().commands;
    if (nothing && c.trouble.empty()) return {};
    for (auto& one : page.packets)
        if (one.packet && c.newest.is_history(*one.packet)) one.packet->history = true;
    const auto& known = c.store.peer();
    if (page.after < known.packets || page.commands_after < known.commands)
        log().error("the store of the other node went back in time, or is another file; it gets what it lost",
                    {{"peer", options_.peer},
                     {"packets known of it", std::to_string(known.packets)},
                     {"it has of these", std::to_string(page.after)}});
    auto fresh = c.store.apply(page, news, authority_is_news);
    if (!fresh) {
        if (fresh.error().code() != ise::errc::protocol_error) disk(&fresh.error());
        return fresh.error();
    }
    disk(nullptr);
    know_all(news);
    if (authority_is_news) {
        c.authority.apply(page.authority, page.authority_change);
        c.authorities(page.authority);
    }
    if (*fresh > 0 || !news.empty()) c.news.notify();
    show();
    work();
    return {};
}

/// Those that say more than what is known here.
ise::result<std::vector<command_record>> communication_node::news_among(const std::vector<command_record>& records) {
    auto& c = *core_;
    std::vector<command_record> news;
    for (const auto& record : records) {
        const auto* known = c.desk.find(record.status.id);
        std::optional<command_record> on_disk;
        if (!known) {
            auto found = c.store.command(record.status.id);
            look_for_damage(found);
            if (!found) return found.error();
            on_disk = std::move(*found);
            if (on_disk) known = &*on_disk;
        }
        if (!known || knows_more(record, *known)) news.push_back(record);
    }
    return news;
}

void communication_node::know_all(const std::vector<command_record>& news) {
    auto& c = *core_;
    for (const auto& record : news) {
        if (!c.desk.know(now(), clock(), record, path())) continue;
        c.audience.tell(record.status);
        if (record.status.boat_obeys) c.authority.boat_obeys(*record.status.boat_obeys, record.status.authority);
    }
}

ise::task<replication_page> communication_node::tell_peer(replication_request request) {
    auto& c = *core_;
    if (request.origin == c.store.origin())
        throw ise::error(ise::errc::refused, fmt::format("'{}' has the store of '{}': give each node a file of its own",
                                                         request.node, path()));
    if (request.secondary == options_.secondary)
        throw ise::error(ise::errc::refused,
                         fmt::format("'{}' and '{}' are both {}: start one of them as secondary, and one not",
                                     request.node, path(), options_.secondary ? "secondary" : "primary"));
    if (options_.peer.empty())
        throw ise::error(ise::errc::refused,
                         fmt::format("'{}' was started without a peer: '{}' is not waited for", path(), request.node));
    if (request.yours.size() > replication_request::max_yours)
        throw ise::error(ise::errc::refused, fmt::format("{} lives of a store at once; {} are possible",
                                                         request.yours.size(), replication_request::max_yours));
    auto shared = c.store.shared(request.yours);
    bool of_this_life = !request.yours.empty() && request.yours.front().store == c.store.number();
    if (!request.yours.empty()) went_back(request.yours.front(), shared);
    c.peer.on_request(now(), request.keeps, shared.packets, shared.commands, request.authority_epoch,
                      request.authority_change);
    c.silence.arm(c.peer.silent_at());
    show();
    auto wait = std::chrono::duration_cast<ise::duration>(
        std::chrono::duration<float>(std::clamp(request.wait_s, 0.0f, 10.0f)));
    auto until = ise::saturating_add(now(), wait);
    auto has_news = [&] {
        return !of_this_life || c.store.head() > shared.packets || c.store.commands_head() > shared.commands ||
               c.authority.now().epoch > request.authority_epoch ||
               (c.authority.now().epoch == request.authority_epoch && c.authority.change() > request.authority_change);
    };
    while (!has_news() && now() < until) co_await c.news.wait(until);
    shared = c.store.shared(request.yours); // the store may be another one by now
    auto page = c.store.page_after(request.store, shared.packets, shared.commands, page_size);
    look_for_damage(page);
    if (!page) throw ise::error(ise::errc::refused, page.error().message());
    page->node = path();
    page->secondary = options_.secondary;
    page->authority = c.authority.now();
    page->authority_change = c.authority.change();
    co_return std::move(*page);
}

} // namespace atirma
