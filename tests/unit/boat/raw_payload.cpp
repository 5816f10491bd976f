#include <components/boat/raw_payload.hpp>
#include <components/boat/telecommand.hpp>

#include <support/catch.hpp>

namespace raw_payload_test {

using namespace atirma;
using namespace std::chrono_literals;

TEST_CASE("raw telecommand: text and hexadecimal become bytes and back, and everything else is refused") {
    auto bytes = [](std::string_view text) { return payload_bytes(text).value(); };
    CHECK(bytes("AT") == ise::bytes{std::byte{0x41}, std::byte{0x54}});
    CHECK(bytes("hex:0A fF 1b") == ise::bytes{std::byte{0x0A}, std::byte{0xFF}, std::byte{0x1B}});
    CHECK(payload_text(bytes("AT")) == "AT");
    CHECK(payload_text(bytes("hex:0aff")) == "hex:0AFF");
    CHECK(payload_text(bytes("hex:68 65 78 3a")) == "hex:6865783A"); // the text "hex:" itself
    for (int value = 0; value < 256; ++value) {
        ise::bytes one{static_cast<std::byte>(value), std::byte{'a'}};
        CHECK(bytes(payload_text(one)) == one);
    }
    auto refusal = [](std::string_view text) { return payload_bytes(text).error().message(); };
    CHECK(refusal("").find("payload is empty") == 0);
    CHECK(refusal("hex:").find("payload is empty") == 0);
    CHECK(refusal("hex:0") == "payload: the last byte has one hexadecimal digit only");
    CHECK(refusal("hex:0G") == "payload: 'G' is no hexadecimal digit");
    CHECK(refusal(std::string(65, 'x')) == "payload is 65 bytes; 64 fit a frame");
    CHECK(payload_bytes(std::string(64, 'x')));
}

TEST_CASE("raw telecommand: its bytes travel in one frame, and a longer one is malformed") {
    telecommand sent;
    sent.id = 7;
    sent.sent_at = utc_time(1'500'000'000'000ms);
    sent.valid_for = 60s;
    sent.authority = 3;
    sent.command = commands::raw{"hex:" + std::string(128, '7')};
    auto raw = encode_telecommand(sent);
    CHECK(raw.size() == 24 + 1 + max_raw_bytes);
    CHECK(raw.size() <= 94); // what is sealed fits, too
    auto back = parse_telecommand(raw);
    REQUIRE(back);
    CHECK(back->command == boat_command(commands::raw{std::string(64, 'w')})); // 0x77
    sent.command = commands::raw{"hex:00FF"};
    CHECK(parse_telecommand(encode_telecommand(sent))->command == sent.command);
    CHECK_FALSE(sent.command.danger().empty());
    CHECK(traits_of(command_kind::raw).needs_authority);
    CHECK(check(boat_command(commands::raw{"x"})));
    CHECK_FALSE(check(boat_command(commands::raw())));
}

} // namespace raw_payload_test
