// Types as a hostile peer describes them.
#include "harbour.hpp"

#include <ise/packet/schema.hpp>

using namespace hostile_test;

namespace {

struct stranger_mode {
    std::string mode;
    int more = 0;
};

} // namespace

TEST_CASE("hostile: a schema of ten million fields, or nested too deep, is refused by the limit's name") {
    harbour at(either());
    INFO(at.door);
    raw_peer peer(at.all, at.sea, at.door);
    peer.greet();
    std::string text;
    std::string expected;
    bool goes_on = true;
    SECTION("ten million fields") {
        text = "struct{";
        for (int i = 0; i < 10'000'000; ++i) text += "f:i8,";
        text += "z:i8}";
        goes_on = !at.datagrams; // over udp no message is as long as that, and who announces one has broken a rule
        expected = goes_on ? "(max_text_bytes)" : "(max_message_bytes)";
    }
    SECTION("as many as one message holds over udp") {
        text = "struct{";
        for (int i = 0; i < 200'000; ++i) text += "f:i8,";
        text += "z:i8}";
        expected = "(max_text_bytes)";
    }
    SECTION("too many fields in a text of the allowed length") {
        text = "struct{";
        for (int i = 0; i < 9000; ++i) text += "f" + std::to_string(i) + ":i8,";
        text += "z:i8}";
        expected = "at most 1024 are accepted (max_members)";
    }
    SECTION("nested ten thousand deep") {
        for (int i = 0; i < 10'000; ++i) text += "vector<";
        expected = "levels, at most 64 are accepted (max_depth)";
    }
    SECTION("no schema at all") {
        text = "struct{";
        expected = "expected a name";
    }
    peer.introduce(0, "helm", {77, helm.types().fingerprints[1]});
    set_mode asked{"tack"};
    peer.request(0, 0, 1h, asked);
    at.all.world.run_for(1s);
    REQUIRE(peer.count(frame_type::schema_request) == 1);
    ise::wire::schema_answer answer;
    answer.fingerprint = 77;
    answer.text = text;
    auto body = ise::encode(answer);
    if (body.size() < 200'000) {
        peer.say(frame_type::schema, 0, ise::bytes_view(body));
        peer.finish();
    } else { // in pieces, as any message may come
        for (std::size_t sent = 0; sent < body.size() && !peer.closed();) {
            ise::buffer piece;
            if (sent == 0) {
                piece.append(static_cast<std::uint8_t>(frame_type::schema));
                piece.append(std::uint8_t{0});
                piece.append(std::uint64_t{0});
                piece.append(static_cast<std::uint64_t>(body.size()));
            }
            auto count = std::min<std::size_t>(64 * 1024, body.size() - sent);
            piece.append(ise::bytes_view(body).subspan(sent, count));
            sent += count;
            peer.say(frame_type::piece, 1, piece.view(), sent == body.size() ? ise::wire::flag::last : std::uint8_t{0});
            peer.finish();
        }
    }
    CHECK(at.all.world.run_until([&] { return goes_on ? peer.count(frame_type::error) == 1 : peer.closed(); }, 30s));
    INFO(at.all_warnings());
    CHECK(at.warned(expected));
    CHECK((at.of_raw() != nullptr) == goes_on);
    at.others_do_not_notice();
}

TEST_CASE("hostile: nobody is taught what he did not ask for") {
    harbour at(either());
    INFO(at.door);
    raw_peer peer(at.all, at.sea, at.door);
    peer.greet();
    const auto& other = ise::schema_of<stranger_mode>();
    ise::wire::schema_answer answer;
    answer.fingerprint = other.fingerprint();
    answer.text = other.text();
    peer.say(frame_type::schema, 0, answer);
    at.all.world.run_for(1s);
    CHECK(at.of_raw());
    CHECK_FALSE(at.boat.services->schemas().find(other.fingerprint()));
    // Asked, it learns.
    peer.introduce(0, "helm", {other.fingerprint(), helm.types().fingerprints[1]});
    at.all.world.run_for(1s);
    peer.say(frame_type::schema, 0, answer);
    at.all.world.run_for(1s);
    CHECK(at.boat.services->schemas().find(other.fingerprint()));
}

TEST_CASE("hostile: a question for schemas is answered once for each, and not without end") {
    harbour at(either());
    INFO(at.door);
    ise::wire::schema_request asked;
    asked.fingerprints.assign(64, helm.types().fingerprints[0]);
    SECTION("repeated") {
        raw_peer peer(at.all, at.sea, at.door);
        peer.greet();
        peer.say(frame_type::schema_request, 0, asked);
        at.all.world.run_for(1s);
        CHECK(peer.count(frame_type::schema) == 1);
    }
    SECTION("too many") {
        raw_peer peer(at.all, at.sea, at.door);
        peer.greet();
        asked.fingerprints.resize(65);
        peer.say(frame_type::schema_request, 0, asked);
        CHECK(at.all.run_until([&] { return peer.closed(); }));
        CHECK(at.warned("asked_schemas"));
    }
    SECTION("without reading the answers") {
        raw_peer peer(at.all, at.sea, at.door, false);
        peer.greet();
        asked.fingerprints.resize(1);
        for (int i = 0; i < 200'000 && !peer.closed(); ++i) {
            peer.say(frame_type::schema_request, 0, asked);
            if (i % 100 == 0) peer.finish();
        }
        CHECK(at.all.world.run_until([&] { return !at.of_raw(); }, 10s));
        CHECK(at.warned("control_bytes"));
    }
    at.others_do_not_notice();
}

TEST_CASE("hostile: requests that wait for schemas that never come are bounded") {
    harbour at(either());
    INFO(at.door);
    raw_peer peer(at.all, at.sea, at.door);
    peer.greet();
    peer.introduce(0, "helm", {77, 78});
    set_mode big{std::string(100'000, 'x')};
    for (std::uint64_t call = 0; call < 300; ++call) peer.request(call, 0, 1h, big);
    peer.finish();
    at.all.world.run_for(1s);
    CHECK(peer.count(frame_type::error) == 300 - (16u << 20) / 100'004); // held_bytes
    auto why = ise::decode<ise::wire::call_failure>(peer.last(frame_type::error)->body);
    CHECK_THAT(why.reason, Contains("held_bytes"));
    at.others_do_not_notice();
    CHECK(at.of_raw());
}
