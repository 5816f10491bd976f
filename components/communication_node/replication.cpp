#include <components/communication_node/replication.hpp>

#include <components/boat/find_component.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t replication_page_size = 256;
constexpr std::int32_t primary_priority = 100, secondary_priority = 50;

ise::error replication_refused(std::string why) { return ise::error(ise::errc::refused, std::move(why)); }

} // namespace

replication::replication(node_context& here, store_keeper& store, other_node& peer, kept_telemetry& telemetry,
                         node_authority& authority, node_telecommands& telecommands)
    : here_(here), store_(store), peer_(peer), telemetry_(telemetry), authority_(authority),
      telecommands_(telecommands) {
    if (here.has_peer()) here.self.require(services::replication);
}

void replication::start() {
    if (here_.has_peer()) here_.self.spawn("the other node", follow());
}

ise::task<> replication::follow() {
    const auto& options = here_.options;
    auto other = find_component(here_.self, options.peer);
    for (;;) {
        replication_request request;
        request.node = here_.self.path();
        request.secondary = options.secondary;
        request.origin = store_.file().origin();
        request.store = store_->number();
        request.keeps = store_.well();
        request.yours = store_.file().known_of_peer();
        request.authority_epoch = authority_.now().epoch;
        request.authority_change = authority_.book().change();
        request.wait_s = std::chrono::duration<float>(options.silence / 3).count();
        auto got = co_await other.try_call(services::replication, request, options.silence);
        std::string why;
        if (!got) {
            // Also where it was stopped while it answered (cancelled): our own end throws at the next suspension.
            why = got.error().message();
        } else {
            bool more = got->more;
            auto taken = take(std::move(*got));
            if (!taken) why = taken.error().message();
            else store_.caught_up = !more;
        }
        if (why != trouble_ && !why.empty())
            here_.self.log().warning("the other node tells nothing", {{"peer", options.peer}, {"cause", why}});
        trouble_ = why;
        consider_serving();
        if (!why.empty()) co_await here_.self.sleep(500ms);
    }
}

ise::result<void> replication::take(replication_page page) {
    const auto& options = here_.options;
    if (page.origin == store_.file().origin())
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("'{}' has the same store: give each node a file of its own", options.peer));
    if (page.secondary == options.secondary)
        return ise::failure(ise::errc::invalid_argument,
                            fmt::format("'{}' is {} too: start one of them as secondary, and one not", options.peer,
                                        page.secondary ? "secondary" : "primary"));
    auto news = telecommands_.news_among(page.commands);
    if (!news) return news.error();
    bool authority_is_news = authority_.book().is_newer(page.authority, page.authority_change);
    auto known = store_.file().peer();
    bool nothing = page.packets.empty() && news->empty() && !authority_is_news && page.store == known.store &&
                   page.commands_up_to <= known.commands;
    if (nothing && store_.well()) return {};
    for (auto& one : page.packets)
        if (one.packet) telemetry_.mark_history(*one.packet);
    if (page.after < known.packets || page.commands_after < known.commands)
        here_.self.log().error(
            "the store of the other node went back in time, or is another file; it gets what it lost",
            {{"peer", options.peer},
             {"packets known of it", std::to_string(known.packets)},
             {"it has of these", std::to_string(page.after)}});
    auto fresh = store_.written(store_.file().apply(page, *news, authority_is_news));
    if (!fresh) return fresh.error();
    telecommands_.know(*news);
    if (authority_is_news) authority_.set(page.authority, page.authority_change);
    if (*fresh > 0 || !news->empty()) peer_.notify_news();
    telemetry_.show();
    telecommands_.work();
    return {};
}

ise::task<replication_page> replication::tell(replication_request request) {
    const auto& options = here_.options;
    const auto& me = here_.self.path();
    if (request.origin == store_.file().origin())
        throw replication_refused(
            fmt::format("'{}' has the store of '{}': give each node a file of its own", request.node, me));
    if (request.secondary == options.secondary)
        throw replication_refused(fmt::format("'{}' and '{}' are both {}: start one of them as secondary, and one not",
                                              request.node, me, options.secondary ? "secondary" : "primary"));
    if (!here_.has_peer())
        throw replication_refused(
            fmt::format("'{}' was started without a peer: '{}' is not waited for", me, request.node));
    if (request.yours.size() > replication_request::max_yours)
        throw replication_refused(fmt::format("{} lives of a store at once; {} are possible", request.yours.size(),
                                              replication_request::max_yours));
    auto shared = store_.file().shared(request.yours);
    bool of_this_life = !request.yours.empty() && request.yours.front().store == store_->number();
    if (!request.yours.empty()) went_back(request.yours.front(), shared);
    peer_.on_request(request, shared);
    telemetry_.show();
    auto wait_s = request.wait_s > 0 ? std::min(request.wait_s, 10.0f) : 0.0f; // 0 also for NaN
    auto wait = std::chrono::duration_cast<ise::duration>(std::chrono::duration<float>(wait_s));
    auto until = ise::saturating_add(here_.now(), wait);
    auto has_news = [&] {
        return !of_this_life || !peer_.has_packets(store_->head()) || !peer_.has_commands(store_->commands_head()) ||
               !peer_.has_authority(authority_.now().epoch, authority_.book().change());
    };
    while (!has_news() && here_.now() < until) co_await peer_.wait_for_news(until);
    shared = store_.file().shared(request.yours); // the store may be another one by now
    auto page =
        store_.read(store_.file().page_after(request.store, shared.packets, shared.commands, replication_page_size));
    if (!page) throw replication_refused(page.error().message());
    page->node = me;
    page->secondary = options.secondary;
    page->authority = authority_.now();
    page->authority_change = authority_.book().change();
    co_return std::move(*page);
}

/// The other node knows more of this node's store than there is: `shared` of it is certain.
void replication::went_back(const store_part& known_there, const store_part& shared) {
    if (shared.packets >= known_there.packets && shared.commands >= known_there.commands) return;
    if (known_there == told_back_ || store_.refilling) return;
    told_back_ = known_there;
    auto text =
        fmt::format("the store went back in time, or is another file: '{}' knows {} packets and {} changes of "
                    "telecommands of it, of which {} and {} are here; the nodes send each other what is missing",
                    here_.options.peer, known_there.packets, known_there.commands, shared.packets, shared.commands);
    store_.note(text);
    here_.self.log().error("its store went back in time: was a backup restored?",
                           {{"file", store_->name()}, {"found", text}});
}

void replication::consider_serving() {
    auto& self = here_.self;
    const auto& role = here_.options.role;
    bool alone = peer_.silent();
    if (store_.refilling && !store_.restoring() && store_.well() && (store_.caught_up || alone)) {
        store_.refilling = false;
        self.log().info("its store is filled again", {{"packets", std::to_string(store_->head())}});
    }
    bool complete = store_.caught_up && telemetry_.held() == 0 && !store_.refilling;
    bool serve = alone || (store_.well() ? complete : !peer_.lives());
    if (serve == serving_ || role.empty()) return;
    serving_ = serve;
    if (serve) self.serve_role(role, here_.options.secondary ? secondary_priority : primary_priority);
    else self.leave_role(role);
    self.log().info(serve ? "serves the role" : "leaves the role to the other node",
                    {{"role", role}, {"trouble", store_.trouble()}});
}

void replication::report(communication_state& into) const {
    if (store_.well() && !trouble_.empty()) into.trouble = trouble_;
    into.serving = serving_;
    into.peer_lives = peer_.lives();
    into.peer_misses = peer_.misses(store_->head());
}

} // namespace atirma
