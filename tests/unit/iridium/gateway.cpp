#include <components/iridium_gateway/gateway_model.hpp>

#include <support/catch.hpp>

namespace gateway_test {

using namespace atirma;
using namespace std::chrono_literals;

namespace {

constexpr auto imei = "300234010753370";
constexpr ise::time_point start{1h};
constexpr std::chrono::sys_seconds wall{1'700'000'000s};

gateway_model_options account() {
    gateway_model_options options;
    options.imeis = {imei};
    return options;
}

sbd_session_request session_of(std::uint16_t momsn, std::size_t bytes, std::uint16_t received = 0) {
    sbd_session_request request;
    request.imei = imei;
    request.momsn = momsn;
    request.data.assign(bytes, std::byte{1});
    request.received_mtmsn = received;
    return request;
}

iridium::mt_submission submission(std::string data = "00") {
    iridium::mt_submission made;
    made.imei = imei;
    made.username = "atirma";
    made.password = "atirma";
    made.data = std::move(data);
    return made;
}

} // namespace

TEST_CASE("iridium gateway: a delivery that is not taken is repeated after 2, 4, 8 s and on, and given up after twelve "
          "hours") {
    gateway_model model(account());
    REQUIRE(model.session(start, wall, session_of(1, 10)).value().mo_status == 0);
    auto now = start;
    std::vector<ise::duration> pauses;
    while (model.state.mo_given_up == 0) {
        auto due = model.next_delivery(now);
        REQUIRE(due);
        CHECK_FALSE(model.next_delivery(now)); // it is under way
        model.on_delivered(now, due->number, false, "no answer");
        auto next = model.next_event();
        if (next == ise::time_point::max()) break;
        pauses.push_back(next - now);
        now = next;
    }
    CHECK(pauses[0] == 2s);
    CHECK(pauses[1] == 4s);
    CHECK(pauses[2] == 8s);
    CHECK(now - start >= 11h + 30min);
    CHECK(model.state.mo_given_up == 1);
    CHECK(model.state.trouble == "no answer");
}

TEST_CASE("iridium gateway: duplicates are posts that come again although they were taken") {
    gateway_model model(account());
    model.state.duplicates = 1;
    model.session(start, wall, session_of(1, 10)).value();
    auto first = model.next_delivery(start);
    REQUIRE(first);
    model.on_delivered(start, first->number, true, "");
    auto second = model.next_delivery(start + 2s);
    REQUIRE(second);
    CHECK(second->message == first->message);
    model.on_delivered(start + 2s, second->number, true, "");
    CHECK(model.state.mo_waiting == 0);
}

TEST_CASE("iridium gateway: a message for the modem waits until a later session says that it arrived") {
    gateway_model model(account());
    std::string ring;
    CHECK(model.submit(start, submission("aa"), ring).accepted);
    CHECK(ring == imei);
    CHECK(model.submit(start, submission("bb"), ring).accepted);
    auto first = model.session(start, wall, session_of(1, 0)).value();
    CHECK(first.mt_status == 1);
    CHECK(first.data == ise::bytes{std::byte{0xaa}});
    CHECK(first.mt_queued == 1);
    // The answer was lost on the air: it is handed out again.
    CHECK(model.session(start, wall, session_of(1, 0)).value().mtmsn == first.mtmsn);
    auto second = model.session(start, wall, session_of(2, 0, first.mtmsn)).value();
    CHECK(second.data == ise::bytes{std::byte{0xbb}});
    CHECK(second.mt_queued == 0);
    CHECK(model.session(start, wall, session_of(3, 0, second.mtmsn)).value().mt_status == 0);
    CHECK(model.state.mt_delivered == 2);
}

TEST_CASE("iridium gateway: a DirectIP flush without payload empties the queue and queues nothing") {
    gateway_model model(account());
    REQUIRE(model.enqueue(start, imei, ise::bytes(3), false).status == 1);
    REQUIRE(model.enqueue(start, imei, ise::bytes(3), false).status == 2);
    CHECK(model.enqueue(start, imei, {}, false).status == -4); // without the flag
    CHECK(model.state.mt_waiting == 2);
    auto refused = model.state.mt_refused;
    CHECK(model.enqueue(start, imei, {}, true).status == 0);
    CHECK(model.state.mt_refused == refused);
    CHECK(model.state.mt_waiting == 0);
    CHECK(model.session(start, wall, session_of(1, 10)).value().mt_status == 0);
}

TEST_CASE("iridium gateway: submissions are answered with the code that fits") {
    gateway_model model(account());
    std::string ring;
    auto code = [&](auto change) {
        auto what = submission();
        change(what);
        return model.submit(start, what, ring).code;
    };
    CHECK(code([](auto& s) { s.password = "guessed"; }) == 10);
    CHECK(code([](auto& s) { s.imei = "300234010753371"; }) == 11);
    CHECK(code([](auto& s) { s.data = "0g"; }) == 14);
    CHECK(code([](auto& s) { s.data = std::string(542, '0'); }) == 15);
    CHECK(code([](auto& s) { s.data.clear(); }) == 16);
    CHECK(code([](auto& s) { s.data = std::string(540, '0'); }) == 0);
    model.state.fail_mt = 13;
    CHECK(code([](auto&) {}) == 13);
    model.state.fail_mt = 0;
    for (int i = 0; i < 49; ++i) CHECK(code([](auto&) {}) == 0);
    CHECK(code([](auto&) {}) == 99); // fifty wait
    CHECK(code([](auto& s) { s.flush = true; }) == 0);
    CHECK(model.state.mt_waiting == 1);
    // Nobody fetched them for five days.
    model.on_time(start + 24h * 5);
    CHECK(model.state.mt_waiting == 0);
}

TEST_CASE("iridium gateway: it refuses strangers, and nothing works while it is switched off") {
    gateway_model model(account());
    auto stranger = session_of(1, 10);
    stranger.imei = "300234010753371";
    CHECK(model.session(start, wall, stranger).value().mo_status == 15);
    stranger.imei = "none";
    CHECK(model.session(start, wall, stranger).error().code() == ise::errc::refused);
    CHECK(model.session(start, wall, session_of(1, 341)).error().code() == ise::errc::refused);
    model.session(start, wall, session_of(1, 10)).value();
    model.state.up = false;
    CHECK(model.session(start, wall, session_of(2, 10)).error().code() == ise::errc::not_connected);
    CHECK_FALSE(model.next_delivery(start + 1h));
    CHECK(model.enqueue(start, imei, ise::bytes(1), false).status == -6);
    model.state.up = true;
    CHECK(model.next_delivery(start + 1h));
    model.state.session_failures = 1;
    auto failed = model.session(start, wall, session_of(3, 10)).value();
    CHECK(failed.mo_status >= 10);
}

} // namespace gateway_test
