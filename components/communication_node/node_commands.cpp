// What goes to the boat, and who may send it.
#include <components/communication_node/communication_node.hpp>
#include <components/communication_node/node_core.hpp>

#include <fmt/format.h>

namespace atirma {
namespace {

using namespace std::chrono_literals;

ise::error command_refused(std::string why) { return ise::error(ise::errc::refused, std::move(why)); }

} // namespace

/// Gives what is due to the links, puts to disk and tells what changed, and looks when to come again.
void communication_node::work() {
    auto& c = *core_;
    if (c.working) return;
    c.working = true;
    c.desk.on_time(now(), clock());
    while (auto give = c.desk.next_give(now(), clock(), c.links)) {
        put_changes();
        auto name = fmt::format("telecommand {} over {}", give->id, name_of(give->link));
        spawn(std::move(name), drive(std::move(*give)));
    }
    put_changes();
    for (const auto& one : c.desk.take_recalls())
        spawn(fmt::format("recalls telecommand {} over {}", one.id, name_of(one.link)), recall(one));
    auto next = c.desk.next_event(now(), c.links);
    if (next == ise::time_point::max()) c.due.disarm();
    else c.due.arm(next);
    c.working = false;
}

void communication_node::put_changes() {
    auto& c = *core_;
    auto changes = c.desk.take_changes();
    for (const auto& record : changes) c.unsaved[record.status.id] = record; // the last state of each
    if (!c.unsaved.empty()) {
        std::vector<command_record> records;
        for (const auto& [id, record] : c.unsaved) records.push_back(record);
        auto put = c.store.put(records);
        disk(put ? nullptr : &put.error());
        if (put) c.unsaved.clear();
        c.news.notify();
    }
    for (const auto& record : changes) c.audience.tell(record.status);
    for (const auto& told : c.desk.take_boat_epochs()) c.authority.boat_obeys(told.obeyed, told.sent_under);
}

/// From here on it is on record, and under way.
ise::result<void> communication_node::begin_command(const command_record& record) {
    auto& c = *core_;
    auto put = c.store.put(std::span(&record, 1));
    disk(put ? nullptr : &put.error());
    if (!put) return put.error();
    c.desk.know(now(), clock(), record, path());
    c.audience.tell(record.status);
    c.news.notify();
    work();
    return {};
}

ise::task<telecommand_reply> communication_node::command(telecommand_request request, std::string who,
                                                         ise::time_point deadline) {
    auto& c = *core_;
    std::optional<command_record> known;
    if (request.id != 0) {
        if (const auto* here = c.desk.find(request.id)) known = *here;
        else {
            auto found = c.store.command(request.id);
            look_for_damage(found);
            if (!found) throw command_refused(found.error().message());
            known = std::move(*found);
        }
    }
    if (known && known->status.command != request.command)
        throw command_refused(fmt::format("telecommand {} is {} already, asked for by {}; choose another id",
                                          request.id, name_of(known->status.kind), known->status.asked_by));
    auto id = request.id;
    if (!known) {
        if (auto good = check_request(request); !good) throw command_refused(good.error().message());
        if (auto why = request.command.danger(); !why.empty() && !request.confirmed)
            throw command_refused(fmt::format("{} is dangerous: {} Send it again with confirmed true if it is meant",
                                              name_of(request.command.kind()), why));
        if (traits_of(request.command.kind()).needs_authority)
            if (auto why = c.authority.refusal(who)) throw command_refused(*why);
        if (request.via &&
            std::ranges::none_of(c.proxies, [&](const auto& one) { return one.health.link == *request.via; })) {
            std::string there;
            for (const auto& one : c.proxies)
                there += fmt::format("{}{}", there.empty() ? "" : ", ", name_of(one.health.link));
            throw command_refused(fmt::format("this node has no proxy for {}; it has {}", name_of(*request.via),
                                              there.empty() ? "none" : there));
        }
        auto chosen = static_cast<std::uint32_t>(env().random()) | 1u; // never 0
        auto record = c.desk.prepare(now(), clock(), request, chosen, who, c.authority.now().boat_epoch, path());
        if (!record) throw command_refused(record.error().message());
        id = record->status.id;
        auto begun = begin_command(*record);
        if (!begun)
            throw command_refused(
                fmt::format("the telecommand cannot be recorded, and so it is not sent: {}", begun.error().message()));
    }
    const auto* here = c.desk.find(id);
    auto reply = c.audience.reply(here ? here->status : known->status, deadline);
    co_return co_await std::move(reply);
}

ise::task<authority_state> communication_node::change_authority(authority_request request, std::string who) {
    auto& c = *core_;
    auto made = c.authority.decide(request, who, clock());
    if (!made) throw ise::error(made.error());
    bool hands = made->epoch != c.authority.now().epoch;
    if (hands || made->asked_by != c.authority.now().asked_by) {
        auto change = hands ? std::uint64_t{0} : c.authority.change() + 1;
        auto put = c.store.put(*made, change);
        disk(put ? nullptr : &put.error());
        if (!put)
            throw command_refused(fmt::format("the authority stays as it is, as the change cannot be put to disk: {}",
                                              put.error().message()));
        c.authority.apply(*made, change);
        c.authorities(*made);
        c.news.notify();
        log().info("authority over the boat",
                   {{"how", hands ? made->how : who + " asks for it"}, {"epoch", std::to_string(made->epoch)}});
        if (hands) announce_authority();
    }
    auto change = c.authority.change();
    while (c.peer.lives(now()) && !c.peer.has_authority(made->epoch, change))
        co_await c.progress.wait(c.peer.silent_at());
    co_return c.authority.now();
}

/// A ping under the new epoch: from then on the boat refuses what is under way under the old one.
void communication_node::announce_authority() {
    auto& c = *core_;
    telecommand_request ping;
    ping.valid_s = 3600;
    auto record = c.desk.prepare(now(), clock(), ping, static_cast<std::uint32_t>(env().random()) | 1u, path(),
                                 c.authority.now().boat_epoch, path());
    if (!record) return; // too many are open: the next one carries the epoch
    auto begun = begin_command(*record);
    if (!begun) log().warning("the boat is not told of the new epoch now", {{"cause", begun.error().message()}});
}

record_page communication_node::record(const record_request& request) {
    if (request.max_entries < 1 || request.max_entries > 500)
        throw command_refused(fmt::format("max_entries is 1 to 500, not {}", request.max_entries));
    auto page = core_->store.list(request);
    look_for_damage(page);
    if (!page) throw command_refused(page.error().message());
    return std::move(*page);
}

} // namespace atirma
