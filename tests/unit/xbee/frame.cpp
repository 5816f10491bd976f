#include <components/xbee/decoder.hpp>
#include <components/xbee/frame.hpp>

#include <support/catch.hpp>
#include <support/shared_data.hpp>

#include "hex.hpp"

#include <nlohmann/json.hpp>

#include <algorithm>
#include <fstream>
#include <map>

namespace frame_test {

using namespace atirma::xbee;

namespace {

const frame* accepted(const parsed_frame& p) { return std::get_if<frame>(&p); }

refusal reason(const std::string& wire, api_mode mode) {
    auto parsed = parse_frame(hex(wire), mode);
    auto* no = std::get_if<refused>(&parsed);
    REQUIRE(no != nullptr);
    CHECK_FALSE(no->message.empty());
    return no->reason;
}

template <class T>
T as(const std::string& wire, api_mode mode) {
    auto parsed = parse_frame(hex(wire), mode);
    REQUIRE(accepted(parsed));
    REQUIRE(std::holds_alternative<T>(*accepted(parsed)));
    return std::get<T>(*accepted(parsed));
}

std::vector<parsed_frame> drain(frame_decoder& decoder) {
    std::vector<parsed_frame> all;
    while (auto one = decoder.next()) all.push_back(std::move(*one));
    return all;
}

std::vector<frame> only_frames(const std::vector<parsed_frame>& all) {
    std::vector<frame> frames;
    for (auto& p : all)
        if (auto* f = accepted(p)) frames.push_back(*f);
    return frames;
}

std::vector<frame> samples() {
    return {at_request{1, at("PL"), hex("04"), false},
            at_request{0x7E, at("NI"), {}, true},
            at_response{0x11, at("TP"), at_status::ok, hex("FFF6")},
            at_response{2, at("ZZ"), at_status::bad_command, {}},
            transmit_request{0x7D, 0x0013A20040522BAA, unknown_network, 0, 0x10, hex("7E7D1113 00FF")},
            transmit_status{0x13, 0x7D84, 3, delivery::no_ack, 0},
            received_packet{0x0013A20040522BAA, unknown_network, 2, hex("7E")},
            remote_at_request{9, broadcast_address, unknown_network, 2, at("DB"), {}},
            remote_at_response{9, 0x0013A20040522BAA, unknown_network, at("DB"), at_status::ok, hex("7D")},
            modem_status{0},
            raw_frame{0xFE, hex("117E")},
            raw_frame{0x55, {}}};
}

} // namespace

TEST_CASE("the published frames parse or are refused as their source says") {
    auto file = ise_test::shared_data("xbee_api_frames.json");
    if (!file) {
        WARN("xbee_api_frames.json is not there (ISE_SHARED_DATA): nothing compared");
        return;
    }
    std::ifstream in(*file);
    auto json = nlohmann::json::parse(in);
    CHECK(json["vectors"].size() == 98);
    for (auto& vector : json["vectors"]) {
        auto text = vector["hex"].get<std::string>();
        auto modes = vector["valid_in_api_modes"].get<std::vector<int>>();
        for (int mode : {1, 2}) {
            CAPTURE(text, mode, vector["meaning"].get<std::string>());
            auto parsed = parse_frame(hex(text), static_cast<api_mode>(mode));
            bool wanted = std::find(modes.begin(), modes.end(), mode) != modes.end();
            CHECK((accepted(parsed) != nullptr) == wanted);
            if (wanted)
                CHECK(type_of(*accepted(parsed)) == std::stoul(vector["frame_type"].get<std::string>(), nullptr, 16));
            frame_decoder decoder(static_cast<api_mode>(mode)); // the stream decoder sees the same
            for (std::byte b : hex(text)) decoder.push({&b, 1});
            CHECK(only_frames(drain(decoder)).size() == (wanted ? 1u : 0u));
        }
    }
}

TEST_CASE("every frame that is encoded parses back, in both API modes") {
    for (auto mode : {api_mode::plain, api_mode::escaped})
        for (auto& f : samples()) {
            auto parsed = parse_frame(encode(f, mode), mode);
            REQUIRE(accepted(parsed));
            CHECK(*accepted(parsed) == f);
        }
}

TEST_CASE("the 868's commands have the bytes that are published") {
    CHECK(encode(at_request{0x52, at("TR"), {}, false}, api_mode::plain) == hex("7E000408525452FF"));
    CHECK(encode(at_request{0x52, at("TP"), {}, false}, api_mode::escaped) == hex("7E00040852545001"));
    CHECK(encode(at_request{0x52, at("PL"), hex("04"), false}, api_mode::plain) == hex("7E00050852504C0405"));
}

TEST_CASE("fields stand where the layout says") {
    auto sent = as<transmit_request>("7e001610010013a200400a0127fffe0000547844617461304113", api_mode::plain);
    CHECK(sent.destination == 0x0013A200400A0127);
    CHECK(sent.network == 0xFFFE);
    CHECK(ise::as_text(sent.payload) == "TxData0A");
    auto status = as<transmit_status>("7e00078b7d5e2a6a00000062", api_mode::escaped);
    CHECK(status.frame_id == 0x7E);
    CHECK(status.network == 0x2A6A);
    auto answer = as<remote_at_response>("7e001397550013a20040522baa7d84534c0040522baaf0", api_mode::plain);
    CHECK(answer.network == 0x7D84);
    CHECK(text(answer.command) == "SL");
    CHECK(answer.value == hex("40522baa"));
    CHECK(as<at_response>("7e000688554d5400037d5e", api_mode::escaped).value == hex("03"));
}

TEST_CASE("AP=2 escapes the length bytes and the checksum too") {
    frame long_one = raw_frame{0x01, ise::bytes(0x10, std::byte{0})}; // length 0x11
    auto wire = encode(long_one, api_mode::escaped);
    CHECK(wire[2] == std::byte{0x7D});
    CHECK(wire[3] == std::byte{0x31});
    auto parsed = parse_frame(wire, api_mode::escaped);
    REQUIRE(accepted(parsed));
    CHECK(*accepted(parsed) == long_one);
    CHECK(std::get<refused>(parse_frame(wire, api_mode::plain)).reason == refusal::truncated); // reads a length of 007D
}

TEST_CASE("a refusal names its reason") {
    CHECK(reason("", api_mode::plain) == refusal::truncated);
    CHECK(reason("7E", api_mode::plain) == refusal::truncated);
    CHECK(reason("7E0006", api_mode::escaped) == refusal::truncated);
    CHECK(reason("7E7D", api_mode::escaped) == refusal::truncated);
    CHECK(reason("000408", api_mode::plain) == refusal::no_delimiter);
    CHECK(reason("7E0000FF", api_mode::plain) == refusal::bad_length);
    CHECK(reason("7EFFFF08", api_mode::plain) == refusal::bad_length);
    CHECK(reason("7e000608014e494154cb", api_mode::plain) == refusal::bad_checksum);
    CHECK(reason("7e00078b017d8400000171", api_mode::escaped) == refusal::bad_escape);
    CHECK(reason("7e00078b622a6a0000007e", api_mode::escaped) == refusal::unexpected_delimiter);
    CHECK(reason("7e00078b7d7e2a6a00000062", api_mode::escaped) == refusal::unexpected_delimiter);
    CHECK(reason("7e000408525452FF00", api_mode::plain) == refusal::trailing_bytes);
}

TEST_CASE("a known type without its fixed fields is refused, whatever its checksum") {
    for (auto& f : samples()) {
        if (std::holds_alternative<raw_frame>(f)) continue;
        auto data = frame_data(f);
        std::size_t least = 0;
        for (std::size_t n = 1; n <= data.size(); ++n)
            if (auto parsed = parse_frame_data(ise::bytes_view(data).first(n)); accepted(parsed) && least == 0)
                least = n;
        static const std::map<int, std::size_t> sizes{{0x08, 4},  {0x09, 4},  {0x88, 5},  {0x10, 14}, {0x8B, 7},
                                                      {0x90, 12}, {0x17, 15}, {0x97, 15}, {0x8A, 2}};
        CHECK(least == sizes.at(type_of(f)));
    }
    CHECK(reason("7E000108F7", api_mode::plain) == refusal::too_short_for_type);
}

TEST_CASE("the decoder gives the same frames however the bytes are cut") {
    for (auto mode : {api_mode::plain, api_mode::escaped}) {
        ise::bytes stream;
        for (auto& f : samples()) {
            auto wire = encode(f, mode);
            stream.insert(stream.end(), wire.begin(), wire.end());
        }
        for (std::size_t piece : {1u, 2u, 3u, 7u, 1000u}) {
            frame_decoder decoder(mode);
            std::vector<frame> got;
            for (std::size_t at = 0; at < stream.size(); at += piece) {
                decoder.push(ise::bytes_view(stream).subspan(at, std::min(piece, stream.size() - at)));
                for (auto& f : only_frames(drain(decoder))) got.push_back(f);
            }
            CHECK(got == samples());
            CHECK(decoder.skipped_bytes() == 0);
            CHECK_FALSE(decoder.in_frame());
        }
    }
}

TEST_CASE("a true frame behind garbage and false delimiters is found") {
    frame wanted = at_response{1, at("DB"), at_status::ok, hex("47")};
    for (auto mode : {api_mode::plain, api_mode::escaped})
        for (std::string garbage : {"00FF", "7E", "7E7E", "7E0003AA", "7E000508", "7E0000", "7EFFFF"}) {
            CAPTURE(garbage, static_cast<int>(mode));
            frame_decoder decoder(mode);
            decoder.push(hex(garbage));
            decoder.push(encode(wanted, mode));
            auto found = only_frames(drain(decoder));
            decoder.give_up(); // a false length may still be waiting for its bytes
            for (auto& f : only_frames(drain(decoder))) found.push_back(f);
            CHECK(found == std::vector<frame>{wanted});
        }
}

TEST_CASE("a frame cut by silence is refused and what follows is heard") {
    frame_decoder decoder(api_mode::plain);
    auto wire = encode(modem_status{0}, api_mode::plain);
    decoder.push(hex("7E0100 0102"));
    decoder.push(wire);
    CHECK_FALSE(decoder.next());
    CHECK(decoder.in_frame());
    decoder.give_up();
    auto all = drain(decoder);
    REQUIRE(all.size() == 2);
    CHECK(std::get<refused>(all[0]).reason == refusal::truncated);
    CHECK(std::get<frame>(all[1]) == frame(modem_status{0}));
}

} // namespace frame_test
