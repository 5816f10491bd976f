// A node with components on the real world, and what it shows of itself.
#pragma once
#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/http/stream_http_client.hpp>
#include <ise/service/service_host.hpp>

#include <support/catch.hpp>

#include <future>
#include <mutex>
#include <string>
#include <utility>

namespace observing_test {

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
inline constexpr ise::request_response<question, reply> relay{"relay"};
inline constexpr ise::subscription<reading> readings{"readings"};

/// Keeps log lines.
class log_book {
public:
    ise::log_sink sink() {
        return [this](const ise::log_record& record) {
            std::lock_guard lock(mutex_);
            text_ += ise::format_line(record) + "\n";
        };
    }
    /// The metrics' URL that the log names.
    std::string url() {
        std::lock_guard lock(mutex_);
        auto from = text_.find("url=http://");
        REQUIRE(from != text_.npos);
        from += 4;
        return text_.substr(from, text_.find('\n', from) - from);
    }

private:
    std::mutex mutex_;
    std::string text_;
};

inline ise::node_options without_names() {
    ise::node_options made;
    made.use_names = false;
    made.log = ise::log_sink();
    return made;
}

inline ise::component_options at(const std::string& text) {
    ise::component_options made;
    made.listen.push_back(ise::endpoint::parse(text).value());
    return made;
}

/// Runs `body` as a component of that node until it is over.
template <class Body>
void run_on(ise::node& node, Body body) {
    std::promise<void> over;
    auto done = over.get_future();
    ise::component_options options;
    options.listens = false;
    node.start(
        "",
        [body = std::move(body), &over](ise::component& self) -> task<> {
            try {
                co_await body(self);
                over.set_value();
            } catch (...) {
                over.set_exception(std::current_exception());
            }
        },
        std::move(options));
    done.get();
}

inline std::string get(ise::node& node, std::string url, std::string accept = {}) {
    std::string text;
    run_on(node, [&](ise::component& self) -> task<> {
        ise::stream_http_client client(self.on());
        ise::http_exchange what;
        what.url = url;
        if (!accept.empty()) what.headers.emplace_back("Accept", accept);
        auto asked = client.exchange(std::move(what), 10s);
        auto answer = co_await std::move(asked);
        text = answer.value().body;
        CHECK(answer->status == 200);
        for (const auto& [name, value] : answer->headers)
            if (name == "content-type") text = value + "\n" + text;
    });
    return text;
}

} // namespace observing_test
