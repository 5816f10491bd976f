// The two programs whose sessions are recorded.
//   wire_party provide ENDPOINT[,ENDPOINT] [PATH]   listens, prints where; with PATH it registers with ISE_NAME_SERVER;
//                                                   WIRE_PARTY_ADVERTISE: where a relay of the test's own leads to it
//   wire_party ask ENDPOINT STORY        plays one story against a provider, and prints what it saw
// A line that begins with "!" asks whoever started it to do something to the link; it goes on at the next line of
// input.
#include "services.hpp"

#include <ise/asio.hpp>
#include <ise/service/service_host.hpp>

#include <asio/bind_cancellation_slot.hpp>
#include <fmt/format.h>

#include <cstdio>
#include <iostream>
#include <sstream>
#include <stdexcept>

using namespace recorded;
using namespace std::chrono_literals;

namespace {

void say(const std::string& line) {
    fmt::print("{}\n", line);
    std::fflush(stdout);
}

class provider : public ise::component {
    ise::task<> run() override {
        provide(mirror, [](everything given) { return given; });
        provide(helm, [](text given) -> ise::task<text> {
            if (given.said == "sink") throw ise::error(ise::errc::refused, "boats float");
            if (given.said == "break") throw std::runtime_error("the rudder fell off");
            co_return given;
        });
        provide(never, [this](text given) -> ise::task<text> {
            co_await sleep(1h);
            co_return given;
        });
        provide(word, [this](text given) -> ise::task<text> { // answers when somebody has told
            while (told_.empty()) co_await sleep(5ms);
            co_return text{given.said + " " + told_};
        });
        provide(recorded::tell, [this](text given) {
            told_ = given.said;
            return ise::nothing{};
        });
        provide(ask_back, [this](text given, const ise::call_context& context) -> ise::task<text> {
            auto who = caller(context);
            auto answer = co_await who.call(helm, given, 1min);
            co_return answer;
        });
        provide(echo, [](blob given) { return given; });
        provide(older::plan, [](older::route given) {
            return older::route_set{static_cast<std::uint32_t>(given.waypoints.size())};
        });
        provide(older::moved, [](text given) { return given; });
        provide_bursts();
        ise::publication_callbacks<std::remove_const_t<decltype(older::weather)>> callbacks;
        callbacks.on_subscribe = [](const ise::nothing&, const ise::subscriber_info&) { return text{"windy"}; };
        auto weather = publish(older::weather, callbacks);
        weather(older::wind{});
        provide(publish_weather, [weather](burst wanted) {
            for (std::uint32_t i = 0; i < wanted.count; ++i) weather(older::wind{static_cast<float>(i)});
            return ise::nothing{};
        });
        co_return;
    }
    void provide_bursts() {
        ise::publication_callbacks<std::remove_const_t<decltype(fixes)>> callbacks;
        callbacks.on_subscribe = [](const from_number& asked, const ise::subscriber_info&) -> ise::result<text> {
            if (asked.first == 13) return ise::failure(ise::errc::refused, "no unlucky numbers");
            return text{fmt::format("from {}", asked.first)};
        };
        callbacks.on_unsubscribe = [](const reason& given, const ise::subscriber_info&) {
            return text{"bye, " + given.why};
        };
        auto numbers = publish(fixes, callbacks);
        auto images = publish(pictures);
        provide(publish_fixes, [this, numbers](burst wanted) {
            if (wanted.send) {
                spawn("sender", send(numbers, wanted.count));
            } else {
                for (std::uint32_t i = 0; i < wanted.count; ++i) numbers(fix{i});
            }
            return ise::nothing{};
        });
        provide(publish_pictures, [images](burst wanted) {
            for (std::uint32_t i = 0; i < wanted.count; ++i)
                images(blob{std::vector<std::uint8_t>(wanted.bytes, static_cast<std::uint8_t>(i))});
            return ise::nothing{};
        });
        provide(withdraw_pictures, [this](ise::nothing) {
            withdraw(pictures);
            return ise::nothing{};
        });
    }
    static ise::task<> send(ise::publication<std::remove_const_t<decltype(fixes)>> to, std::uint32_t count) {
        for (std::uint32_t i = 0; i < count; ++i) {
            fix packet{i};
            co_await to.send(packet);
        }
    }

