// Keepers that an instantiation server finds before they have started their program; here a shell plays the keeper.
#include <ise/core/loop.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/instantiation/process_table.hpp>
#include <ise/instantiation/real_machine.hpp>

#include <support/catch.hpp>

#include <csignal>
#include <future>
#include <memory>
#include <string>

#include <sys/wait.h>
#include <unistd.h>

namespace adopting_test {

using namespace ise::instantiation;

namespace {

const std::string mark = "adopting-test-mark";

class adopting_host {
public:
    /// Adopts a keeper that runs a script of the shell.
    explicit adopting_host(std::string script) {
        keeper_ = ::fork();
        REQUIRE(keeper_ >= 0);
        if (keeper_ == 0) {
            ::setpgid(0, 0);
            ::setenv(keeper_variable, mark.c_str(), 1);
            ::execl("/bin/sh", "sh", "-c", script.c_str(), nullptr);
            ::_exit(127);
        }
        while (!carries_mark(keeper_, mark, keeper_variable)) ::usleep(1000); // NOLINT: it has still to run the shell
        on_loop([&] { made = machine_.adopt(loop_->loop(), {}, mark, [this](process_end) { over_.set_value(); }); });
    }
    ~adopting_host() {
        on_loop([&] { made = ise::failure(ise::errc::no_such_name, "released"); });
        for (const auto& one : members_of({}, mark)) send_signal(one.stamp, SIGKILL);
        if (keeper_ <= 1) return;
        ::kill(-keeper_, SIGKILL);
        ::waitpid(keeper_, nullptr, 0);
    }
    void terminate() {
        on_loop([&] { made.value()->terminate(); });
    }
    void wait_for_end() {
        over_.get_future().get();
        keeper_ = 0; // it was reaped
    }
    /// How the keeper ended.
    int keeper_status() {
        int status = 0;
        REQUIRE(::waitpid(keeper_, &status, 0) == keeper_);
        keeper_ = 0;
        return status;
    }

    ise::result<std::unique_ptr<process>> made = ise::failure(ise::errc::no_such_name, "not adopted yet");

private:
    void on_loop(const std::function<void()>& what) {
        std::promise<void> done;
        loop_->loop().gate()->post([&] {
            what();
            done.set_value();
        });
        done.get_future().get();
    }

    ise::real_environment env_;
    std::unique_ptr<ise::loop_host> loop_ = env_.make_loop("main");
    real_machine machine_;
    std::promise<void> over_;
    pid_t keeper_ = -1;
};

} // namespace

TEST_CASE("a program that its keeper starts only during the takeover can be stopped") {
    adopting_host in("sleep 0.1; ISE_INSTANCE=" + mark + " setsid sleep 100 & wait");
    REQUIRE(in.made);
    REQUIRE(in.made.value()->stamp().pid > 1);
    in.terminate();
    in.wait_for_end();
}

TEST_CASE("a keeper that ends without a program is not adopted") {
    adopting_host in("sleep 0.1");
    CHECK(in.made.error().code() == ise::errc::no_such_name);
    CHECK(WIFEXITED(in.keeper_status()));
}

TEST_CASE("a keeper that does not start its program is killed") {
    adopting_host in("exec sleep 100");
    CHECK(in.made.error().code() == ise::errc::no_such_name);
    CHECK(WTERMSIG(in.keeper_status()) == SIGKILL);
}

} // namespace adopting_test
