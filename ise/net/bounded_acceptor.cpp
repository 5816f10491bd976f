#include <ise/net/bounded_acceptor.hpp>

#include <ise/core/log_limiter.hpp>
#include <ise/core/real/system_errors.hpp>
#include <ise/core/sleep.hpp>

#include <asio/error.hpp>
#include <fmt/format.h>

#include <utility>

namespace ise::net {
namespace {

constexpr duration accept_pause = std::chrono::milliseconds(100);

} // namespace

accept_reporter log_to(loop& on, logger log) {
    return [&on, log = std::move(log), quiet = log_limiter()](const std::string& what, const std::string& at) mutable {
        if (auto left_out = quiet.admit(on.now()))
            log.warning(what, {{"at", at}, {"left_out", std::to_string(*left_out)}});
    };
}

task<> accept_each(loop& on, std::shared_ptr<listener> from, fair_places* places, accept_reporter report,
                   std::function<void(admitted)> take) {
    for (;;) {
        auto [problem, stranger] = co_await from->accept();
        if (problem == asio::error::operation_aborted) co_return;
        // A socket that was closed during the pause: Asio refuses to accept on it.
        if (problem == asio::error::bad_descriptor) co_return;
        if (problem) {
            const bool scarce = real::is_out_of_descriptors(problem);
            if (places && (scarce || real::is_out_of_memory(problem))) places->make_way();
            auto what = fmt::format("cannot accept: {}{}{}", problem.message(),
                                    scarce ? "; sessions go on, new ones wait until some have ended" : "",
                                    real::advice_on(problem));
            report(what, from->where().text());
            co_await sleep_for(on, accept_pause);
            continue;
        }
        admitted made;
        if (places) {
            made.place = places->take(stranger->peer());
            made.refused = !made.place;
            if (made.place) made.place->on_displaced([line = stranger.get()] { line->close(); });
        }
        made.line = std::move(stranger);
        take(std::move(made));
    }
}

} // namespace ise::net
