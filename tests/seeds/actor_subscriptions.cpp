// How an actor publishes and subscribes.
#include "actor.hpp"

namespace seeds {

using namespace std::chrono_literals;
using ise::task;

namespace {

/// A publication that the press knows for as long as its coroutine lives.
class open_publication {
public:
    open_publication(press& in, const std::string& by) : press_(in), life(in.opened(by)) {}
    ~open_publication() { press_.closed(life); }
    open_publication(const open_publication&) = delete;
    open_publication& operator=(const open_publication&) = delete;

private:
    press& press_;

public:
    const std::uint64_t life;
};

} // namespace

template <class Contract>
task<> actor::publishes(Contract service) {
    using packet = typename Contract::packet_type;
    census::citizen here(coroutines_);
    const auto& how = plan_.publishes;
    ise::sim::generator draw(stage_.plan.seed, fmt::format("packets of {} {} {}", path(), life_, flows_));
    for (;;) {
        auto out = publish(service);
        open_publication mine(stage_.papers, path());
        subscribers_ = [out] { return out.subscribers(); };
        stage_.events.note("{} publishes life {}", path(), mine.life);
        for (auto left = how.withdraws ? draw.below(40) : ~std::uint64_t{0}; left > 0 || stage_.now != phase::stormy;
             --left) {
            co_await sleep(how.period);
            for (std::uint32_t n = 0; n < how.burst && stage_.now != phase::quiet; ++n) {
                packet one;
                one.life = mine.life;
                one.content = random_content(draw, how.bytes);
                one.check = sum_of(one.content);
                one.number = stage_.papers.begin(mine.life);
                bool room = how.blocking && out.try_send(one);
                if (how.blocking && !room) {
                    co_await out.send(one);
                } else if (!room) {
                    out(one);
                }
                stage_.papers.end(mine.life, now());
                stage_.events.tally("packets published");
                if (out.published() != one.number)
                    stage_.events.broken("{} has published {} packets, it says {}", path(), one.number,
                                         out.published());
            }
            if (stage_.now != phase::stormy && left < 2) left = 2;
        }
        withdraw(service);
        subscribers_ = {};
        stage_.events.note("{} withdraws life {}", path(), mine.life);
        stage_.events.tally("publications withdrawn");
    }
}

task<> actor::publishes() { return plan_.later_version ? publishes(later_beats) : publishes(beats); }

namespace {

/// Listed among the readers for as long as its coroutine lives.
class listed_reader {
public:
    explicit listed_reader(std::vector<reader*>& in) : all_(in) { all_.push_back(&entry); }
    ~listed_reader() { std::erase(all_, &entry); }
    listed_reader(const listed_reader&) = delete;
    listed_reader& operator=(const listed_reader&) = delete;
    reader entry;

private:
    std::vector<reader*>& all_;
};

struct goal_text {
    std::string name, path, from, host;
    bool by_name;
};

/// A subscription was not made: is there a reason?
void subscription_refused(stage& of, const ise::failure& why, const std::string& who, const goal_text& to,
                          ise::time_point began, ise::duration limit) {
    using ise::errc;
    of.events.note("{} could not subscribe to {}: {} {}", who, to.name, ise::name_of(why.code()), why.message());
    of.events.tally(fmt::format("subscribing that ended as {}", ise::name_of(why.code())));
    auto result =
        fmt::format("{} could not subscribe to {}: {}: {}", who, to.name, ise::name_of(why.code()), why.message());
    if (!to.by_name && of.calls.rivalled.contains(to.path)) return; // who holds the name may listen elsewhere
    bool calm =
        of.sky.calm(to.from, to.host, began) && of.sky.calm(to.from, "ns", began) && of.sky.calm(to.host, "ns", began);
    switch (why.code()) {
        case errc::timed_out:
            if (of.world.now() - began < limit) return of.events.broken("{}, before its deadline", result);
            break;
        case errc::no_such_service: // it is withdrawn now
        case errc::peer_lost:
        case errc::cancelled:
        case errc::overloaded: return;
        default: return of.events.broken("{}, which cannot be", result);
    }
    if (calm) of.events.broken("{}, and nothing was disturbed", result);
}

} // namespace

template <class Contract>
task<> actor::subscribes(Contract service, subscriber_plan terms, std::size_t number) {
    census::citizen here(coroutines_);
    ise::sim::generator draw(stage_.plan.seed,
                             fmt::format("subscription of {} {} {} {}", path(), life_, flows_, number));
    auto to = to_component(terms.provider, terms.by_name);
    auto provider = stage_.plan.components[terms.provider].path;
    auto who = fmt::format("{}.{}#{}", path(), number, life_);
    listed_reader listed(stage_.readers);
    auto& mine = listed.entry;
    mine.who = who;
    mine.provider = provider;
    mine.by_name = terms.by_name;
    mine.connected = [] { return false; };
    for (;;) {
        reading model(stage_.events, stage_.world, stage_.papers, stage_.planted, who, provider, terms.terms,
                      stage_.plan.linger, stage_.calls.rivalled);
        ise::subscriber<Contract> stream;
        std::optional<ise::failure> refused;
        auto began = now();
        try {
            stream = co_await to.way.subscribe(service, terms.terms);
        } catch (const ise::error& thrown) {
            refused = thrown.why();
        }
        if (refused) {
            goal_text where{to.name, to.path, host_, to.host, to.by_name};
            subscription_refused(stage_, *refused, who, where, began, terms.terms.deadline);
            co_await sleep(100ms);
            continue;
        }
        model.committed();
        mine.model = &model;
        mine.connected = [&stream] { return stream.connected(); };
        mine.finish = [&] { model.finish(stream.counts(), mine.waiting); };
        auto left = terms.leaves ? draw.below(60) + 1 : ~std::uint64_t{0};
        for (; left > 0 || stage_.now != phase::stormy; --left) {
            mine.waiting = true;
            auto packet = co_await stream.next();
            mine.waiting = false;
            if (!packet) break;
            beat got;
            got.life = packet->life;
            got.number = packet->number;
            got.check = packet->check;
            got.content = packet->content;
            model.packet(got, packet.lost_before(), stream.counts());
            if (terms.slowness > ise::duration{}) co_await sleep(terms.slowness);
            if (stage_.now != phase::stormy && left < 2) left = 2;
        }
        mine.model = nullptr;
        mine.connected = [] { return false; };
        mine.finish = {};
        if (stream.ended()) {
            model.ended(stream.cause(), stream.counts());
            co_await sleep(20ms);
        } else {
            stage_.events.note("{} leaves {}", who, provider);
        }
    }
}

task<> actor::subscribes(const subscriber_plan& terms, std::size_t number) {
    return terms.later_version ? subscribes(later_beats, terms, number) : subscribes(beats, terms, number);
}

} // namespace seeds
