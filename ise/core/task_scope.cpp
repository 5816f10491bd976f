#include <ise/core/task_scope.hpp>

#include <ise/core/error.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/error.hpp>
#include <asio/executor_work_guard.hpp>
#include <asio/post.hpp>

#include <system_error>
#include <utility>

namespace ise {

class task_scope::child final : public async_stack {
public:
    child(task_scope& scope, std::string name, task<> body, const asio::any_io_executor& executor)
        : async_stack(on_), place(scope.children_.size()), scope_(&scope), name_(std::move(name)),
          body_(std::move(body)), on_(executor), work_(executor) {
        begin(body_);
        scope.children_.push_back(this);
    }

    const std::string& name() const noexcept { return name_; }
    /// Its scope is gone: it is destroyed with what it waits for.
    void orphan() noexcept { scope_ = nullptr; }

    std::size_t place; ///< among the scope's children
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
        if (scope_) scope_->ended(*this, name_, problem);
        if (gone) *gone = true;
        delete this;
    }
    void on_drop() noexcept override {
        if (scope_) scope_->forget(*this);
        if (gone) *gone = true;
        delete this;
    }

    task_scope* scope_;
    std::string name_;
    task<> body_;
    asio::any_io_executor on_;
    asio::executor_work_guard<asio::any_io_executor> work_;
};

task_scope::task_scope(loop& owner, failure_handler on_failure)
    : loop_(owner), on_failure_(std::move(on_failure)), empty_(owner, [this] { empty_.resume(); }) {}

task_scope::~task_scope() {
    for (auto* one : children_) one->orphan();
}

async_stack* task_scope::spawn(std::string name, task<> body) {
    return spawn(std::move(name), std::move(body), loop_.get_executor());
}

async_stack* task_scope::spawn(std::string name, task<> body, const asio::any_io_executor& executor) {
    if (stopping_) return nullptr;
    auto* made = new child(*this, std::move(name), std::move(body), executor);
    suspended_stack first(*made);
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
    for (auto place = children_.size(); place-- > 0;)
        if (place < children_.size()) children_[place]->cancel();
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
    for (const auto* one : children_) names.push_back(one->name());
    return names;
}

void task_scope::forget(child& who) noexcept {
    children_.back()->place = who.place;
    children_[who.place] = children_.back();
    children_.pop_back();
}

void task_scope::ended(child& who, const std::string& name, const std::exception_ptr& problem) {
    forget(who);
    if (problem && on_failure_ && !(stopping_ && is_cancellation(problem))) on_failure_(name, problem);
    if (children_.empty()) empty_.resume();
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
