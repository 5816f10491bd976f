#include <ise/core/task_scope.hpp>

#include <ise/core/error.hpp>

#include <asio/bind_cancellation_slot.hpp>
#include <asio/co_spawn.hpp>
#include <asio/error.hpp>

namespace ise {

task_scope::task_scope(loop& owner, failure_handler on_failure)
    : loop_(owner), on_failure_(std::move(on_failure)), roster_(std::make_shared<roster>()),
      empty_(owner, [this] { empty_.resume(); }) {
    roster_->scope = this;
}

task_scope::~task_scope() { roster_->scope = nullptr; }

asio::cancellation_signal* task_scope::spawn(std::string name, task<> body) {
    return spawn(std::move(name), std::move(body), loop_.get_executor());
}

asio::cancellation_signal* task_scope::spawn(std::string name, task<> body, asio::any_io_executor executor) {
    if (stopping_) return nullptr;
    auto who = roster_->children.emplace(roster_->children.end());
    who->name = std::move(name);
    auto done = [listed = roster_, who](std::exception_ptr problem) {
        if (listed->scope) listed->scope->ended(who, problem);
    };
    // On the loop's own thread it runs at once up to its first suspension, and may end there.
    bool gone = false;
    auto outer = std::exchange(starting_, starting{&*who, &gone});
    asio::co_spawn(std::move(executor), std::move(body),
                   asio::bind_cancellation_slot(who->cancel.slot(), std::move(done)));
    starting_ = outer;
    return gone ? nullptr : &who->cancel;
}

void task_scope::stop() {
    stopping_ = true;
    // A child may end, and leave the list, as soon as the loop runs: never within emit.
    auto held = roster_;
    for (auto& entry : held->children) entry.cancel.emit(asio::cancellation_type::terminal);
}

task<> task_scope::join() {
    if (size() == 0) co_return;
    co_await empty_.wait();
}

task<bool> task_scope::join_until(time_point at) {
    timer alarm(loop_, [this] { empty_.resume(); });
    alarm.arm(at);
    while (size() > 0 && loop_.now() < at) co_await empty_.wait();
    co_return size() == 0;
}

std::vector<std::string> task_scope::running() const {
    std::vector<std::string> names;
    for (const auto& entry : roster_->children) names.push_back(entry.name);
    return names;
}

void task_scope::ended(children::iterator who, std::exception_ptr problem) {
    if (starting_.who == &*who) *starting_.gone = true;
    auto name = std::move(who->name);
    roster_->children.erase(who);
    if (problem && on_failure_ && !(stopping_ && is_cancellation(problem))) on_failure_(name, problem);
    if (roster_->children.empty()) empty_.resume();
}

bool is_cancellation(const std::exception_ptr& problem) noexcept {
    try {
        std::rethrow_exception(problem);
    } catch (const std::system_error& thrown) {
        return thrown.code() == asio::error::operation_aborted;
    } catch (const error& thrown) {
        return thrown.code() == errc::cancelled;
    } catch (...) {
        return false;
    }
}

std::string describe(const std::exception_ptr& problem) {
    try {
        std::rethrow_exception(problem);
    } catch (const std::exception& thrown) {
        return thrown.what();
    } catch (...) {
        return "an exception that is not a std::exception";
    }
}

} // namespace ise
