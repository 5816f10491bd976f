// Types as a hostile peer describes them.
#include "fleet.hpp"

namespace schemas_test {

using namespace hostile_test;

TEST_CASE("hostile: a schema of ten million fields, or nested too deep, is refused by the limit's name") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
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

TEST_CASE("hostile: schemas of questions that never get all their answers count (session_bytes)") {
    ise::service_options options;
    options.session_bytes = 1 << 20;
    fleet at(either(), options);
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    auto large = [](std::uint64_t number) { // little text for much memory
        auto text = "struct{f" + std::to_string(number) + ":enum:u16{";
        for (int i = 0; i < 2000; ++i) text += "a" + std::to_string(i) + "=" + std::to_string(i) + ",";
        text.back() = '}';
        return ise::schema::parse(text + "}").value();
    };
    constexpr std::uint64_t questions = 12;
    for (std::uint64_t id = 1; id <= questions; ++id) {
        std::vector<ise::schema> types;
        ise::wire::subscribe terms;
        terms.service.service = pictures.name();
        for (std::uint64_t place = 0; place < 4; ++place) {
            types.push_back(large(4 * id + place));
            terms.service.fingerprints.push_back(types.back().fingerprint());
        }
        terms.service.fingerprints.push_back(4711 + id); // never answered
        peer.say(frame_type::subscribe, id, terms);
        for (const auto& one : types) {
            ise::wire::schema_answer answer;
            answer.fingerprint = one.fingerprint();
            answer.text = one.text();
            peer.say(frame_type::schema, 0, answer);
            peer.finish();
        }
        at.all.world.run_for(10ms);
    }
    REQUIRE(at.all.run_until([&] { return peer.count(frame_type::ended) >= questions - 4; }));
    CHECK(peer.count(frame_type::ended) < questions);
    CHECK(peer.why(frame_type::ended).code() == errc::overloaded);
    CHECK_THAT(peer.why(frame_type::ended).message(), Contains("1048576 are allowed (session_bytes)"));
    CHECK(at.of_raw());
    at.others_do_not_notice();
}

} // namespace schemas_test