    std::string told_;
};

class asker : public ise::component {
public:
    asker(ise::endpoint to, std::string story) : to_(std::move(to)), story_(std::move(story)) {}

private:
    ise::task<> run() override {
        there_ = at(to_);
        if (story_ == "calls") co_await calls();
        else if (story_ == "versions") co_await versions();
        else if (story_ == "big") co_await big();
        else if (story_ == "fragments") co_await fragments();
        else if (story_ == "again") co_await again();
        else if (story_ == "subscriptions") co_await subscriptions();
        else if (story_ == "resume") co_await resume();
        else throw std::invalid_argument("there is no story " + story_);
        say("done");
        stop();
    }

    ise::task<> calls() {
        everything packet;
        packet.links.here = 1;
        packet.links.next = std::make_unique<chain>();
        auto sent = ise::to_json(packet);
        auto copy = ise::decode<everything>(ise::encode(packet));
        auto back = co_await there_.try_call(mirror, std::move(copy), 1min);
        if (ise::to_json(back.value()) != sent) throw std::runtime_error("what came back is not what was sent");
        say("mirror " + sent);
        for (const char* word : {"hold", "sink", "break"}) {
            text request{word};
            auto got = co_await there_.try_call(helm, request, 1min);
            say(fmt::format("{} {}", word, got ? got->said : std::string(ise::name_of(got.error().code()))));
        }
        provide(helm, [](text given) { return text{given.said + ", says the asker"}; });
        text question{"who"};
        auto answer = co_await there_.call(ask_back, question, 1min);
        say("back " + answer.said);
        co_await give_up();
        text request{"wait"};
        auto late = co_await there_.try_call(never, request, 50ms);
        say(fmt::format("never {}", late ? "answered" : ise::name_of(late.error().code())));
        ise::request_response<text, text> nowhere{"nowhere"};
        auto none = co_await there_.try_call(nowhere, request, 1min);
        say(fmt::format("nowhere {}", none ? "answered" : ise::name_of(none.error().code())));
    }

    // Cancels a call that the provider serves: what is written later is answered, so the request was written too.
    ise::task<> give_up() {
        asio::cancellation_signal enough;
        text request{"for ever"};
        std::string outcome = "waits";
        auto note = [&outcome](ise::result<text> got) {
            outcome = got ? "answered" : ise::name_of(got.error().code());
        };
        there_.try_call(never, request, 1h, asio::bind_cancellation_slot(enough.slot(), note));
        text other{"hold"};
        co_await there_.call(helm, other, 1min);
        enough.emit(asio::cancellation_type::terminal);
        co_await there_.call(helm, other, 1min);
        say("cancel " + outcome);
    }

    ise::task<> versions() {
        newer::route request;
        request.waypoints.resize(3);
        auto planned = co_await there_.call(newer::plan, request, 1min);
        say(fmt::format("plan {}", planned.count));
        auto wind = co_await there_.subscribe(newer::weather);
        auto packet = co_await wind.next();
        say(fmt::format("weather {} {}", wind.response().said, packet->from));
        co_await ask_for("cut");
        packet = co_await wind.next();
        if (!packet) throw ise::error(wind.cause());
        say(fmt::format("weather {} resumed {}", packet->speed_kn, wind.counts().resumed));
        newer::renamed other{"x"};
        auto refused = co_await there_.try_call(newer::moved, other, 1min);
        say(fmt::format("moved {}", refused ? "answered" : ise::name_of(refused.error().code())));
        ise::subscription<text> wrong{"weather"};
        co_await try_subscribe("weather", wrong);
    }
    template <class Contract>
    ise::task<> try_subscribe(std::string title, Contract service) {
        std::string outcome = "subscribed";
        try {
            auto stream = co_await there_.subscribe(service);
        } catch (const ise::error& why) {
            outcome = ise::name_of(why.code());
        }
        say(title + " " + outcome);
    }

