#include <ise/component/node.hpp>
#include <ise/core/real/environment.hpp>
#include <ise/name_server/name_server.hpp>
#include <ise/service/service_host.hpp>

#include <support/catch.hpp>

#include <future>

namespace real_sockets_test {

namespace {

using namespace std::chrono_literals;

struct number {
    std::int64_t value = 0;
};

inline constexpr ise::request_response<number, number> twice{"twice"};

class doubler final : public ise::component {
    ise::task<> run() override {
        provide(twice, [](number rq) {
            number answer{rq.value * 2};
            return answer;
        });
        co_return;
    }
};

ise::node_options quiet() {
    ise::node_options options;
    options.log = std::getenv("ISE_TEST_LOG") ? ise::log_to_stderr(ise::log_level::debug)
                                              : ise::log_sink([](const ise::log_record&) {});
    return options;
}

std::unique_ptr<ise::node> start_server(ise::environment& env, ise::endpoint& at) {
    auto options = quiet();
    options.use_names = false;
    auto made = std::make_unique<ise::node>(env, std::move(options));
    ise::component_options where;
    where.listen = {at};
    where.registers = false;
    ise::name_server_options terms;
    terms.fresh = at.port == 0;
    at = made->start<ise::name_server>(std::string(ise::naming::server_path), where, terms)
             .services()
             .listening()
             .front();
    return made;
}

// What a console of `node` gets from the component at `path`.
std::int64_t ask(ise::node& node, const std::string& path, std::int64_t value) {
    std::promise<std::int64_t> done;
    auto answer = done.get_future();
    node.start("", [&](ise::component& self) -> ise::task<> {
        try {
            auto provider = co_await self.find(path, 60s);
            number request{value};
            auto got = co_await provider.call(twice, request, 60s);
            done.set_value(got.value);
        } catch (...) {
            done.set_exception(std::current_exception());
        }
    });
    return answer.get();
}

// A name server on real sockets, and what nodes need to find it.
struct with_server {
    ise::real_environment env;
    ise::endpoint at = ise::endpoint::parse("tcp://127.0.0.1:0").value();
    std::unique_ptr<ise::node> server = start_server(env, at);
    ise::node_options names = [this] {
        auto options = quiet();
        options.name_servers = {at};
        return options;
    }();
};

} // namespace

TEST_CASE("naming: over real sockets a component is found by its path, also after the server was restarted") {
    with_server on;
    ise::node provider(on.env, on.names);
    provider.start<doubler>("atirma/doubler");
    ise::node asking(on.env, on.names);
    CHECK(ask(asking, "atirma/doubler", 21) == 42);

    on.server.reset();
    on.server = start_server(on.env, on.at);
    ise::node newcomer(on.env, on.names); // knows nobody from before
    CHECK(ask(newcomer, "atirma/doubler", 4) == 8);
}

TEST_CASE("naming: a path that another node holds stops the second component with the holder's name") {
    with_server on;
    ise::node first(on.env, on.names);
    first.start<doubler>("atirma/doubler");
    CHECK(ask(first, "atirma/doubler", 1) == 2);
    ise::node second(on.env, on.names);
    second.start<doubler>("atirma/doubler");
    second.wait(); // it ends by itself
    REQUIRE(second.reports().size() == 1);
    CAPTURE(second.reports()[0].failure);
    CHECK(second.reports()[0].failure.find("'atirma/doubler' is held by process " +
                                           std::to_string(on.env.identity().process_id)) != std::string::npos);
}

TEST_CASE("naming: a node that ends withdraws its names") {
    with_server on;
    auto first = std::make_unique<ise::node>(on.env, on.names);
    first->start<doubler>("atirma/doubler");
    CHECK(ask(*first, "atirma/doubler", 1) == 2);
    first.reset();
    ise::node second(on.env, on.names);
    second.start<doubler>("atirma/doubler");
    CHECK(ask(second, "atirma/doubler", 2) == 4);
}

TEST_CASE("naming: a node that has ended left no name behind") {
    with_server on;
    ise::node asking(on.env, on.names);
    {
        ise::node crowd(on.env, on.names);
        for (int i = 0; i < 300; ++i) {
            ise::component_options how;
            if (i != 0) how.together_with = "a/0";
            crowd.start<doubler>("a/" + std::to_string(i), std::move(how));
        }
        CHECK(ask(asking, "a/299", 21) == 42);
    }
    std::promise<std::size_t> left;
    asking.start("", [&](ise::component& self) -> ise::task<> {
        ise::naming::list_request all;
        all.prefix = "a";
        auto names = self.at(on.at);
        auto page = co_await names.try_call(ise::naming::list, all, 60s);
        left.set_value(page ? page->names.size() : 9999);
    });
    CHECK(left.get_future().get() == 0);
}

} // namespace real_sockets_test
