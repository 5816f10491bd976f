// A store whose connection ends after it has committed, and before it has answered.
#include "desk.hpp"

namespace unknown_outcome_test {

using namespace node_test;
using namespace std::chrono_literals;
using ise_test::Contains;

namespace {

/// The error that a task ends with.
template <class T>
ise::task<std::optional<ise::failure>> error_of(ise::task<T> of) {
    try {
        (void)co_await std::move(of);
    } catch (const ise::error& why) {
        co_return ise::failure(why.code(), why.what(), why.executed());
    }
    co_return std::nullopt;
}

} // namespace

TEST_CASE("node: of what the store may have committed nobody says that it had no effect") {
    on_a_node([](ise::component& self) -> ise::task<> {
        auto made = std::make_unique<dying_store>();
        auto& store = *made;
        desk it(self, std::move(made));
        authority_request take;
        take.action = authority_action::take;
        store.dies = true;
        auto taking = error_of(it.authority.change(take, "ana"));
        auto unsure = co_await std::move(taking);
        REQUIRE(unsure);
        CHECK(unsure->code() != ise::errc::refused);
        CHECK(unsure->executed() == ise::execution::unknown);
        CHECK(it.announced == 0);
        it.authority.set(store.holder.first, store.holder.second); // as it is read after reconnecting
        CHECK(it.announced == 1);
        it.authority.set(store.holder.first, store.holder.second);
        CHECK(it.announced == 1);
        CHECK(it.authority.now().holder == "ana");

        telecommand_request request;
        request.id = 7;
        request.command = commands::tack_now();
        auto giving = error_of(it.telecommands.command(request, "ana", {}, self.now() + 1s));
        unsure = co_await std::move(giving);
        REQUIRE(unsure);
        CHECK(unsure->code() != ise::errc::refused);
        CHECK(unsure->executed() == ise::execution::unknown);
        CHECK_THAT(unsure->message(), Contains("ask for it again with its id"));
        store.away = true;
        auto asking = error_of(it.telecommands.command(request, "ana", {}, self.now() + 1s));
        unsure = co_await std::move(asking);
        REQUIRE(unsure);
        CHECK(unsure->code() != ise::errc::refused); // the record is out of reach
        store.dies = store.away = false;
        auto again = it.telecommands.command(request, "ana", {}, self.now() + 1s);
        auto reply = co_await std::move(again);
        CHECK(reply.id == 7);
        CHECK(reply.state == telecommand_stage::pending);
    });
}

} // namespace unknown_outcome_test
