#pragma once
#include <ise/core/bytes.hpp>
#include <ise/core/result.hpp>
#include <ise/core/task.hpp>
#include <ise/packet/codec.hpp>
#include <ise/service/action.hpp>
#include <ise/subscription/subscriber_core.hpp>

#include <cstdint>
#include <memory>
#include <optional>
#include <string>
#include <utility>

namespace ise {

/// One run on the requester's side, without its types: a subscription that is made anew over each new session, by
/// which the provider knows it, and never begins a second time.
class run_core final : public subscriber_core {
public:
    /// `goal` is encoded.
    run_core(std::shared_ptr<subscription_owner> to, std::string service, const packet_types& types,
             run_options options, bytes_view goal);

    /// Starts it, until the provider accepts it. Fails as `remote::start`. Cancellation: terminal, cancels the run.
    static task<result<void>> start(std::shared_ptr<run_core> self);
    /// The next report; none once the run is over. Cancellation: terminal, no report is lost.
    static task<std::optional<bytes>> next(std::shared_ptr<run_core> self);
    /// The result, behind all reports. Fails as `action_run::result`. Cancellation: terminal, the outcome is not lost.
    static task<result<bytes>> finish(std::shared_ptr<run_core> self);
    /// Cancels it.
    void cancel();

    bool done() const noexcept { return outcome_.has_value() || ended(); }
    std::uint32_t queue_position() const noexcept { return queue_position_; }

    bool resumes() const noexcept override { return false; }

private:
    void take_response(bytes_view raw) override;
    void on_sent_to(std::uint64_t incarnation) override;
    void on_session_lost() override;
    bool accepted() noexcept;
    std::optional<bytes> take_report();
    void conclude(result<bytes> with);
    void give_up(errc why, std::string text);
    void look_idle();
    failure cause_of_end();

    run_options limits_;
    std::uint32_t queue_position_ = 0;
    std::optional<result<bytes>> outcome_;
    timer deadline_, idle_, away_;
};

/// A run that this component requested. Move-only; used on its component's loop by one coroutine at a time. Destroying
/// it before the run is over cancels the run: the provider's handler is cancelled at its next suspension. It survives
/// lost sessions. If the provider is unreachable for longer than the linger (30 s), or was restarted, the run ends with
/// errc::peer_lost (unknown). Functions of an empty one throw errc::invalid_argument.
template <class Action>
class action_run {
    using feedback_type = typename Action::feedback_type;
    using result_type = typename Action::result_type;

public:
    action_run() = default;
    /// Made by `remote::start`.
    explicit action_run(std::shared_ptr<run_core> core) noexcept : core_(std::move(core)) {}
    action_run(action_run&&) noexcept = default; ///< takes the run over
    /// The same; a run that was held before is cancelled.
    action_run& operator=(action_run&& other) noexcept {
        if (core_ && core_ != other.core_) core_->cancel();
        core_ = std::move(other.core_);
        return *this;
    }
    ~action_run() {
        if (core_) core_->cancel();
    }

    /// Whether it is a run, live or over.
    explicit operator bool() const noexcept { return core_ != nullptr; }
    /// Waits for the next feedback; empty when the run is over. Throws errc::malformed if it cannot be decoded.
    /// Cancellation: terminal; the run continues as long as this object exists.
    task<std::optional<feedback_type>> next() { return decoded_next(held()); }
    /// Waits for the end of the run, and returns its result; unread feedback is dropped. Throws
    /// ise::error: the handler's failure (refused, handler_failed), cancelled (by the provider, such as replaced by a
    /// newer goal), timed_out (deadline, idle), peer_lost (unknown). Cancellation: terminal; the run goes on.
    task<result_type> result() { return decoded_result(held()); }
    /// The same, with the outcome as a value. Cancellation: as above.
    task<ise::result<result_type>> try_result() { return decoded_outcome(held()); }

    /// Cancels the run now; `result()` throws errc::cancelled.
    void cancel() { held()->cancel(); }
    /// Whether the outcome is known.
    bool done() const { return held()->done(); }
    /// Number of goals ahead in the provider's queue when it accepted this one.
    std::uint32_t queue_position() const { return held()->queue_position(); }
    /// Whether the provider is connected now.
    bool connected() const { return held()->connected(); }

private:
    const std::shared_ptr<run_core>& held() const {
        if (!core_) throw error(errc::invalid_argument, "an empty run: assign what `start(action, goal)` gave first");
        return core_;
    }
    static task<std::optional<feedback_type>> decoded_next(std::shared_ptr<run_core> core) {
        auto raw = co_await run_core::next(std::move(core));
        std::optional<feedback_type> report;
        if (raw) decode_into(report.emplace(), *raw);
        co_return report;
    }
    static task<ise::result<result_type>> decoded_outcome(std::shared_ptr<run_core> core) {
        auto raw = co_await run_core::finish(std::move(core));
        if (!raw) co_return raw.error();
        try {
            result_type made{};
            decode_into(made, *raw);
            co_return made;
        } catch (const error& unfit) { // it ran
            co_return failure(unfit.code(), unfit.what(), execution::unknown);
        }
    }
    static task<result_type> decoded_result(std::shared_ptr<run_core> core) {
        auto outcome = co_await decoded_outcome(std::move(core));
        co_return std::move(outcome.value());
    }

    std::shared_ptr<run_core> core_;
};

/// The same, so that `ise::action_run<decltype(sail_to)>` can be a member: the constant of an action is const.
template <class Action>
class action_run<const Action> : public action_run<Action> {
public:
    action_run() = default;
    /// What `start` gave.
    action_run(action_run<Action>&& made) noexcept : action_run<Action>(std::move(made)) {}
};

} // namespace ise
