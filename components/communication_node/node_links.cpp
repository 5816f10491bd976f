// Telecommands at the proxies: given, followed, called back.
#include <components/communication_node/communication_node.hpp>
#include <components/communication_node/node_core.hpp>

#include <components/boat/recall.hpp>

#include <fmt/format.h>

namespace atirma {

using namespace std::chrono_literals;

/// One telecommand at one link, until it is decided. The proxy goes on by itself; asking again with the same id is
/// safe, and needed after a proxy has forgotten it.
ise::task<> communication_node::drive(command_router::give what) {
    auto& c = *core_;
    auto position = c.store.commands_head(), store = c.store.number();
    while (c.store.number() == store && c.peer.lives(now()) && !c.peer.has_commands(position))
        co_await c.progress.wait(c.peer.silent_at());
    auto proxy = std::ranges::find_if(c.proxies, [&](const auto& one) { return one.health.link == what.link; });
    auto expires =
        now() + std::chrono::duration_cast<ise::duration>(std::chrono::duration<float>(what.request.valid_s));
    ise::duration pause = 500ms;
    for (;;) {
        const auto* record = c.desk.find(what.id);
        auto left = expires - now();
        if (!record || is_final(record->status.state) || record->node != path() || left < 1s) co_return;
        what.request.valid_s = std::max(1.0f, std::chrono::duration<float>(left).count());
        auto got =
            co_await proxy->proxy.try_call(services::telecommand, what.request, std::min<ise::duration>(left, 60s));
        if (got && got->state != telecommand_stage::pending) {
            telecommand_status told;
            told.id = what.id;
            told.kind = what.request.command.kind();
            told.state = got->state;
            told.result = got->result;
            told.value = got->value;
            told.boat_obeys = got->boat_obeys;
            told.text = got->text;
            c.desk.on_status(clock(), what.link, told);
            if (got->state == telecommand_stage::acknowledged) c.links.heard(what.link, now());
            work();
            co_return;
        }
        if (!got && got.error().code() == ise::errc::refused) {
            c.desk.on_refused(now(), clock(), what.id, what.link, got.error().message());
            work();
            co_return;
        }
        co_await sleep(pause);
        pause = std::min<ise::duration>(pause * 2, 5s);
    }
}

/// What it is not told, the proxy goes on trying until the telecommand's time is over; the boat does it once.
ise::task<> communication_node::recall(command_router::recall what) {
    auto proxy = std::ranges::find_if(core_->proxies, [&](const auto& one) { return one.health.link == what.link; });
    recall_request request;
    request.id = what.id;
    request.why = fmt::format("acknowledged over {}", name_of(what.answered));
    auto told = co_await proxy->proxy.try_call(services::telecommand_recall, request, 10s);
    if (told) log().debug("recalled", {{"id", std::to_string(what.id)}, {"outcome", told->text}});
}

ise::task<> communication_node::follow_states(std::size_t which) {
    auto& c = *core_;
    auto& here = c.proxies[which];
    for (;;) {
        try {
            follow_telecommand all;
            auto states =
                co_await here.proxy.subscribe(services::telecommand_state, all, ise::subscribe_options::last(1024));
            for (const auto& status : states.response().now) c.desk.on_status(clock(), here.health.link, status);
            work();
            for (;;) {
                auto status = co_await states.next();
                if (!status) break;
                if (status->state == telecommand_stage::acknowledged) c.links.heard(here.health.link, now());
                c.desk.on_status(clock(), here.health.link, *status);
                work();
            }
        } catch (const ise::error& problem) { // our own end throws at the next suspension
            log().debug("a proxy is not subscribed to", {{"proxy", here.health.proxy}, {"cause", problem.what()}});
        }
        co_await sleep(500ms);
    }
}

} // namespace atirma
