// A virtual world with a node on each host that is asked for, and what its components may say to each other.
#pragma once
#include <ise/component/node.hpp>
#include <ise/sim/world.hpp>

#include <support/catch.hpp>

#include <map>
#include <mutex>
#include <set>
#include <string>
#include <vector>

namespace sea {

using namespace std::chrono_literals;
using ise::task;

struct question {
    std::string text;
};
struct reply {
    std::string text;
};
struct reading {
    std::uint64_t number = 0;
};

inline constexpr ise::request_response<question, reply> echo{"echo"};
inline constexpr ise::request_response<question, reply> ask_back{"ask_back"};
inline constexpr ise::subscription<reading> readings{"readings"};

/// Keeps every record as a line; thread-safe, and a copy shares its lines.
class log_book {
public:
    ise::log_sink sink() const {
        return [kept = kept_](const ise::log_record& record) {
            std::lock_guard lock(kept->mutex);
            kept->lines.push_back(ise::format_line(record));
        };
    }
    bool has(const std::string& a, const std::string& b = {}) const {
        std::lock_guard lock(kept_->mutex);
        for (const auto& line : kept_->lines)
            if (line.find(a) != std::string::npos && line.find(b) != std::string::npos) return true;
        return false;
    }

    std::size_t count(const std::string& text) const {
        std::lock_guard lock(kept_->mutex);
        std::size_t found = 0;
        for (const auto& line : kept_->lines) found += line.find(text) != std::string::npos;
        return found;
    }

private:
    struct lines {
        std::mutex mutex;
        std::vector<std::string> lines;
    };
    std::shared_ptr<lines> kept_ = std::make_shared<lines>();
};

/// Counts coroutines (or other things) that live.
struct census {
    int alive = 0;
    struct citizen {
        census* of;
        explicit citizen(census& in) : of(&in) { ++of->alive; }
        ~citizen() { --of->alive; }
        citizen(const citizen&) = delete;
        citizen& operator=(const citizen&) = delete;
    };
};

class fleet {
public:
    explicit fleet(std::uint64_t seed = 1) : world(seed) {}

    ise::sim::world world;
    log_book log;
    ise::duration grace = 2s;

    ise::node& node(const std::string& host) {
        auto& found = nodes_[host];
        if (!found) {
            ise::node_options options;
            options.name = host;
            options.use_names = false;
            options.grace = grace;
            options.log = log.sink();
            found = std::make_unique<ise::node>(process(host), options);
        }
        return *found;
    }
    ise::sim::process& process(const std::string& host) {
        auto& found = processes_[host];
        if (!found) found = &world.host(host).start_process("program");
        return *found;
    }
    void drop(const std::string& host) { nodes_.erase(host); }

    static ise::endpoint at(const std::string& host, int port = 7000) {
        return ise::endpoint::parse("tcp://" + host + ":" + std::to_string(port)).value();
    }
    ise::component_options listening(const std::string& host, int port = 7000) {
        node(host);
        ise::component_options options;
        options.listen = {at(host, port)};
        return options;
    }
    ise::component& start(const std::string& host, const std::string& path, std::function<task<>(ise::component&)> body,
                          int port = 7000) {
        return node(host).start(path, std::move(body), listening(host, port));
    }

    /// Runs a coroutine as an anonymous component until it has ended, and throws what it throws.
    void run(const std::string& host, std::function<task<>(ise::component&)> body) {
        struct outcome {
            bool over = false;
            std::exception_ptr thrown;
        };
        auto result = std::make_shared<outcome>();
        ise::component_options quiet;
        quiet.listens = false;
        auto wrapped = [result, body = std::move(body)](ise::component& self) -> task<> {
            try {
                co_await body(self);
            } catch (...) {
                result->thrown = std::current_exception();
            }
            result->over = true;
        };
        node(host).start("", wrapped, quiet);
        bool over = world.run_until([&] { return result->over; }, 1h);
        REQUIRE(over);
        if (result->thrown) std::rethrow_exception(result->thrown);
    }

    bool stop(const std::string& host) {
        node(host).stop();
        return world.run_until([&] { return node(host).all_stopped(); }, 1min);
    }
    ise::stop_report report(const std::string& host, const std::string& path) {
        for (const auto& report : node(host).reports())
            if (report.path == path) return report;
        FAIL("no report of " << path);
        return {};
    }
    ise::component_state state(const std::string& host, const std::string& path) {
        for (const auto& each : node(host).components())
            if (each.path == path) return each.state;
        FAIL("no component " << path);
        return {};
    }

private:
    std::map<std::string, ise::sim::process*> processes_;
    std::map<std::string, std::unique_ptr<ise::node>> nodes_;
};

/// Answers what it is asked, and publishes a reading every second.
class beacon : public ise::component {
protected:
    task<> run() override {
        provide(echo, [](question asked) { return reply{asked.text}; });
        publish_every(readings, 1s, [this] { return reading{++number_}; });
        co_return;
    }

private:
    std::uint64_t number_ = 0;
};

template <class F>
ise::errc code_of(F&& act) {
    try {
        act();
    } catch (const ise::error& thrown) {
        return thrown.code();
    }
    return ise::errc{};
}

} // namespace sea
