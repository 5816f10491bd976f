// The bytes of FORMAT.md: they never change.
#include <ise/packet/codec.hpp>
#include <ise/wire/body.hpp>
#include <ise/wire/frame.hpp>
#include <ise/wire/messages.hpp>

#include <support/catch.hpp>

#include <string>

namespace golden_test {

using namespace ise::wire;

namespace {

std::string hex(ise::bytes_view raw) {
    std::string text;
    for (auto byte : raw) {
        constexpr char digits[] = "0123456789abcdef";
        text += digits[static_cast<unsigned>(byte) >> 4];
        text += digits[static_cast<unsigned>(byte) & 15];
    }
    return text;
}

template <class Body>
std::string frame_hex(frame_type type, std::uint64_t id, const Body& body) {
    ise::buffer out;
    put_frame(out, type, 0, id, [&](ise::buffer& to) { ise::encode(body, to); });
    return hex(out.view());
}

} // namespace

TEST_CASE("golden: header") {
    ise::buffer out;
    frame_header header;
    header.length = 0x01020304;
    header.type = frame_type::piece;
    header.flags = 3;
    header.id = 0x1112131415161718;
    put_header(out, header);
    CHECK(hex(out.view()) == "04030201"
                             "40"
                             "03"
                             "0000"
                             "1817161514131211");
    auto again = read_header(out.data());
    CHECK((again.length == header.length && again.type == header.type && again.flags == 3 && again.id == header.id));
}

TEST_CASE("golden: numbers of the types") {
    CHECK((int(frame_type::hello) == 1 && int(frame_type::welcome) == 2 && int(frame_type::reject) == 3));
    CHECK((int(frame_type::request) == 16 && int(frame_type::reply) == 17 && int(frame_type::error) == 18 &&
           int(frame_type::cancel) == 19));
    CHECK((int(frame_type::introduce) == 20 && int(frame_type::answers) == 21));
    CHECK((int(frame_type::subscribe) == 32 && int(frame_type::subscribed) == 33 && int(frame_type::packet) == 34));
    CHECK((int(frame_type::unsubscribe) == 35 && int(frame_type::unsubscribed) == 36 && int(frame_type::ended) == 37 &&
           int(frame_type::credit) == 38));
    CHECK((int(frame_type::ping) == 48 && int(frame_type::pong) == 49 && int(frame_type::goodbye) == 50));
    CHECK((int(frame_type::piece) == 64 && int(frame_type::schema_request) == 72 && int(frame_type::schema) == 73));
}

TEST_CASE("golden: hello and welcome") {
    hello mine;
    mine.self.path = "ab";
    mine.self.incarnation = 5;
    CHECK(frame_hex(frame_type::hello, 0, mine) == "7600000001000000"
                                                   "0000000000000000"
                                                   "49534531"
                                                   "0100"
                                                   "0100"
                                                   "0700000000000000" // magic, oldest, newest, features
                                                   "02000000"
                                                   "6162"
                                                   "00000000"
                                                   "00000000"
                                                   "0500000000000000"
                                                   "0000000000000000" // self
                                                   "00000000"
                                                   "0000000000000000"
                                                   "0000000000000000" // wanted
                                                   "00001000"
                                                   "0000001000000000"
                                                   "00001000"
                                                   "00000100"
                                                   "00ca9a3b00000000" // accepts
                                                   "00000000"
                                                   "00000000" // authentication
                                                   "0000000000000000"
                                                   "00000000"
                                                   "00000000"); // reply_key, dialled, host_key
    auto body = ise::encode(mine);
    body.resize(body.size() - 16); // of a version without the fields that were appended
    CHECK(ise::wire::read_body<hello>(body).value().self.incarnation == 5);
    welcome theirs;
    CHECK(frame_hex(frame_type::welcome, 0, theirs) == "5200000002000000"
                                                       "0000000000000000"
                                                       "0100"
                                                       "0700000000000000"
                                                       "00000000"
                                                       "00000000"
                                                       "00000000"
                                                       "0000000000000000"
                                                       "0000000000000000"
                                                       "00001000"
                                                       "0000001000000000"
                                                       "00001000"
                                                       "00000100"
                                                       "00ca9a3b00000000"
                                                       "00000000"
                                                       "00000000"
                                                       "0000000000000000"); // clock
}

TEST_CASE("golden: control frames") {
    farewell no{13, "no"};
    CHECK(frame_hex(frame_type::reject, 0, no) == "0700000003000000"
                                                  "0000000000000000"
                                                  "0d"
                                                  "02000000"
                                                  "6e6f");
    introduction result{"helm", {1, 2}};
    CHECK(frame_hex(frame_type::introduce, 3, result) == "1c00000014000000"
                                                         "0300000000000000"
                                                         "04000000"
                                                         "68656c6d"
                                                         "02000000"
                                                         "0100000000000000"
                                                         "0200000000000000");
    call_failure failed{4, 1, "x"};
    CHECK(frame_hex(frame_type::error, 0x100000002, failed) == "0700000012000000"
                                                               "0200000001000000"
                                                               "04"
                                                               "01"
                                                               "01000000"
                                                               "78");
    subscribe wanted;
    wanted.service.service = "p";
    CHECK(frame_hex(frame_type::subscribe, 1, wanted) == "2700000020000000"
                                                         "0100000000000000"
                                                         "01000000"
                                                         "70"
                                                         "00000000"
                                                         "01"
                                                         "40000000"
                                                         "0000000000000000"
                                                         "0000000000000000"
                                                         "01"
                                                         "00000000"
                                                         "00000000");
    subscribed given;
    given.ticket.fill(0xaa);
    given.first_sequence = 9;
    CHECK(frame_hex(frame_type::subscribed, 1, given) == "2900000021000000"
                                                         "0100000000000000"
                                                         "aaaaaaaaaaaaaaaaaaaaaaaaaaaaaaaa"
                                                         "0000000000000000"
                                                         "0900000000000000"
                                                         "00"
                                                         "00000000"
                                                         "00000000");
}

TEST_CASE(
    "a control body of another minor version is read: missing fields take defaults, further ones are passed over") {
    subscribe wanted;
    wanted.service.service = "position";
    wanted.depth = 7;
    auto whole = ise::encode(wanted);
    auto longer = whole;
    longer.insert(longer.end(), 9, std::byte{0xff});
    auto read = read_body<subscribe>(longer);
    REQUIRE(read);
    CHECK(read->depth == 7);

    ise::bytes shorter = ise::encode(wanted.service);
    auto old = read_body<subscribe>(shorter);
    REQUIRE(old);
    CHECK(old->service.service == "position");
    CHECK(old->depth == 64);
    CHECK(old->last_value);

    // Cut inside a field it is malformed; at the edges of fields it is an older one.
    int malformed = 0;
    for (std::size_t length = 0; length < whole.size(); ++length) {
        auto cut = read_body<subscribe>(ise::bytes_view(whole).first(length));
        if (!cut) {
            ++malformed;
            CHECK(cut.error().code() == ise::errc::malformed);
        }
    }
    CHECK(malformed > 20);
}

} // namespace golden_test
