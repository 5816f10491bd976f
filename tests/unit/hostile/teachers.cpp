// Schemas that nobody asked for, too many of them, too big ones, and questions for schemas.
#include "fleet.hpp"

#include <ise/packet/schema.hpp>

namespace teachers_test {

using namespace hostile_test;

namespace {

struct stranger_mode {
    std::string mode;
    int more = 0;
};

// Calls the service that was introduced first, with a request that has a field of one byte more than the boat's.
void hold_and_more(raw_peer& by) {
    auto body = ise::encode(set_mode{"hold"});
    body.push_back(std::byte{1});
    ise::buffer request;
    request.append(std::uint32_t{0});
    request.append(std::int64_t{3'600'000'000'000});
    request.append(ise::bytes_view(body));
    by.say(frame_type::request, 0, request.view());
}

// Introduces a service with the request of its own schema, and tells that schema when it is asked for.
struct teacher {
    explicit teacher(harbour& of) : at(of), peer(of.all, of.sea, of.channel) { peer.greet(); }
    // With `both` the response is of that schema, too.
    void teach(const std::string& text, bool asked = true, bool both = false) {
        auto fingerprint = ise::schema::parse(text).value().fingerprint();
        peer.introduce(taught++, "helm", {fingerprint, both ? fingerprint : helm.types().fingerprints[1]});
        auto questions = peer.count(frame_type::schema_request);
        if (asked)
            REQUIRE(at.all.world.run_until([&] { return peer.count(frame_type::schema_request) > questions; }, 1s));
        ise::wire::schema_answer answer;
        answer.fingerprint = fingerprint;
        answer.text = text;
        peer.say(frame_type::schema, 0, answer);
        peer.finish();
    }

    harbour& at;
    raw_peer peer;
    std::uint64_t taught = 0;
};

// Takes about 1 MB of the 64 MiB of session_bytes.
std::string fat_schema(int number) {
    std::string made = "struct{mode:string";
    for (int field = 0; field < 4; ++field) {
        made += ",f" + std::to_string(4 * number + field) + ":tuple<i8";
        for (int one = 0; one < 1000; ++one) made += ",i8";
        made += ">";
    }
    return made + "}";
}

} // namespace

// Another text can be made for any fingerprint: the second peer's packets would be read by the first one's text.
TEST_CASE("hostile: a schema that one peer sent is not used for the packets of another") {
    harbour at(either());
    INFO(at.channel);
    const std::string text = "struct{mode:string,more:i8}";
    teacher first(at), second(at);
    first.teach(text);
    second.teach(text); // is asked for it
    for (auto* one : {&first, &second}) {
        hold_and_more(one->peer);
        CHECK(at.all.world.run_until([&] { return one->peer.count(frame_type::reply) == 1; }, 1s));
    }
    first.peer.introduce(1, "helm", {ise::schema::parse(text).value().fingerprint(), helm.types().fingerprints[1]});
    at.all.world.run_for(1s);
    CHECK(first.peer.count(frame_type::schema_request) == 1); // sent it itself
    at.others_do_not_notice();
}

TEST_CASE("hostile: packets that were learnt at run time are not used for those of another peer") {
    ise::schema_cache book;
    const auto invented = ise::schema::parse("struct{mode:string,more:i8}").value();
    const auto& shared = helm.types().schemas[1];
    auto types = book.keep(std::make_shared<const ise::packet_types>(ise::service_kind::request_response,
                                                                     std::vector<ise::schema>{invented, shared}))
                     .value();
    book.add_own(*types);
    CHECK(book.find(invented.fingerprint())); // to answer for it
    CHECK_FALSE(book.find_declared(invented.fingerprint()));
    CHECK_FALSE(book.find_declared(shared.fingerprint()));
    book.add_own(helm.types());
    CHECK(book.find_declared(shared.fingerprint()));
    CHECK_FALSE(book.find_declared(invented.fingerprint()));
}

TEST_CASE("hostile: schemas count for the memory that they take, and a session keeps no more of them than "
          "session_bytes") {
    harbour at(either());
    INFO(at.channel);
    teacher fat(at);
    for (int i = 0; i < 150; ++i) fat.teach(fat_schema(i));
    at.all.world.run_for(1s);
    set_mode asked{"hold"};
    fat.peer.request(0, 149, 1h, asked);
    REQUIRE(at.all.world.run_until([&] { return fat.peer.count(frame_type::error) == 1; }, 1s));
    auto why = fat.peer.why(frame_type::error);
    CHECK(why.code() == errc::overloaded);
    CHECK_THAT(why.message(), Contains("(session_bytes)"));
    CHECK(at.of_raw());
    INFO(at.all_warnings());
    CHECK(at.warned("(session_bytes)"));
    CHECK(at.boat.warnings.size() < 30);
    // What it has in common with the boat costs nothing.
    fat.peer.introduce(150, "helm", helm.types().fingerprints);
    fat.peer.request(1, 150, 1h, asked);
    CHECK(at.all.world.run_until([&] { return fat.peer.count(frame_type::reply) == 1; }, 1s));
    at.others_do_not_notice();
}

TEST_CASE("a schema that stands twice in one service counts once") {
    harbour at(either());
    INFO(at.channel);
    teacher fat(at);
    for (int i = 0; i < 50; ++i) fat.teach(fat_schema(i), true, true);
    set_mode asked{"hold"};
    fat.peer.request(0, 49, 1h, asked);
    REQUIRE(at.all.world.run_until([&] { return fat.peer.count(frame_type::error) == 1; }, 1s));
    CHECK(fat.peer.why(frame_type::error).code() == errc::type_mismatch); // both were looked at
    INFO(at.all_warnings());
    CHECK_FALSE(at.warned("(session_bytes)"));
}

TEST_CASE("hostile: whoever teaches much while another answers does not keep that other from being understood") {
    harbour at(either());
    INFO(at.channel);
    raw_peer older(at.all, at.sea, at.channel);
    older.greet("older");
    const std::string first = "struct{mode:string,seen:i8}", second = "struct{accepted:bool}";
    auto tell = [&](const std::string& text) {
        ise::wire::schema_answer answer;
        answer.fingerprint = ise::schema::parse(text).value().fingerprint();
        answer.text = text;
        older.say(frame_type::schema, 0, answer);
        at.all.world.run_for(1s);
    };
    older.introduce(
        0, "helm", {ise::schema::parse(first).value().fingerprint(), ise::schema::parse(second).value().fingerprint()});
    at.all.world.run_for(1s);
    tell(first);
    teacher busy(at);
    for (int i = 0; i < 4096; ++i) {
        busy.teach("struct{mode:string,more" + std::to_string(i) + ":i8}", false);
        if (i % 100 == 0) older.say(frame_type::ping, 1, ise::bytes_view());
    }
    at.all.world.run_for(1s);
    tell(second);
    hold_and_more(older);
    CHECK(at.all.world.run_until([&] { return older.count(frame_type::reply) == 1; }, 5s));
    at.others_do_not_notice();
}

TEST_CASE("hostile: questions that are never answered are 256 (schema_questions)") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    for (std::uint64_t number = 0; number < 300; ++number)
        peer.introduce(number, "helm", {1000 + number, 2000 + number});
    set_mode any{"any"};
    for (std::uint32_t call = 0; call < 300; ++call) peer.request(call, call, 1h, any);
    peer.finish();
    at.all.world.run_for(1s);
    CHECK(peer.count(frame_type::schema_request) == 256);
    REQUIRE(peer.count(frame_type::error) == 300 - 256);
    CHECK_THAT(peer.why(frame_type::error).message(), Contains("(schema_questions)"));
    INFO(at.all_warnings());
    CHECK(at.warned("(schema_questions)"));
    CHECK(at.of_raw());
    at.others_do_not_notice();
}

