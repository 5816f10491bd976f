#include "traffic.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace conformance {

ise::task<ise::result<mode_set>> try_helm(ise::remote boat, std::string mode, ise::duration limit) {
    set_mode request{std::move(mode)};
    auto got = co_await try_call(boat, helm, std::move(request), limit);
    co_return got;
}

ise::task<ise::result<blob>> try_echo(ise::remote boat, std::size_t size, ise::duration limit) {
    blob big;
    big.content.resize(size);
    for (std::size_t i = 0; i < size; ++i) big.content[i] = static_cast<std::uint8_t>(i * 7);
    auto got = co_await try_call(boat, echo, std::move(big), limit);
    co_return got;
}

call begin_helm(pair& at, std::string mode, ise::duration limit) {
    return start(at.shore.on, try_helm(at.there, std::move(mode), limit));
}

std::uint64_t reading::lost() const {
    std::uint64_t sum = 0;
    for (auto gap : gaps) sum += gap.value();
    return sum;
}

void reading::check_exact() const {
    double before = 0;
    for (std::size_t i = 0; i < packets.size(); ++i) {
        INFO(fmt::format("{} came after {} with a gap of {}", packets[i], before, gaps[i].value()));
        REQUIRE(packets[i] == before + 1 + static_cast<double>(*gaps[i]));
        before = packets[i];
    }
}

namespace {

void take(reading& into, const ise::received<fix>& packet) {
    into.packets.push_back(packet->latitude_deg);
    into.gaps.push_back(packet.lost_before());
}

ise::task<> begin(ise::remote from, ise::subscribe_options options, std::shared_ptr<reading> into) {
    options.deadline = 10min;
    auto made = co_await subscribe_to(from, position, options);
    into->stream.emplace(std::move(made));
    into->subscribed = true;
}

ise::task<> read_on(ise::remote from, ise::subscribe_options options, std::shared_ptr<reading> into) {
    auto begun = begin(from, options, into);
    co_await std::move(begun);
    for (;;) {
        auto packet = co_await into->stream->next();
        if (!packet) co_return;
        take(*into, packet);
    }
}

ise::task<> tick(ise::loop& on, fixes to, ise::duration pause, std::shared_ptr<bool> stopped) {
    for (int i = 1; !*stopped; ++i) {
        to(numbered(i));
        co_await ise::sleep_for(on, pause);
    }
}

} // namespace

std::shared_ptr<reading> follow(side& by, const ise::remote& from, ise::subscribe_options options) {
    auto into = std::make_shared<reading>();
    by.scope.spawn("reader", read_on(from, options, into));
    return into;
}

std::shared_ptr<reading> sit(pair& at, ise::subscribe_options options) {
    auto into = std::make_shared<reading>();
    at.run(begin(at.there, options, into));
    return into;
}

void drain(reading& from) {
    while (auto packet = from.stream->try_next()) take(from, packet);
}

ticker::ticker(side& by, fixes to, ise::duration pause) { by.scope.spawn("ticker", tick(by.on, to, pause, stopped_)); }

namespace {

// The calls of a voyage, and how often each has run.
struct calls_made : std::enable_shared_from_this<calls_made> {
    std::map<std::string, int> runs;
    std::map<std::string, call> all;

    void provide(side& boat) {
        boat.provide(helm, [self = shared_from_this(), &boat](set_mode asked) -> ise::task<mode_set> {
            ++self->runs[asked.mode];
            if (asked.mode.back() % 3 == 0) co_await ise::sleep_for(boat.on, 10ms); // these are struck while they run
            mode_set answer{true, asked.mode};
            co_return answer;
        });
    }
    bool done() const {
        return std::ranges::all_of(all, [](auto& one) { return one.second->done; });
    }
    void check(bool repeated) {
        for (auto& [name, one] : all) {
            auto& got = one->get();
            INFO(fmt::format("{} ran {} times: {}", name, runs[name], got ? got->reason : got.error().message()));
            CHECK(runs[name] <= 1);
            if (got) CHECK((runs[name] == 1 && got->reason == name));
            if (repeated) CHECK(got);
            if (!got) CHECK(got.error().code() == errc::peer_lost);
            if (!got && got.error().executed() == execution::not_executed) CHECK(runs[name] == 0);
        }
    }
};

} // namespace

void sail(pair& at, const std::vector<fault>& script) {
    auto calls = std::make_shared<calls_made>();
    calls->provide(at.boat);
    auto out = at.boat.publish(position);
    if (at.has.relay_at.empty()) at.open();
    else at.open_through_relay();
    auto got = follow(at.shore, at.there, ise::subscribe_options::keep_last(8));
    at.run_until([&] { return got->subscribed; });
    ticker clock(at.boat, out, at.over.is_virtual() ? 20ms : 2ms);
    for (std::size_t round = 0; round < script.size(); ++round) {
        at.run_until([&, from = got->last()] { return got->last() > from; });
        for (int i = 0; i < 20; ++i) {
            auto name = fmt::format("{}.{}", round, i);
            calls->all[name] = begin_helm(at, name, 10min);
        }
        std::size_t turns = 0;
        at.run_until([&] { return ++turns > 7 * (round + 1); });
        at.strike(script[round]);
        at.run_until(
            [&, after = static_cast<double>(out.published())] { return got->last() > after && calls->done(); });
    }
    clock.stop();
    at.run_until([&] { return got->last() == static_cast<double>(out.published()); }); // the last one comes
    calls->check(at.has.calls_are_repeated);
    got->check_exact();
    CHECK(got->counts().restarts == 0);
    CHECK(got->counts().lost_at_provider + got->counts().lost_here == got->lost());
    auto survived = [&](fault what) { return what == fault::outage || (what == fault::forgotten && at.has.datagrams); };
    CHECK(got->counts().resumed >= script.size() - static_cast<std::size_t>(std::ranges::count_if(script, survived)));
    CHECK(out.subscribers() == 1);
}

} // namespace conformance
