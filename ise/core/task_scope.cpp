#include <ise/core/task_scope.hpp>

#include <ise/core/error.hpp>
#include <ise/core/listed_waiter.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/error.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/post.hpp>

#include <system_error>
#include <utility>

namespace ise {

class task_scope::child final : public async_stack, public member {
public:
    child(std::string name, task<> body, const asio::any_io_executor& executor)
        : async_stack(on_), name_(std::move(name)), body_(std::move(body)), on_(executor), work_(executor) {
        begin(body_);
    }

    std::string name() const override { return name_; }
    void cancel() override { async_stack::cancel(); }

    bool* gone = nullptr;

private:
    void on_end() override {
        std::exception_ptr problem;
        try {
            outcome_of(body_);
        } catch (...) {
            problem = std::current_exception();
        }
        body_ = task<>(); // what it owned may have owned the scope
        if (auto* of = scope()) {
            leave();
            if (problem) of->failed(name_, problem);
        }
        if (gone) *gone = true;
        delete this;
    }
    void on_drop() noexcept override {
        if (gone) *gone = true;
        delete this;
    }

    std::string name_;
    task<> body_;
    asio::any_io_executor on_;
    asio::executor_work_guard<asio::any_io_executor> work_;
};

task_scope::task_scope(loop& owner, failure_handler on_failure) : loop_(owner), on_failure_(std::move(on_failure)) {}

// A coroutine that is left is destroyed with what it waits for.
task_scope::~task_scope() {
    for (const auto& one : members_) one->scope_ = nullptr;
}

// The last one takes its place.
void task_scope::member::leave() noexcept {
    auto* of = std::exchange(scope_, nullptr);
    if (!of) return;
    auto held = std::exchange(of->members_[place_], nullptr);
    if (auto& last = of->members_.back()) {
        last->place_ = place_;
        of->members_[place_] = std::move(last);
    }
    of->members_.pop_back();
    if (!of->members_.empty() || of->loop_.abandoned()) return;
    for (auto* waiting : of->joining_) waiting->resume();
}

bool task_scope::add(std::shared_ptr<member> what) {
    if (stopping_) return false;
    auto& added = *members_.emplace_back(std::move(what)); // may throw
    added.scope_ = this;
    added.place_ = members_.size() - 1;
    return true;
}

async_stack* task_scope::spawn(std::string name, task<> body) {
    return spawn(std::move(name), std::move(body), loop_.get_executor());
}

async_stack* task_scope::spawn(std::string name, task<> body, const asio::any_io_executor& executor) {
    if (stopping_) return nullptr;
    auto* made = new child(std::move(name), std::move(body), executor);
    suspended_stack first(*made);
    add(std::shared_ptr<member>(std::shared_ptr<void>(), made));
    if (!loop_.running_here()) {
        asio::post(executor, [first = std::move(first)]() mutable { first.resume(); });
        return made;
    }
    bool gone = false;
    made->gone = &gone;
    first.resume(); // up to its first suspension
    if (gone) return nullptr;
    made->gone = nullptr;
    return made;
}

void task_scope::stop() {
    stopping_ = true;
    // From the end: one that ends here gives its place to one that was cancelled already.
    for (auto place = members_.size(); place-- > 0;)
        if (place < members_.size()) members_[place]->cancel();
}

task<> task_scope::join() { co_await join_until(time_point::max()); }

task<bool> task_scope::join_until(time_point at) {
    listed_waiter left(loop_, joining_);
    timer alarm(loop_, [&left] { left.resume(); });
    alarm.arm(at);
    while (size() > 0 && loop_.now() < at) co_await left.wait();
    co_return size() == 0;
}

std::vector<std::string> task_scope::running() const {
    std::vector<std::string> names;
    for (const auto& one : members_) names.push_back(one->name());
    return names;
}

void task_scope::failed(const std::string& name, const std::exception_ptr& problem) {
    if (on_failure_ && !(stopping_ && is_cancellation(problem))) on_failure_(name, problem);
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
