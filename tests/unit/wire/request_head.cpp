#include <ise/wire/frame.hpp>
#include <support/catch.hpp>

#include <cstdint>

namespace request_head_test {

using ise::wire::request_head;
namespace flag = ise::wire::flag;

TEST_CASE("the head of a request is read back as it was written, and not where a byte of it is missing") {
    const bool traced = GENERATE(false, true), wide = GENERATE(false, true), numbered = GENERATE(false, true),
               until = GENERATE(false, true);
    request_head head;
    head.service = 7;
    head.time_ns = -3;
    head.until = until;
    if (traced) head.trace = 0x0102030405060708, head.parent = 9;
    if (wide) head.high = 0x1112131415161718;
    if (numbered) head.number = std::uint64_t{1} << 40;
    CHECK(head.flags() == ((traced ? flag::traced : 0) | (traced && wide ? flag::wide : 0) |
                           (numbered ? flag::numbered : 0) | (until ? flag::until : 0)));
    ise::buffer out;
    head.put(out);
    REQUIRE(out.size() == request_head::size(head.flags()));
    out.append(std::uint8_t{0xff}); // the packet

    auto read = request_head::read(head.flags(), out.view());
    REQUIRE(read);
    CHECK(read->service == 7);
    CHECK(read->time_ns == -3);
    CHECK(read->until == until);
    CHECK(read->trace == head.trace);
    CHECK(read->parent == head.parent);
    CHECK(read->high == (traced ? head.high : 0)); // without a trace there is none of it
    CHECK(read->number == head.number);
    for (std::size_t size = 0; size < request_head::size(head.flags()); ++size)
        CHECK_FALSE(request_head::read(head.flags(), out.view().first(size)));
}

} // namespace request_head_test
