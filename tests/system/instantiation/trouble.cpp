// A program for an instantiation server to have trouble with: what it does wrong is asked for by parameters and calls.
#include <ise/component/component_type.hpp>

#include <cerrno>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <sys/wait.h>
#include <unistd.h>

namespace {

using namespace std::chrono_literals;

struct trouble_options {
    double answer = 7;
    int children = 0;
    bool silent = false;
    bool stuck = false;
    std::string say;
    std::string meets, other;
    std::string failing;
    std::string file, outlet, page;
    std::uint16_t page_port = 0;
    std::vector<std::string> words;
};

struct question {};
struct answered {
    double answer = 0;
    std::string variable;
};
struct say_request {
    std::string text;
    std::uint32_t times = 1;
};
struct escaped {
    std::int32_t pid = 0;
};
struct eat_request {
    std::uint32_t mebibytes = 0;
};
struct exit_request {
    std::int32_t code = 0;
};

inline constexpr ise::request_response<question, answered> ask{"ask"};
inline constexpr ise::request_response<say_request, ise::nothing> say{"say"};
/// It does not hear SIGTERM any more; to be called when the program has put its handler in, which it tells by
/// "started".
inline constexpr ise::request_response<question, ise::nothing> deafen{"deafen"};
inline constexpr ise::request_response<exit_request, ise::nothing> leave{"leave"};
/// A process that left its group, its session and its environment, and whose parent has gone.
inline constexpr ise::request_response<question, escaped> escape{"escape"};
/// Processes that start processes, without end.
inline constexpr ise::request_response<question, ise::nothing> bomb{"bomb"};
inline constexpr ise::request_response<eat_request, ise::nothing> eat{"eat"};
/// It prints what is asked for, and crashes before anything is flushed.
inline constexpr ise::request_response<say_request, ise::nothing> crash{"crash"};
/// It fails by an exception soon after.
inline constexpr ise::request_response<say_request, ise::nothing> fail{"fail"};

// Runs until it is ended; SIGTERM does not do it.
[[noreturn]] void stay() {
    ::signal(SIGTERM, SIG_IGN);
    for (;;) ::pause();
}

std::int32_t start_escaped() {
    int ends[2] = {-1, -1};
    if (::pipe(ends) != 0) return 0;
    auto child = ::fork();
    if (child == 0) {
        ::setsid();
        auto grandchild = ::fork();
        if (grandchild == 0) {
            char sleep[] = "/bin/sleep", length[] = "1000";
            char* words[] = {sleep, length, nullptr};
            char* nothing[] = {nullptr};
            ::execve(sleep, words, nothing);
            ::_exit(1);
        }
        [[maybe_unused]] auto result = ::write(ends[1], &grandchild, sizeof grandchild);
        ::_exit(0);
    }
    pid_t escaped_pid = 0;
    [[maybe_unused]] auto got = ::read(ends[0], &escaped_pid, sizeof escaped_pid);
    ::waitpid(child, nullptr, 0);
    ::close(ends[0]);
    ::close(ends[1]);
    return escaped_pid;
}

class trouble final : public ise::component {
public:
    explicit trouble(trouble_options options) : options_(std::move(options)) { announce_when_ready(); }

    void change(const trouble_options& now) {
        if (now.answer == 9) throw ise::error(ise::errc::refused, "nine is no answer");
        options_.answer = now.answer;
    }

private:
    ise::task<> run() override {
        if (!options_.say.empty()) print(options_.say);
        if (!options_.meets.empty()) {
            if (auto* made = std::fopen(options_.meets.c_str(), "w")) std::fclose(made);
            while (::access(options_.other.c_str(), F_OK) != 0) co_await sleep(10ms);
            ::unlink(options_.other.c_str()); // of each the other's: nothing is left behind
        }
        if (!options_.failing.empty()) throw ise::error(ise::errc::io_failed, options_.failing);
        for (int child = 0; child < options_.children; ++child)
            if (::fork() == 0) {
                if (child % 2 == 1) ::setsid(); // out of the group
                stay();
            }
        provide(ask, [this](question) {
            return answered{options_.answer, env().variable("TROUBLE_FLAG").value_or("")};
        });
        provide(say, [](say_request rq) {
            for (std::uint32_t line = 0; line < rq.times; ++line) print(rq.text);
            return ise::nothing();
        });
        provide(deafen, [](question) {
            ::signal(SIGTERM, SIG_IGN);
            return ise::nothing();
        });
        provide(escape, [](question) { return escaped{start_escaped()}; });
        provide(bomb, [](question) {
            if (::fork() == 0) {
                ::setsid();
                for (;;) ::fork();
            }
            return ise::nothing();
        });
        provide(eat, [this](eat_request rq) {
            eaten_.assign(std::size_t{rq.mebibytes} << 20, 'x');
            return ise::nothing();
        });
        provide(crash, [](say_request rq) -> ise::nothing {
            std::puts(rq.text.c_str());
            std::abort();
        });
        provide(leave, [](exit_request rq) -> ise::nothing { ::_exit(rq.code); });
        provide(fail, [this](say_request rq) {
            spawn("failing", give_up(rq.text));
            return ise::nothing();
        });
        if (options_.silent) co_return;
        co_await ready();
        struct leaving { // a thread that does not come back
            bool stuck;
            ~leaving() {
                while (stuck) ::pause();
            }
        } guard{options_.stuck};
        co_await sleep_till(ise::time_point::max());
    }
    ise::task<> give_up(std::string why) {
        co_await sleep(1ms); // the answer goes first
        throw ise::error(ise::errc::io_failed, why);
    }
    static void print(const std::string& text) {
        std::puts(text.c_str());
        std::fflush(stdout);
    }

    trouble_options options_;
    std::string eaten_;
};

std::vector<ise::component_type> types() {
    ise::component_type type("trouble", "what can go wrong", "sea/trouble");
    auto options = std::make_shared<trouble_options>();
    type.parameters.add("answer", options->answer, "what it answers").range(0, 10).unit("m").changeable();
    type.parameters.add("children", options->children, "processes that it starts and forgets").range(0, 8);
    type.parameters.add("silent", options->silent, "never becomes ready");
    type.parameters.add("stuck", options->stuck, "does not end when it is stopped");
    type.parameters.add("meets", options->meets, "a file that it makes, and is ready only when there is the other")
        .kind(ise::parameter_kind::path);
    type.parameters.add("other", options->other, "that file").kind(ise::parameter_kind::path);
    type.parameters.add("say", options->say, "printed at the start");
    type.parameters.add("failing", options->failing, "why it fails before it is ready");
    type.parameters.add("file", options->file, "a file").kind(ise::parameter_kind::path);
    type.parameters.add("word", options->words, "words");
    type.parameters.add("outlet", options->outlet, "where it would listen").kind(ise::parameter_kind::endpoint);
    type.parameters.add("page", options->page, "where it would show a page").kind(ise::parameter_kind::address);
    type.parameters.add("page-port", options->page_port, "at that address").port_at("page");
    type.provides(ask).provides(say).provides(leave).reads("TROUBLE_FLAG");
    type.makes<trouble>(options);
    std::vector<ise::component_type> made;
    made.push_back(std::move(type));
    return made;
}

} // namespace

int main(int count, char** words) { return ise::main(count, words, types, "1"); }
