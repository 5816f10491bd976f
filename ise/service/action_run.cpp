#include <ise/service/action_run.hpp>

#include <ise/core/little_endian.hpp>
#include <ise/session/service_runtime.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <chrono>

namespace ise {
namespace {

subscribe_options terms_of(const run_options& options) {
    auto made = subscribe_options::keep_last(std::max<std::uint32_t>(options.depth, 1));
    made.last_value = false;
    made.deadline = options.accept;
    return made;
}

bytes request_of(environment& env, const run_options& options, bytes_view goal) {
    bytes made(action_layout::goal);
    detail::store_little(made.data() + action_layout::run, env.random());
    detail::store_little(made.data() + action_layout::run + 8, env.random());
    detail::store_little(made.data() + action_layout::time,
                         static_cast<std::int64_t>(std::max(options.deadline, duration()).count()));
    made.insert(made.end(), goal.begin(), goal.end());
    return made;
}

double seconds(duration length) { return std::chrono::duration<double>(length).count(); }

} // namespace

run_core::run_core(std::shared_ptr<subscription_owner> to, std::string service, const packet_types& types,
                   run_options options, bytes_view goal)
    : subscriber_core(to, std::move(service), types, terms_of(options), request_of(to->runtime().env(), options, goal)),
      limits_(options), deadline_(on_,
                                  [this] {
                                      give_up(errc::timed_out, fmt::format("did not end within its deadline of {} s",
                                                                           seconds(limits_.deadline)));
                                  }),
      idle_(on_, [this] { look_idle(); }), away_(on_, [this] {
          give_up(errc::peer_lost, fmt::format("was out of reach for {} s (linger), after which it is cancelled there",
                                               seconds(owner_->runtime().options().linger)));
      }) {}

task<result<void>> run_core::start(std::shared_ptr<run_core> self) {
    if (self->limits_.deadline > duration{})
        self->deadline_.arm(saturating_add(self->on_.now(), self->limits_.deadline));
    auto begun = co_await self->begin();
    if (!begun) {
        const bool known = self->accepted();
        auto why = begun.error();
        // Nothing was begun by a provider that refused it; else it may have been.
        const auto& sent = self->request();
        const bool was_sent = detail::load_little<std::uint64_t>(sent.data() + action_layout::life) != 0;
        const bool refused = why.code() == errc::refused || why.code() == errc::overloaded ||
                             why.code() == errc::no_such_service || why.code() == errc::type_mismatch ||
                             why.code() == errc::invalid_argument;
        self->conclude(failure(why.code(), std::string(why.message()),
                               known || (was_sent && !refused) ? execution::unknown : execution::not_executed));
        co_return self->outcome_->error();
    }
    co_return begun;
}

bool run_core::accepted() noexcept { return request()[action_layout::known] != std::byte{0}; }

void run_core::on_sent_to(std::uint64_t incarnation) {
    auto* life = request().data() + action_layout::life;
    if (detail::load_little<std::uint64_t>(life) == 0) detail::store_little(life, incarnation);
}

void run_core::take_response(bytes_view raw) {
    away_.disarm();
    action_accepted answer;
    if (!raw.empty()) decode_into(answer, raw);
    if (!accepted()) {
        queue_position_ = answer.before;
        request()[action_layout::known] = std::byte{1};
        if (limits_.idle > duration{}) idle_.arm(saturating_add(on_.now(), limits_.idle));
    }
}

// The provider keeps the run for its linger, and gives it up then.
void run_core::on_session_lost() {
    if (!done() && !away_.armed()) away_.arm(saturating_add(on_.now(), owner_->runtime().options().linger));
}

void run_core::look_idle() {
    if (done()) return;
    if (!queue_.empty()) idle_.arm(saturating_add(on_.now(), limits_.idle)); // it is this side that is slow
    else give_up(errc::timed_out, fmt::format("reported nothing for {} s (idle)", seconds(limits_.idle)));
}

void run_core::give_up(errc why, std::string text) {
    if (done()) return;
    end_here(failure(why, fmt::format("'{}' at {} {}", service(), owner_->name(), text), execution::unknown));
}

void run_core::cancel() {
    if (!ended()) unsubscribe();
    if (!outcome_)
        conclude(failure(errc::cancelled,
                         fmt::format("'{}' at {} was cancelled by its requester", service(), owner_->name()),
                         execution::unknown));
}

void run_core::conclude(result<bytes> with) {
    deadline_.disarm();
    idle_.disarm();
    away_.disarm();
    outcome_.emplace(std::move(with));
    if (!ended()) unsubscribe(); // the provider forgets it
}

std::optional<bytes> run_core::take_report() {
    while (!queue_.empty()) {
        bytes raw;
        try {
            auto waiting = queue_.front();
            auto came = waiting.bytes();
            raw.assign(came.begin(), came.end());
        } catch (const error& unreadable) {
            drop_undecodable(unreadable);
            continue;
        }
        take_packet();
        if (limits_.idle > duration{}) idle_.arm(saturating_add(on_.now(), limits_.idle));
        const auto kind = raw.empty() ? std::size_t{3} : std::to_integer<std::size_t>(raw.front());
        if (!raw.empty()) raw.erase(raw.begin());
        if (kind == 0) return raw;
        if (kind == 1) {
            conclude(std::move(raw));
        } else if (kind == 2) {
            try {
                auto why = decode<run_failure>(raw);
                conclude(failure(static_cast<errc>(why.code),
                                 fmt::format("'{}' at {}: {}", service(), owner_->name(), why.reason),
                                 why.execution == 0 ? execution::not_executed : execution::unknown));
            } catch (const error& unreadable) {
                conclude(unreadable.why());
            }
        } else {
            conclude(failure(
                errc::malformed,
                fmt::format("'{}' at {} sent something that is no report and no outcome", service(), owner_->name()),
                execution::unknown));
        }
        return std::nullopt;
    }
    return std::nullopt;
}

// The subscription ended, and no outcome came.
failure run_core::cause_of_end() { return {cause().code(), std::string(cause().message()), execution::unknown}; }

task<std::optional<bytes>> run_core::next(std::shared_ptr<run_core> self) {
    for (;;) {
        if (self->outcome_) co_return std::nullopt;
        auto report = self->take_report();
        if (report || self->outcome_) co_return report;
        if (self->ended()) {
            self->conclude(self->cause_of_end());
            co_return std::nullopt;
        }
        co_await self->wait_for_packet();
    }
}

task<result<bytes>> run_core::finish(std::shared_ptr<run_core> self) {
    for (;;) {
        auto report = co_await next(self);
        if (!report) break;
    }
    co_return *self->outcome_;
}

} // namespace ise
