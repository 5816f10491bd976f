#include "metering.hpp"

#include <fmt/format.h>

#include <algorithm>

namespace ise::cli {
namespace {

// Shared by the coroutine that receives and the one that reports.
struct metered_stream {
    dynamic_stream stream;
    std::shared_ptr<gauge> to;
};

task<> receive_all(component& self, std::shared_ptr<metered_stream> from) {
    for (;;) {
        auto packet = co_await from->stream.next();
        if (!packet) break;
        auto now = self.now();
        for (; packet; packet = from->stream.try_next()) from->to->see(packet, now);
    }
}

class stream_windows final : public window_printer {
public:
    stream_windows(const settings& set, const metered_stream& of) : set_(set), of_(of) {}

    std::string heading() const override { return of_.to->heading(); }
    task<std::string> take(duration length, bool) override {
        if (set_.json) co_return of_.to->json(length, of_.stream);
        co_return of_.to->row(length, of_.stream);
    }
    void check() const override {
        if (of_.stream.ended()) throw problem(of_.stream.cause());
    }

private:
    const settings& set_;
    const metered_stream& of_;
};

} // namespace

task<> print_windows(context& in, duration window, std::optional<std::uint64_t> count, window_printer& of) {
    if (!in.set.json) co_await in.out.write(in.self, of.heading());
    auto at = in.self.now();
    for (std::uint64_t windows = 0; !count || windows < *count; ++windows) {
        auto began = at;
        at = std::max(saturating_add(at, window), in.self.now());
        co_await in.self.sleep_till(at);
        auto text = co_await of.take(at - began, count && windows + 1 == *count);
        co_await in.out.write(in.self, std::move(text));
        of.check();
    }
}

void add_metering(command_line::app& app, metering_options& into) {
    add_subscription(app, into.what);
    add_time(app, "--window", into.window, "time of one line (default: 1s)");
    add_count(app, into.count, "end after N lines");
}

void complete_metering(metering_options& of, parsed_command& made) {
    of.what.json = json_given(of.what.json);
    made.endless = !of.count;
}

task<> measure(context& in, metering_options options, std::shared_ptr<gauge> to) {
    subscribe_options terms;
    terms.last_value = false;
    auto shared = std::make_shared<metered_stream>();
    shared->to = std::move(to);
    shared->stream = co_await open_stream(in, options.what, terms);
    in.self.spawn("meter", receive_all(in.self, shared));
    stream_windows windows(in.set, *shared);
    co_await print_windows(in, options.window, options.count, windows);
    shared->stream.unsubscribe();
}

std::string show_losses(const dynamic_stream& stream) {
    const auto& counts = stream.counts();
    return fmt::format("{}{}{}", counts.lost_at_provider + counts.lost_here, counts.restarts != 0 ? "+" : "",
                       stream.connected() ? "" : " (not connected)");
}

} // namespace ise::cli
