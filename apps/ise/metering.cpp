#include "metering.hpp"

#include <fmt/format.h>

#include <memory>

namespace ise::cli {
namespace {

// Shared by the coroutine that receives and the one that reports.
struct metered {
    metered(dynamic_stream from, std::shared_ptr<gauge> by) : stream(std::move(from)), to(std::move(by)) {}

    dynamic_stream stream;
    std::shared_ptr<gauge> to;
};

task<> receive(std::shared_ptr<metered> from) {
    for (;;) {
        auto packet = co_await from->stream.next();
        if (!packet) break;
        for (; packet; packet = from->stream.try_next()) from->to->see(*packet);
    }
}

} // namespace

task<> measure(context& in, hz_options options, std::shared_ptr<gauge> to) {
    subscribe_options terms;
    terms.last_value = false;
    auto stream = co_await open_stream(in, options.what, terms);
    auto shared = std::make_shared<metered>(std::move(stream), to);
    in.self.spawn("meter", receive(shared));
    auto heading = in.set.json ? std::string() : to->heading();
    co_await in.out.write(in.self, std::move(heading));
    auto at = in.self.now();
    for (std::uint64_t windows = 0; !options.count || windows < *options.count; ++windows) {
        at = saturating_add(at, options.window);
        co_await in.self.sleep_till(at);
        auto text = in.set.json ? to->json(options.window, shared->stream) : to->row(options.window, shared->stream);
        co_await in.out.write(in.self, std::move(text));
        if (shared->stream.ended()) throw problem(shared->stream.cause());
    }
    shared->stream.leave();
}

std::string show_losses(const dynamic_stream& stream) {
    const auto& counts = stream.counts();
    return fmt::format("{}{}{}", counts.lost_at_provider + counts.lost_here, counts.restarts != 0 ? " and more" : "",
                       stream.connected() ? "" : "  not connected");
}

} // namespace ise::cli
