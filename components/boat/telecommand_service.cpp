#include <components/boat/telecommand_service.hpp>

#include <components/boat/recall.hpp>

#include <ise/component/traced_work.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {
// A tracker's clock may be set; else this only wakes it once in a while.
constexpr ise::duration max_tracker_sleep = std::chrono::minutes(1);
} // namespace

telecommand_service::telecommand_service(ise::component& of, link_policy policy)
    : keep([](const auto&) { return ise::result<void>(); }), clock([&of] {
          tracker_time at;
          at.now = of.now();
          at.wall = std::chrono::floor<std::chrono::milliseconds>(of.wall());
          return at;
      }),
      of_(of), tracker_(std::move(policy)), audience_(of), due_(of.on(), [this] { work(); }) {}

void telecommand_service::provide() {
    audience_.provide([this](std::uint32_t id) {
        std::vector<telecommand_status> all;
        auto link = tracker_.policy().link;
        if (const auto* known = tracker_.find(id)) all.push_back(status_of(*known, link));
        if (id == 0)
            for (const auto* each : tracker_.open()) all.push_back(status_of(*each, link));
        return all;
    });
    of_.provide(services::telecommand, [this](telecommand_request request, const ise::call_context& context) {
        return command(std::move(request), context.deadline);
    });
    of_.provide(services::telecommand_recall, [this](const recall_request& request) {
        recall_reply reply;
        reply.recalled = tracker_.recall(now(), request.id, request.why);
        work();
        const auto* known = tracker_.find(request.id);
        reply.text = known ? known->text : "it is not known here";
        if (known) reply.state = status_of(*known, tracker_.policy().link).state;
        return reply;
    });
}

void telecommand_service::work() {
    if (working_) return; // giving to the link may bring events, which end here again
    working_ = true;
    tracker_.on_time(now());
    bool up = give && give();
    for (const auto& change : tracker_.take_changes()) {
        (void)keep(change); // one that the disk does not take is told all the same
        audience_.tell(status_of(change, tracker_.policy().link));
        if (is_final(change.stage)) trace(change);
    }
    working_ = false;
    auto next = up ? tracker_.next_event() : tracker_.next_expiry();
    if (next == ise::time_point::max()) return due_.disarm();
    due_.arm(ise::saturating_add(of_.now(), std::clamp(next - now().now, ise::duration(), max_tracker_sleep)));
}

// Its way over the link, which the boat goes on with in a trace of its own.
void telecommand_service::trace(const tracked_telecommand& change) {
    auto found = traces_.find(change.id);
    if (found == traces_.end()) return;
    const auto name = fmt::format("{} over {}", name_of(change.command.kind()), name_of(tracker_.policy().link));
    ise::traced_work way;
    way.name = name;
    way.target = "the boat";
    way.outcome = change.stage == link_stage::acknowledged ? ise::errc{}
                  : change.stage == link_stage::expired    ? ise::errc::timed_out
                                                           : ise::errc::refused;
    way.began = found->second.since;
    way.took = of_.now() - way.began;
    way.in = found->second.in;
    way.linked = trace_of_telecommand(change.id);
    ise::record_work(of_, way);
    traces_.erase(found);
}

ise::trace_id trace_of_telecommand(std::uint32_t id) noexcept { return ise::numbered_trace("atirma/telecommand", id); }

ise::task<telecommand_reply> telecommand_service::command(telecommand_request request, ise::time_point deadline) {
    auto chosen = static_cast<std::uint32_t>(of_.env().random()) | 1u; // never 0
    bool known = request.id != 0 && tracker_.find(request.id);
    if (!known && admit)
        if (auto good = admit(request); !good) throw ise::error(ise::errc::refused, good.error().message());
    auto taken = tracker_.submit(now(), request, chosen);
    if (!taken) throw ise::error(ise::errc::refused, taken.error().message()); // it had no effect
    auto id = *taken;
    if (auto in = ise::current_trace(); in && !known) traces_[id] = {in, of_.now()};
    auto kept = known ? ise::result<void>() : keep(*tracker_.find(id));
    if (!kept) {
        tracker_.forget(id);
        traces_.erase(id);
        throw ise::error(ise::errc::refused, "the telecommand could not be kept on disk: " + kept.error().message());
    }
    if (!known) tracker_.replace_older(now(), id);
    auto status = status_of(*tracker_.find(id), tracker_.policy().link);
    work();
    // One that was decided long ago may be forgotten by then.
    if (const auto* here = tracker_.find(id)) status = status_of(*here, tracker_.policy().link);
    auto reply = audience_.reply(std::move(status), deadline);
    co_return co_await std::move(reply);
}

} // namespace atirma
