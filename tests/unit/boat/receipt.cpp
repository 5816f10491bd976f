#include <components/boat/receipt.hpp>
#include <components/boat/telecommand.hpp>

#include <support/catch.hpp>

namespace receipt_test {

using namespace atirma;
using namespace std::chrono_literals;

TEST_CASE("a receipt names packets of one boot, as many as fit, and the next one the rest") {
    const utc_time at(1'504'512'000'000ms);
    std::set<packet_name> all{{7, 10}, {7, 11}, {7, 649}, {7, 650}, {8, 0}, {8, 0xFFFFFFFF}};
    auto left = all;
    std::set<packet_name> result;
    std::vector<std::size_t> sizes;
    while (!left.empty()) {
        auto raw = encode_receipt(at, left);
        CHECK(raw.size() <= max_packet_size);
        CHECK(classify(raw) == packet_class::receipt);
        auto parsed = parse_receipt(raw);
        REQUIRE(parsed);
        CHECK(parsed->sent_at == at);
        sizes.push_back(parsed->packets.size());
        result.insert(parsed->packets.begin(), parsed->packets.end());
    }
    CHECK(result == all);
    CHECK(sizes == std::vector<std::size_t>{3, 1, 1, 1});
}

TEST_CASE("a receipt that is damaged, cut off, too long or another packet is refused") {
    std::set<packet_name> some{{7, 10}, {7, 99}};
    auto good = encode_receipt(utc_time(), some);
    REQUIRE(parse_receipt(good));
    for (std::size_t i = 0; i < good.size(); ++i) {
        auto bad = good;
        bad[i] ^= std::byte{0x10};
        CHECK_FALSE(parse_receipt(bad));
        CHECK_FALSE(parse_receipt(ise::bytes_view(good).first(i)));
    }
    telecommand ping;
    auto other = parse_receipt(encode_telecommand(ping));
    REQUIRE_FALSE(other);
    CHECK(other.error().message().find("type 40 is not a receipt") != std::string::npos);
    CHECK_FALSE(parse_telecommand(good));
}

} // namespace receipt_test
