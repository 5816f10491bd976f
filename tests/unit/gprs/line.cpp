#include "packets.hpp"

#include <components/gprs/line_reader.hpp>
#include <components/gprs/number_set.hpp>

#include <support/catch.hpp>

#include <random>
#include <set>

namespace line_test {

using namespace atirma;
using namespace atirma::gprs;

namespace {

std::string text_of(const line& of) {
    auto text = encode(of);
    REQUIRE(text.ends_with("\r\n"));
    text.resize(text.size() - 2);
    return text;
}

std::vector<line> examples() {
    record data;
    data.boot = 17;
    data.number = 4'294'967'295;
    data.unix_s = 1'500'000'000;
    data.history = true;
    data.raw = ise::bytes(max_packet_size, std::byte{0xA5});
    order result;
    result.id = 99;
    result.raw = ise::bytes(3, std::byte{7});
    outcome brief, whole;
    brief.id = whole.id = 99;
    brief.code = 2;
    whole.raw = gprs_test::ack_of(99);
    return {login{"atirma", 17, 3, 9, 0xFEDCBA9876543210},
            login{"x", 0, 1, 0},
            data,
            receipt{17, 8},
            result,
            brief,
            whole,
            challenge{0x0123456789ABCDEF, 1},
            shown_key{0xFFFFFFFFFFFFFFFF}};
}

} // namespace

TEST_CASE("gprs: each kind of line comes back as it went, and none is longer than allowed") {
    for (const auto& of : examples()) {
        auto text = text_of(of);
        INFO(text);
        CHECK(text.size() <= max_line);
        auto back = parse(text);
        REQUIRE(back);
        CHECK(*back == of);
    }
}

TEST_CASE("gprs: lines as they stand in the documents") {
    CHECK(encode(login{"atirma", 7, 12, 40, 0x3f1c09b2a4d85e67}) == "$PATL,atirma,7,12,40,3f1c09b2a4d85e67*11\r\n");
    CHECK(encode(challenge{0x3f1c09b2a4d85e67, 0x90ab12cd34ef5678}) ==
          "$PATN,3f1c09b2a4d85e67,90ab12cd34ef5678*0B\r\n");
    CHECK(encode(shown_key{0x90ab12cd34ef5678}) == "$PATK,90ab12cd34ef5678*24\r\n");
    CHECK(encode(receipt{7, 40}) == "$PATA,7,40*37\r\n");
    auto small = parse("$PATL,atirma,7,12,40,3f1c09b2a4d85e67*11"); // small digits do
    REQUIRE(small);
    CHECK(std::get<login>(*small).last == 40);
}

TEST_CASE("gprs: no changed character goes unnoticed, and none of these is a line") {
    for (const auto& of : examples()) {
        auto text = text_of(of);
        for (std::size_t i = 0; i < text.size(); ++i) {
            auto bad = text;
            bad[i] = bad[i] == 'x' ? 'y' : 'x';
            auto got = parse(bad);
            INFO(bad);
            CHECK_FALSE(got);
        }
        for (std::size_t size = 0; size < text.size(); ++size)
            CHECK_FALSE(parse(std::string_view(text).substr(0, size)));
    }
    auto framed = [](const std::string& content) {
        unsigned sum = 0;
        for (char c : content) sum ^= static_cast<unsigned char>(c);
        char hex[3];
        std::snprintf(hex, sizeof hex, "%02X", sum);
        return "$" + content + "*" + hex;
    };
    REQUIRE(parse(framed("PATA,1,2")));
    for (const auto* content : {"",
                                ",",
                                "PATA",
                                "PATA,1",
                                "PATA,1,",
                                "PATA,1,2,3",
                                "PATA,-1,2",
                                "PATA,1,4294967296",
                                "PATA,65536,2",
                                "PATA,1,2x",
                                "PATA, 1,2",
                                "PATL,,1,1,0,0000000000000000",
                                "PATL,a b,1,1,0,0000000000000000",
                                "PATL,boat,1,0,0,0000000000000000",
                                "PATL,boat,1,5,3,0000000000000000",
                                "PATL,boat,1,1",
                                "PATL,boat,1,1,0",
                                "PATL,boat,1,1,0,0",
                                "PATL,boat,1,1,0,0000000000000000,1",
                                "PATL,boat,1,1,0,000000000000000g",
                                "PATL,boat,1,1,0,-000000000000001",
                                "PATN,0000000000000000",
                                "PATN,0000000000000000,1",
                                "PATK,1",
                                "PATK,0000000000000000,1",
                                "PATL,012345678901234567890123456789012,1,1,0,0000000000000000",
                                "PATD,1,0,0,L,AAAA",
                                "PATD,1,1,0,X,AAAA",
                                "PATD,1,1,0,LH,AAAA",
                                "PATD,1,1,0,L,",
                                "PATD,1,1,0,L,A",
                                "PATD,1,1,0,L,AB==",
                                "PATD,1,1,-5,L,AAAA",
                                "PATD,1,1,9999999999999,L,AAAA",
                                "PATC,1,",
                                "PATC,1,====",
                                "PATR,1,256",
                                "PATR,1",
                                "PATR,1,0,!!!!",
                                "PATX,1",
                                "GPGGA,1,2,3",
                                "PATD,1,1,0,L,AAAA,1,1,1,1,1"}) {
        INFO(content);
        auto got = parse(framed(content));
        REQUIRE_FALSE(got);
        CHECK(got.error().code() == ise::errc::malformed);
        CHECK_FALSE(got.error().message().empty());
    }
    auto too_big = framed("PATD,1,1,0,L," + std::string(140, 'A'));
    CHECK_FALSE(parse(too_big)); // a packet of 105 bytes
    CHECK(parse(std::string(max_line + 1, 'A')).error().code() == ise::errc::too_large);
}

TEST_CASE("gprs: lines are the same in pieces of any size") {
    std::string all;
    for (const auto& of : examples()) all += encode(of) + (all.size() % 2 ? "\r\n" : "");
    for (std::size_t piece = 1; piece <= all.size(); ++piece) {
        line_reader reader;
        std::vector<line> got;
        for (std::size_t at = 0; at < all.size(); at += piece) {
            reader.push(ise::as_bytes(std::string_view(all).substr(at, piece)));
            for (;;) {
                auto one = reader.next();
                if (!one) break;
                got.push_back(one->value());
            }
            REQUIRE(reader.held() <= max_line + piece);
        }
        REQUIRE(got == examples());
        CHECK(reader.held() == 0);
    }
}

TEST_CASE("gprs: a line without end costs a bounded amount of memory, is told once, and what follows is read") {
    line_reader reader;
    int count = 0;
    for (int i = 0; i < 1000; ++i) {
        reader.push(ise::as_bytes(std::string(100, 'z')));
        for (;;) {
            auto one = reader.next();
            if (!one) break;
            REQUIRE_FALSE(*one);
            CHECK(one->error().code() == ise::errc::too_large);
            ++count;
        }
        REQUIRE(reader.held() <= max_line + 101);
    }
    CHECK(count == 1);
    reader.push(ise::as_bytes("zzz\r\n" + encode(receipt{1, 2})));
    auto after = reader.next();
    REQUIRE(after);
    REQUIRE(*after);
    CHECK(std::get<receipt>(**after).number == 2);
}

TEST_CASE("gprs: numbers in any order are one set") {
    std::mt19937 random(4);
    for (int round = 0; round < 200; ++round) {
        number_set set;
        std::set<std::uint32_t> model;
        std::uint32_t skipped = 0;
        for (int i = 0; i < 200; ++i) {
            auto number = static_cast<std::uint32_t>(random() % 60 + 1);
            if (random() % 40 == 0) {
                std::uint64_t missing = 0;
                for (auto n = skipped + 1; n <= number; ++n) missing += model.insert(n).second;
                REQUIRE(set.skip_to(number) == missing);
                skipped = std::max(skipped, number);
            } else if (random() % 10 == 0 && number > skipped) {
                set.remove(number);
                model.erase(number);
            } else {
                REQUIRE(set.contains(number) == model.contains(number));
                REQUIRE(set.add(number));
                model.insert(number);
            }
            std::uint32_t complete = 0;
            while (model.contains(complete + 1)) ++complete;
            REQUIRE(set.complete() == complete);
            REQUIRE(set.highest() == (model.empty() ? 0 : *model.rbegin()));
        }
    }
}

TEST_CASE("gprs: a set with too many holes takes what closes them, and no more") {
    number_set set(4);
    for (std::uint32_t n : {10u, 20u, 30u, 40u}) CHECK(set.add(n));
    CHECK_FALSE(set.add(50));
    CHECK_FALSE(set.contains(50));
    CHECK(set.add(41));
    CHECK(set.add(1)); // the next one always has room
    CHECK(set.add(2));
    CHECK(set.complete() == 2);
    CHECK(set.skip_to(4'294'967'295u) == 4'294'967'295u - 2 - 5);
    CHECK(set.complete() == 4'294'967'295u);
    CHECK(set.contains(50));
}

} // namespace line_test
