#include <components/communication_node/node_telecommands.hpp>

#include <components/boat/find_component.hpp>
#include <components/boat/raw_payload.hpp>

#include <fmt/format.h>

#include <algorithm>

namespace atirma {
namespace {

using namespace std::chrono_literals;

constexpr std::size_t max_why = 256; // of a recall that another node passes on

ise::error command_refused(std::string why) { return ise::error(ise::errc::refused, std::move(why)); }

} // namespace

node_telecommands::node_telecommands(node_context& here, store_keeper& store, other_node& peer, boat_links& links,
                                     node_authority& authority, const opened_store& opened)
    : here_(here), store_(store), peer_(peer), links_(links), authority_(authority), router_(here.options.desk),
      audience_(here.self), due_(here.self.on(), [this] { work(); }) {
    for (const auto& record : opened.known.open_commands)
        router_.know(here.now(), here.clock(), record, here.self.path());
    audience_.provide([this](std::uint32_t id) {
        if (id == 0) return router_.open();
        std::vector<telecommand_status> one;
        if (const auto* record = router_.find(id)) one.push_back(record->status);
        return one;
    });
}

void node_telecommands::work() {
    if (working_) return;
    working_ = true;
    router_.on_time(here_.now(), here_.clock());
    for (const auto& one : router_.take_recalls())
        here_.self.spawn(fmt::format("recalls telecommand {} over {}", one.id, name_of(one.link)), recall(one));
    while (auto give = router_.next_give(here_.now(), here_.clock(), links_.table())) {
        record_changes();
        auto name = fmt::format("telecommand {} over {}", give->id, name_of(give->link));
        here_.self.spawn(std::move(name), drive(std::move(*give)));
    }
    record_changes();
    auto next = router_.next_event(here_.now(), links_.table());
    if (next == ise::time_point::max()) due_.disarm();
    else due_.arm(next);
    working_ = false;
}

void node_telecommands::record_changes() {
    auto changes = router_.take_changes();
    for (const auto& record : changes) unsaved_[record.status.id] = record; // the last state of each
    save();
    for (const auto& record : changes) {
        audience_.tell(record.status);
        if (is_final(record.status.state)) traces_.erase(record.status.id);
    }
    for (const auto& result : router_.take_boat_epochs())
        authority_.book().boat_obeys(result.obeyed, result.sent_under);
}

/// The changes to the store, one batch at a time.
void node_telecommands::save() {
    if (unsaved_.empty() || !saving_.empty()) return;
    saving_ = std::exchange(unsaved_, {});
    std::vector<command_record> records;
    for (const auto& [id, record] : saving_) records.push_back(record);
    node_store::then<void> done = [this](ise::result<void> put) {
        auto tried = std::exchange(saving_, {});
        if (!put) unsaved_.merge(tried); // what changed again meanwhile stays as it is now
        peer_.notify_news();
        if (put) save();
    };
    store_->put(std::move(records), store_.written(std::move(done)));
}

void node_telecommands::begin_anew() {
    for (const auto& status : router_.open())
        if (const auto* record = router_.find(status.id)) unsaved_[status.id] = *record;
    record_changes();
}

void node_telecommands::on_status(link_id link, const telecommand_status& status) {
    // A new subscription repeats the last answer; the reply to a request may be an old one, and has no time.
    if (status.state == telecommand_stage::acknowledged) links_.heard(link, status.at);
    router_.on_status(here_.clock(), link, status);
    work();
}

/// In memory, or on record.
ise::task<ise::result<std::optional<command_record>>> node_telecommands::recorded(std::uint32_t id) {
    if (const auto* here = router_.find(id)) co_return std::optional(*here);
    store_answer<std::optional<command_record>> answer(here_.self.on());
    store_->command(id, store_.read(answer.here()));
    auto got = co_await answer.get();
    co_return got;
}

ise::result<std::vector<command_record>> node_telecommands::news_among(const std::vector<command_record>& records) {
    std::vector<command_record> news;
    for (const auto& record : records) {
        const auto* here = router_.find(record.status.id);
        if (here) {
            if (knows_more(record, *here)) news.push_back(record);
            continue;
        }
        auto there = store_.read(store_.file().command(record.status.id));
        if (!there) return there.error();
        if (!*there || knows_more(record, **there)) news.push_back(record);
    }
    return news;
}

void node_telecommands::know(const std::vector<command_record>& news) {
    for (const auto& record : news) {
        if (!router_.know(here_.now(), here_.clock(), record, here_.self.path())) continue;
        audience_.tell(record.status);
        if (record.status.boat_obeys) authority_.book().boat_obeys(*record.status.boat_obeys, record.status.authority);
    }
}

bool node_telecommands::restore(const std::vector<command_record>& records) {
    auto news = news_among(records);
    if (!news) return false;
    auto put = store_.written(store_.file().put(*news));
    if (!put) return false;
    know(*news);
    peer_.notify_news();
    work();
    return true;
}

/// Throws what makes the node refuse a new telecommand.
void node_telecommands::check(const telecommand_request& request, const std::string& who) {
    if (auto good = check_request(request); !good) throw command_refused(good.error().message());
    auto kind = request.command.kind();
    if (auto why = request.command.danger(); !why.empty() && !request.confirmed)
        throw command_refused(
            fmt::format("{} is dangerous: {} Send it again with confirmed true if it is meant", name_of(kind), why));
    if (traits_of(kind).needs_authority)
        if (auto why = authority_.book().refusal(who)) throw command_refused(*why);
    if (request.via && !links_.proxy(*request.via))
        throw command_refused(
            fmt::format("this node has no proxy for {}; it has {}", name_of(*request.via), links_.names()));
}

ise::task<ise::result<command_record>> node_telecommands::begin(telecommand_request request, std::string who,
                                                                std::string verified) {
    auto chosen = static_cast<std::uint32_t>(here_.self.env().random()) | 1u; // never 0
    const auto trace = ise::current_trace();
    for (;;) {
        auto over = links_.table().best(here_.now(), {}).value_or(link_id::xbee);
        auto record = router_.prepare(here_.now(), here_.clock(), request, chosen, who, authority_.now().boat_epoch,
                                      here_.self.path(), over);
        if (!record) co_return record;
        record->status.asked_as = verified;
        store_answer<node_store::begun> answer(here_.self.on());
        store_->begin(*record, authority_.now().epoch, store_.written(answer.here()));
        auto begun = co_await answer.get();
        if (!begun) {
            const auto& why = begun.error();
            if (why.executed() == ise::execution::unknown)
                co_return ise::failure(why.code(),
                                       fmt::format("it is not known whether the telecommand was recorded, and it is "
                                                   "sent if it was; ask for it again with its id: {}",
                                                   why.message()),
                                       why.executed());
            co_return ise::failure(
                why.code(),
                fmt::format("the telecommand cannot be recorded, and so it is not sent: {}", why.message()));
        }
        if (begun->authority) { // another node changed it: whether this operator may command is decided anew
            authority_.set(begun->authority->first, begun->authority->second);
            check(request, who);
            continue;
        }
        auto& kept = begun->known ? *begun->known : *record;
        router_.know(here_.now(), here_.clock(), kept, here_.self.path());
        if (trace) traces_[kept.status.id] = trace;
        if (!begun->known) {
            audience_.tell(kept.status);
            peer_.notify_news();
        }
        work();
        co_return kept;
    }
}

ise::task<telecommand_reply> node_telecommands::command(telecommand_request request, std::string who,
                                                        std::string verified, ise::time_point deadline) {
    if (request.command.get_if<commands::raw>())
        throw command_refused(
            "a raw telecommand goes to the service raw_telecommand, which an access policy grants by itself");
    return accept(std::move(request), std::move(who), std::move(verified), deadline);
}

ise::task<telecommand_reply> node_telecommands::raw_command(telecommand_request request, std::string who,
                                                            std::string verified, ise::time_point deadline) {
    const auto* raw = request.command.get_if<commands::raw>();
    if (!raw)
        throw command_refused(fmt::format("{} is no raw telecommand: send it to the service telecommand",
                                          name_of(request.command.kind())));
    if (!here_.options.raw_telecommands)
        throw command_refused(fmt::format("raw telecommands are off at {} (--raw-telecommands)", here_.self.path()));
    here_.self.log().warning("a raw telecommand is asked for",
                             {{"by", who},
                              {"verified", verified},
                              {"confirmed", request.confirmed ? "yes" : "no"},
                              {"payload", raw->payload.substr(0, 4 * max_raw_bytes)}});
    return accept(std::move(request), std::move(who), std::move(verified), deadline);
}

ise::task<telecommand_reply> node_telecommands::accept(telecommand_request request, std::string who,
                                                       std::string verified, ise::time_point deadline) {
    std::optional<command_record> record;
    if (request.id != 0) {
        auto found = co_await recorded(request.id);
        if (!found) throw ise::error(found.error()); // it may be under way
        record = std::move(*found);
    }
    if (!record) {
        check(request, who);
        auto begun = co_await begin(request, who, verified);
        if (!begun && begun.error().executed() == ise::execution::unknown) throw ise::error(begun.error());
        if (!begun) throw command_refused(begun.error().message());
        record = std::move(*begun);
    }
    if (record->status.command != request.command)
        throw command_refused(fmt::format("telecommand {} is {} already, asked for by {}; choose another id",
                                          request.id, name_of(record->status.kind), record->status.asked_by));
    const auto* here = router_.find(record->status.id);
    auto reply = audience_.reply(here ? here->status : record->status, deadline);
    co_return co_await std::move(reply);
}

void node_telecommands::announce_epoch() { here_.self.spawn("announces the epoch", announce()); }

ise::task<> node_telecommands::announce() {
    telecommand_request ping;
    ping.valid_s = 3600;
    auto begun = co_await begin(ping, here_.self.path(), std::string());
    // If too many are open, the next one carries the epoch.
    if (!begun && begun.error().code() != ise::errc::overloaded)
        here_.self.log().warning("the boat is not told of the new epoch now", {{"cause", begun.error().message()}});
}

ise::task<record_page> node_telecommands::record(record_request request) {
    if (request.max_entries < 1 || request.max_entries > 500)
        throw command_refused(fmt::format("max_entries is 1 to 500, not {}", request.max_entries));
    store_answer<record_page> answer(here_.self.on());
    store_->list(request, store_.read(answer.here()));
    auto page = co_await answer.get();
    if (!page) throw command_refused(page.error().message());
    co_return std::move(*page);
}

/// One telecommand at one link, until it is decided. The proxy goes on by itself; asking again with the same id is
/// safe, and needed after a proxy has forgotten it.
ise::task<> node_telecommands::drive(command_router::give what) {
    if (auto traced = traces_.find(what.id); traced != traces_.end()) ise::work_for(traced->second);
    auto position = store_->commands_head(), store = store_->number();
    while (store_->number() == store && peer_.lives() && !peer_.has_commands(position))
        co_await peer_.wait_for_progress();
    auto* proxy = links_.proxy(what.link);
    if (!proxy) co_return; // chosen at the other node, whose proxy may have sent it: it is open until it expires
    auto expires =
        here_.now() + std::chrono::duration_cast<ise::duration>(std::chrono::duration<float>(*what.request.valid_s));
    ise::duration pause = 500ms;
    bool may_be_there = what.only_recall, answered = false;
    for (;;) {
        bool called_back = router_.is_called_back(what.id);
        if (called_back && !may_be_there) {
            router_.on_refused(here_.now(), here_.clock(), what.id, what.link, "called back");
            co_return work();
        }
        const auto* record = router_.find(what.id);
        auto left = expires - here_.now();
        if (!record || is_final(record->status.state) || record->node != here_.self.path() || left < 2s) co_return;
        if (called_back && !answered) {
            auto there = co_await recall_from(what.link, what.id, record->called_back);
            answered = there && there->state == telecommand_stage::acknowledged; // the boat knows it: asking is safe
            // A proxy that was started anew may have sent it before; with `telecommand` it would get it as a new one.
            if (there && !there->state) on_recalled(what.link, what.id, telecommand_stage::expired, there->text);
            co_await here_.self.sleep(pause);
            pause = std::min<ise::duration>(pause * 2, 5s);
            continue;
        }
        auto giving = time_to_give(left);
        what.request.valid_s = std::chrono::duration<float>(left - giving).count();
        auto got = co_await proxy->try_call(services::telecommand, what.request, giving);
        if (got && got->state != telecommand_stage::pending) {
            telecommand_status outcome;
            outcome.id = what.id;
            outcome.kind = what.request.command.kind();
            outcome.state = got->state;
            outcome.result = got->result;
            outcome.value = got->value;
            outcome.boat_obeys = got->boat_obeys;
            outcome.executed_at = got->executed_at;
            outcome.text = got->text;
            on_status(what.link, outcome);
            co_return;
        }
        if (!got && got.error().code() == ise::errc::refused) {
            router_.on_refused(here_.now(), here_.clock(), what.id, what.link, got.error().message());
            work();
            co_return;
        }
        may_be_there = may_be_there || got || got.error().executed() == ise::execution::unknown;
        if (may_be_there) router_.on_given(what.id, what.link);
        co_await here_.self.sleep(pause);
        pause = std::min<ise::duration>(pause * 2, 5s);
    }
}

ise::task<recall_reply> node_telecommands::call_back(recall_request request, std::string who) {
    recall_reply reply;
    auto record = co_await recorded(request.id);
    if (!record) throw command_refused(record.error().message());
    if (!*record) {
        reply.text = "it is not known here";
        co_return reply;
    }
    const auto& known = **record;
    // Another node has checked its operator.
    bool of_node = (here_.has_peer() && who == here_.options.peer) || store_->is_shared_with(who);
    if (!of_node && known.status.asked_by != who)
        if (auto why = authority_.book().refusal(who)) throw command_refused(*why);
    auto why = of_node ? request.why.substr(0, max_why) : fmt::format("by {}", who);
    if (known.node != here_.self.path() && !is_final(known.status.state)) {
        if (of_node) // never back and forth
            throw command_refused(fmt::format("it is under way at {}, not here: call it back again", known.node));
        co_return co_await call_back_at(known.node, request.id, std::move(why));
    }
    auto have = router_.call_back(here_.clock(), request.id, why);
    work();
    for (auto link : have) co_await recall_from(link, request.id, why);
    const auto* here = router_.find(request.id); // nothing: it was decided long ago
    const auto& now = here ? here->status : known.status;
    reply.state = now.state;
    reply.recalled = now.state == telecommand_stage::failed;
    reply.text = is_final(now.state)
                     ? now.text
                     : "no further link gets it, but it cannot be called back from where it is: " + now.text;
    co_return reply;
}

/// At the node that gives it to the links, which alone knows where it is.
ise::task<recall_reply> node_telecommands::call_back_at(std::string node, std::uint32_t id, std::string why) {
    recall_request request;
    request.id = id;
    request.why = std::move(why);
    auto owner = find_component(here_.self, node);
    auto response = co_await owner.try_call(services::telecommand_recall, request, 15s);
    if (!response) {
        const auto& problem = response.error();
        throw ise::error(problem.code(),
                         fmt::format("it is under way at {}, which cannot call it back now: {}; call it back again",
                                     node, problem.message()),
                         problem.executed());
    }
    co_return std::move(*response);
}

ise::task<> node_telecommands::recall(command_router::recall what) {
    auto response = co_await recall_from(what.link, what.id, what.why);
    if (response) here_.self.log().debug("recalled", {{"id", std::to_string(what.id)}, {"outcome", response->text}});
}

/// Once; what the proxy answers is noted. Nothing where it is not reached. That it does not know the id ends nothing
/// here: it may still be on its way there, which `drive` knows.
ise::task<std::optional<recall_reply>> node_telecommands::recall_from(link_id link, std::uint32_t id, std::string why) {
    auto* proxy = links_.proxy(link);
    if (!proxy) co_return std::nullopt;
    recall_request request;
    request.id = id;
    request.why = std::move(why);
    auto response = co_await proxy->try_call(services::telecommand_recall, request, 5s);
    if (!response) co_return std::nullopt;
    // An answer of the boat comes with all that belongs to it by the proxy's own word.
    if (response->state && is_final(*response->state) && *response->state != telecommand_stage::acknowledged)
        on_recalled(link, id, *response->state, response->text);
    co_return std::move(*response);
}

void node_telecommands::on_recalled(link_id link, std::uint32_t id, telecommand_stage state, const std::string& text) {
    const auto* record = router_.find(id);
    if (!record) return;
    telecommand_status status;
    status.id = id;
    status.kind = record->status.kind;
    status.state = state;
    status.text = text;
    on_status(link, status);
}

} // namespace atirma