    ise::task<> big() {
        blob request;
        request.content.assign(3u << 20, 7);
        auto back = co_await there_.call(echo, request, 1min);
        say(fmt::format("echo {}", back.content.size()));
        auto images = co_await there_.subscribe(pictures, ise::subscribe_options::keep_last(8));
        burst wanted{5, 600'000};
        co_await there_.call(publish_pictures, wanted, 1min);
        for (std::uint64_t seen = 0; seen < 5;) {
            auto packet = co_await images.next();
            seen += 1 + packet.lost_before().value();
        }
        co_await ask_for("hold");
        request.content.resize(32u << 20);
        auto late = co_await there_.try_call(echo, request, 300ms); // given up in the middle of its pieces
        co_await ask_for("release");
        say(fmt::format("held {}", late ? "answered" : ise::name_of(late.error().code())));
        ise::nothing now;
        co_await there_.call(withdraw_pictures, now, 1min);
        while (!images.ended()) co_await images.next();
        say(fmt::format("pictures {}", ise::name_of(images.cause().code())));
    }

    ise::task<> fragments() {
        blob request;
        request.content.assign(700'000, 7);
        auto back = co_await there_.call(echo, request, 1min);
        say(fmt::format("echo {}", back.content.size()));
        auto images = co_await there_.subscribe(pictures, ise::subscribe_options::keep_last(8));
        burst wanted{5, 200'000};
        co_await there_.call(publish_pictures, wanted, 1min);
        for (std::uint64_t seen = 0; seen < 5;) {
            auto packet = co_await images.next();
            seen += 1 + packet.lost_before().value();
            if (seen == 5) say(fmt::format("picture {}", packet->content.size()));
        }
    }

    // A call that is open when its session ends is answered in the next one.
    ise::task<> again() {
        text request{"the word is"};
        std::string outcome = "waits";
        there_.try_call(word, request, 1min,
                        [&outcome](ise::result<text> got) { outcome = got ? got->said : got.error().message(); });
        text other{"hold"};
        co_await there_.call(helm, other, 1min);
        co_await ask_for("cut");
        co_await there_.call(helm, other, 1min);
        text output{"ahoy"};
        co_await there_.call(recorded::tell, output, 1min);
        while (outcome == "waits") co_await sleep(5ms);
        say(outcome);
    }

    ise::task<> subscriptions() {
        co_await take("latest", ise::subscribe_options::keep_latest(), 400, false);
        co_await take("last", ise::subscribe_options::keep_last(16), 400, false);
        if (to_.kind != ise::protocol::udp) co_await take("lossless", ise::subscribe_options::lossless(5), 200, true);
        auto slow = ise::subscribe_options::keep_last(16);
        slow.min_interval = 20ms;
        co_await take("limited", slow, 50, false);
        co_await take("disconnect", ise::subscribe_options::disconnect(4), 5000, false);
        from_number unlucky{13};
        std::string outcome = "subscribed";
        try {
            auto stream = co_await there_.subscribe(fixes, unlucky, ise::subscribe_options());
        } catch (const ise::error& why) {
            outcome = ise::name_of(why.code());
        }
        say("unlucky " + outcome);
        ise::subscription<fix> nowhere{"nowhere"};
        co_await try_subscribe("nowhere", nowhere);
    }
    // Takes a burst and says what became of it.
    ise::task<> take(std::string title, ise::subscribe_options options, std::uint32_t count, bool send) {
        options.last_value = false;
        from_number first{5};
        auto stream = co_await there_.subscribe(fixes, first, options);
        burst wanted{count, 0, send};
        co_await there_.call(publish_fixes, wanted, 1min);
        while (send && stream.counts().received < count) co_await stream.next();
        while (!send && options.min_interval == 0s) {
            auto packet = co_await stream.next();
            if (!packet || packet->number + 1 == count) break;
        }
        while (options.min_interval > 0s &&
               stream.counts().skipped == 0) { // until one comes behind those that were left out
            co_await there_.call(publish_fixes, wanted, 1min);
            while (stream.try_next()) {}
        }
        auto& counts = stream.counts();
        say(fmt::format("{} received {} lost {} skipped {} {}", title, counts.received, counts.lost_at_provider,
                        counts.skipped, stream.ended() ? ise::name_of(stream.cause().code()) : "alive"));
    }

    ise::task<> resume() {
        auto options = ise::subscribe_options::keep_last(8);
        options.last_value = false;
        from_number first{5};
        auto stream = co_await there_.subscribe(fixes, first, options);
        burst wanted{10, 0};
        co_await there_.call(publish_fixes, wanted, 1min);
        co_await take_until(stream, 10);
        co_await ask_for("cut");
        co_await take_until(stream, 20); // published by somebody else meanwhile
        say(fmt::format("resumed {}", stream.counts().resumed));
        co_await ask_for("restart");
        while (!stream.counts().restarts) {
            auto got = co_await there_.try_call(publish_fixes, wanted, 1min);
            (void)got; // the old session may still be there, or the new one be without the subscription
            while (stream.try_next()) {}
        }
        say(fmt::format("restarts {}", stream.counts().restarts));
    }
    template <class Stream>
    static ise::task<> take_until(Stream& stream, std::uint64_t count) {
        for (std::uint64_t seen = 0; seen < count;) {
            auto packet = co_await stream.next();
            if (!packet) break;
            seen += 1 + packet.lost_before().value();
        }
    }
    // Lets whoever started this program do something, and waits for its line.
    ise::task<> ask_for(std::string what) {
        auto line = [what] {
            say("!" + what);
            std::string answer;
            if (!std::getline(std::cin, answer)) throw std::runtime_error("nobody answered to '" + what + "'");
        };
        co_await offload(line);
    }

    ise::endpoint to_;
    std::string story_;
    ise::remote there_;
};

int play(const std::vector<std::string>& words) {
    ise::real_environment env;
    ise::node_options options;
    options.use_names = words[0] == "provide" && words.size() > 2;
    options.services.accepts.heartbeat_ns = 60'000'000'000; // a relay that holds is no peer that is lost
    ise::node node(env, options);
    std::vector<ise::endpoint> where;
    std::istringstream given(words[1]);
    for (std::string one; std::getline(given, one, ',');) where.push_back(ise::endpoint::parse(one).value());
    ise::component_options how;
    if (words[0] == "ask") {
        how.listens = false;
        how.policy = ise::on_failure::stop_node;
        node.start<asker>("", how, where.at(0), words.at(2));
        return ise::run_until_signal(node);
    }
    how.listen = where;
    if (auto through = env.variable("WIRE_PARTY_ADVERTISE"))
        how.advertise.push_back(ise::endpoint::parse(*through).value());
    auto& made = node.start<provider>(words.size() > 2 ? words[2] : "test/provider", how);
    return ise::run_until_signal(node, [&] {
        std::string listening = "at";
        for (const auto& one : made.services().listening()) listening += " " + one.text();
        say(listening);
    });
}

} // namespace

int main(int argc, char** argv) {
    std::vector<std::string> words(argv + 1, argv + argc);
    bool asks = words.size() == 3 && words[0] == "ask";
    bool provides = (words.size() == 2 || words.size() == 3) && words[0] == "provide";
    if (!asks && !provides) {
        fmt::print(stderr, "usage: wire_party provide ENDPOINT[,ENDPOINT] [PATH] | ask ENDPOINT STORY\n");
        return 2;
    }
    try {
        return play(words);
    } catch (const std::exception& thrown) {
        fmt::print(stderr, "wire_party: {}\n", thrown.what());
        return 1;
    }
}
