// A provider, a client that sails a whole session and one that goes on all the time, each in a process of its own that
// a test may kill; and a book, outside of all of them, of what ran, what was answered and what was heard.
#pragma once
#include <support/catch.hpp>
#include <support/party.hpp>

#include <ise/asio.hpp>
#include <ise/call/call_service.hpp>
#include <ise/sim/world.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <map>

namespace crash_test {

using namespace std::chrono_literals;

struct work {
    std::string name;
    std::vector<std::uint8_t> cargo;
};
struct tick {
    int life = 0; // of the provider
    std::uint64_t number = 0;
};
inline constexpr ise::request_response<work, work> job{"job"};
inline constexpr ise::request_response<work, work> confirm{"confirm"};
inline constexpr ise::subscription<tick> ticks{"ticks"};

inline ise::service_options options() {
    ise::service_options made;
    made.accepts.heartbeat_ns = 500'000'000;
    made.first_back_off = 20ms;
    made.max_back_off = 200ms;
    made.linger = 2s;
    return made;
}
/// What a killed peer leaves is gone after three heartbeats and the linger.
constexpr ise::duration settled = 3 * 500ms + 2s + 500ms;

struct entry {
    int runs = 0, outcomes = 0;
    bool given_up = false; // its caller was killed before the outcome
    ise::time_point deadline{}, ended{};
    std::optional<ise::failure> why; // else it was answered
    bool same = false;               // with what it asked
};

class provider;
class client;

/// Outlives the processes.
struct book {
    std::map<std::string, entry> calls;
    std::map<std::string, int> lives;
    provider* boat = nullptr; // in the present life
    std::map<std::string, client*> clients;

    /// Whoever has been killed is told nothing any more.
    void give_up(const std::string& who) {
        for (auto& [name, call] : calls) call.given_up = call.given_up || (call.outcomes == 0 && name.starts_with(who));
    }
};

class provider {
public:
    provider(ise::sim::process& process, book& into, const std::string& where)
        : at(process, process.make_loop("main"), "boat", options()), life(++into.lives["boat"]),
          out(at.publish(ticks)) {
        at.provide(job, [this, &into](work asked, const ise::call_context& context) -> ise::task<work> {
            ++into.calls[asked.name].runs;
            auto caller = std::string(context.caller);
            co_await ise::sleep_for(at.on, 10ms);
            if (!asked.name.ends_with("back")) co_return asked;
            auto back = to_caller(caller);
            auto confirmed = co_await back.call(confirm, asked, 1s);
            co_return confirmed;
        });
        at.scope.spawn("ticks", publish(*this, where));
        into.boat = this;
    }
    /// Coroutines, but for those that wait for the next call of anybody.
    std::size_t busy() const {
        auto all = at.scope.running();
        return static_cast<std::size_t>(
                   std::ranges::count_if(all, [](const auto& name) { return name.find("job") == std::string::npos; })) +
               at.services->services().find_calls("job")->running();
    }

    mutable ise_test::party at;
    const int life;
    ise::publication<ise::subscription<tick>> out;

private:
    ise::remote to_caller(const std::string& path) {
        for (const auto& [key, one] : at.services->sessions())
            if (one->peer_name() == path) return ise::remote(at.services->link_back(one));
        throw ise::error(ise::errc::peer_lost, "the caller has gone");
    }
    static ise::task<> publish(provider& self, std::string where) {
        self.at.listen(where);
        for (std::uint64_t n = 1;; ++n) {
            tick now{self.life, n};
            self.out(now);
            co_await ise::sleep_for(self.at.on, 20ms);
        }
    }
};

/// Sails from the first hello to the goodbye, or calls and listens for as long as it lives.
class client {
public:
    client(ise::sim::process& process, book& into, std::string called, const std::string& where, bool sails)
        : at(process, process.make_loop("main"), called, options()), book_(into), where_(where),
          prefix_(fmt::format("{} {}", called, ++into.lives[called])) {
        at.provide(confirm, [](work asked) { return asked; });
        if (sails) {
            at.scope.spawn("sails", sail(*this));
        } else {
            at.scope.spawn("follows", follow(*this));
            at.scope.spawn("calls", call_on(*this));
        }
        into.clients[called] = this;
    }

    ise_test::party at;
    bool finished = false;
    bool calls_on = true;
    bool waits() const noexcept { return waiting_ > 0; }
    std::size_t heard = 0;
    int unknown_gaps = 0;
    std::uint64_t lost = 0;

private:
    static ise::subscribe_options patient() {
        auto made = ise::subscribe_options::keep_last(256);
        made.deadline = 30s;
        return made;
    }
    static ise::task<> sail(client& self) {
        auto boat = self.at.at(self.where_);
        {
            auto stream = co_await boat.subscribe(ticks, patient());
            for (int i = 0; i < 3; ++i) co_await self.next(stream);
            self.begin(boat, "first", 0, 2s);
            self.begin(boat, "with cargo", 5000, 2s);
            self.begin(boat, "back", 0, 2s);
            while (self.waiting_ > 0) co_await self.next(stream);
            self.begin(boat, "big", 300'000, 8s);
            self.begin(boat, "beside", 0, 2s);
            while (self.waiting_ > 0) co_await self.next(stream);
            self.heard_now_ = 0; // it goes on, whoever provides
            while (self.heard_now_ < 3 || self.last_.life != self.book_.lives["boat"]) co_await self.next(stream);
        }
        self.begin(boat, "last", 0, 2s); // behind the unsubscribe
        while (self.waiting_ > 0) co_await ise::sleep_for(self.at.on, 1ms);
        self.finished = true;
    }
    static ise::task<> follow(client& self) {
        auto boat = self.at.at(self.where_);
        auto stream = co_await boat.subscribe(ticks, patient());
        for (;;) co_await self.next(stream);
    }
    static ise::task<> call_on(client& self) {
        auto boat = self.at.at(self.where_);
        for (int n = 0; self.calls_on; ++n) {
            self.begin(boat, fmt::format("call {}", n), 0, 1s);
            co_await ise::sleep_for(self.at.on, 50ms);
        }
    }

    ise::task<> next(ise::subscriber<ise::subscription<tick>>& from) {
        auto packet = co_await from.next();
        if (!packet) throw ise::error(from.cause());
        if (heard == 0) {
            CHECK(packet.lost_before().value_or(0) == 0); // the network loses nothing
        } else if (packet->life != last_.life) {
            CHECK(packet->life > last_.life);
            CHECK(!packet.lost_before());
            ++unknown_gaps;
        } else {
            REQUIRE(packet.lost_before());
            CHECK(packet->number == last_.number + 1 + *packet.lost_before());
            lost += *packet.lost_before();
        }
        last_ = *packet;
        ++heard;
        ++heard_now_;
    }
    void begin(ise::remote boat, std::string_view what, std::size_t cargo, ise::duration time) {
        work asked{fmt::format("{} {}", prefix_, what), std::vector<std::uint8_t>(cargo, 7)};
        auto& noted = book_.calls[asked.name];
        noted.deadline = at.on.now() + time;
        ++waiting_;
        boat.try_call(job, asked, time, [this, &noted, asked](ise::result<work> got) {
            ++noted.outcomes;
            noted.ended = at.on.now();
            if (got) {
                noted.same = got->name == asked.name && got->cargo == asked.cargo;
            } else {
                noted.why = got.error();
            }
            --waiting_;
        });
    }

    book& book_;
    std::string where_;
    std::string prefix_;
    tick last_;
    std::size_t heard_now_ = 0;
    int waiting_ = 0;
};

} // namespace crash_test
