#include <ise/call/context.hpp>

#include <support/catch.hpp>

#include <asio/any_io_executor.hpp>
#include <asio/dispatch.hpp>
#include <asio/io_context.hpp>
#include <asio/post.hpp>
#include <asio/strand.hpp>

namespace context_test {

TEST_CASE("an executor carries its call's context, and posts like the one it stands for") {
    asio::io_context world;
    ise::call_context context;
    asio::any_io_executor inner = world.get_executor();
    if (GENERATE(false, true)) inner = asio::make_strand(world);
    auto carrying = ise::with_context(inner, &context);
    CHECK(ise::context_of(carrying) == &context);
    CHECK(ise::context_of(inner) == nullptr);
    CHECK(ise::context_of(asio::any_io_executor()) == nullptr);

    std::string order;
    asio::post(carrying, [&] {
        asio::post(carrying, [&] { order += "posted "; });
        asio::dispatch(carrying, [&] { order += "dispatched "; });
        order += "went on ";
    });
    world.run();
    CHECK(order == "dispatched went on posted ");
}

} // namespace context_test
