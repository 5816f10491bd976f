#include "subscribing.hpp"

#include "arrivals.hpp"
#include "text.hpp"

#include <nlohmann/json.hpp>

#include <fmt/format.h>

#include <memory>

namespace ise::cli {
namespace {

// Shared by the coroutine that receives and the one that reports.
struct meter {
    explicit meter(dynamic_stream from) : stream(std::move(from)) {}

    dynamic_stream stream;
    arrivals seen;
};

task<> receive(component& self, std::shared_ptr<meter> into) {
    for (;;) {
        auto packet = co_await into->stream.next();
        if (!packet) break;
        auto now = self.now();
        for (; packet; packet = into->stream.try_next()) into->seen.add(now);
    }
}

std::string show(const subscription_counts& counts) {
    return fmt::format("{}{}", counts.lost_at_provider + counts.lost_here, counts.restarts != 0 ? " and more" : "");
}

std::string heading() {
    return fmt::format("{:>10}  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}  {:>8}\n", "RATE", "MEAN", "JITTER", "SHORTEST",
                       "LONGEST", "PACKETS", "LOST");
}

std::string row(const arrivals::summary& of, const dynamic_stream& stream) {
    auto interval = [&](duration length) { return of.intervals == 0 ? std::string("-") : show_duration(length); };
    return fmt::format("{:>7.2f} Hz  {:>9}  {:>9}  {:>9}  {:>9}  {:>8}  {:>8}{}\n", of.rate_hz, interval(of.mean),
                       interval(of.jitter), interval(of.shortest), interval(of.longest), of.packets,
                       show(stream.counts()), stream.connected() ? "" : "  not connected");
}

std::string line(const arrivals::summary& of, const dynamic_stream& stream) {
    auto seconds = [&](duration length) {
        return of.intervals == 0 ? nlohmann::ordered_json()
                                 : nlohmann::ordered_json(std::chrono::duration<double>(length).count());
    };
    const auto& counts = stream.counts();
    nlohmann::ordered_json told;
    told["rate_hz"] = of.rate_hz;
    told["packets"] = of.packets;
    told["mean_s"] = seconds(of.mean);
    told["jitter_s"] = seconds(of.jitter);
    told["shortest_s"] = seconds(of.shortest);
    told["longest_s"] = seconds(of.longest);
    told["connected"] = stream.connected();
    told["received"] = counts.received;
    told["lost_at_provider"] = counts.lost_at_provider;
    told["lost_here"] = counts.lost_here;
    told["restarts"] = counts.restarts;
    return told.dump() + "\n";
}

} // namespace

task<> hz(context& in, hz_options options) {
    subscribe_options terms;
    terms.last_value = false;
    auto stream = co_await open_stream(in, options.what, terms);
    auto shared = std::make_shared<meter>(std::move(stream));
    in.self.spawn("meter", receive(in.self, shared));
    if (!in.set.json) co_await in.out.write(in.self, heading());
    auto at = in.self.now();
    for (std::uint64_t windows = 0; !options.count || windows < *options.count; ++windows) {
        at = saturating_add(at, options.window);
        co_await in.self.sleep_till(at);
        auto seen = shared->seen.take(options.window);
        auto text = in.set.json ? line(seen, shared->stream) : row(seen, shared->stream);
        co_await in.out.write(in.self, std::move(text));
        if (shared->stream.ended()) throw problem(shared->stream.cause());
    }
    shared->stream.leave();
}

} // namespace ise::cli