TEST_CASE("hostile: nobody is taught what he did not ask for") {
    harbour at(either());
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    const auto& other = ise::schema_of<stranger_mode>();
    ise::wire::schema_answer answer;
    answer.fingerprint = other.fingerprint();
    answer.text = other.text();
    peer.say(frame_type::schema, 0, answer);
    at.all.world.run_for(1s);
    CHECK(at.of_raw());
    // It is asked for all the same.
    peer.introduce(0, "helm", {other.fingerprint(), helm.types().fingerprints[1]});
    at.all.world.run_for(1s);
    CHECK(peer.count(frame_type::schema_request) == 1);
}

TEST_CASE("hostile: a question for schemas is answered once for each, and not without end") {
    harbour at(either());
    INFO(at.channel);
    ise::wire::schema_request asked;
    asked.fingerprints.assign(64, helm.types().fingerprints[0]);
    SECTION("repeated") {
        raw_peer peer(at.all, at.sea, at.channel);
        peer.greet();
        peer.say(frame_type::schema_request, 0, asked);
        at.all.world.run_for(1s);
        CHECK(peer.count(frame_type::schema) == 1);
    }
    SECTION("too many") {
        raw_peer peer(at.all, at.sea, at.channel);
        peer.greet();
        asked.fingerprints.resize(65);
        peer.say(frame_type::schema_request, 0, asked);
        CHECK(at.all.run_until([&] { return peer.closed(); }));
        CHECK(at.warned("asked_schemas"));
    }
    SECTION("without reading the answers") {
        raw_peer peer(at.all, at.sea, at.channel, false);
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
    INFO(at.channel);
    raw_peer peer(at.all, at.sea, at.channel);
    peer.greet();
    peer.introduce(0, "helm", {77, 78});
    set_mode big{std::string(100'000, 'x')};
    for (std::uint64_t call = 0; call < 300; ++call) peer.request(call, 0, 1h, big);
    peer.finish();
    at.all.world.run_for(1s);
    CHECK(peer.count(frame_type::error) == 300 - (16u << 20) / 100'004); // a quarter of session_bytes
    CHECK_THAT(peer.why(frame_type::error).message(), Contains("session_bytes"));
    at.others_do_not_notice();
    CHECK(at.of_raw());
}

} // namespace teachers_test
