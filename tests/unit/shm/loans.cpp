// Large packets that subscribers in other processes read where they were published: both sides of a connection in this
// process, each with mappings of its own.
#include <ise/transport/shm/loaned.hpp>

#include <ise/net/connect.hpp>
#include <ise/net/connection.hpp>
#include <ise/service/dynamic.hpp>
#include <ise/sim/world.hpp>
#include <ise/transport/shm/memory.hpp>

#include <support/catch.hpp>
#include <support/real_parties.hpp>
#include <support/sanitizer.hpp>

#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <map>
#include <numeric>
#include <optional>
#include <string>
#include <thread>
#include <variant>
#include <vector>

#include "system.hpp"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/resource.h>
#include <sys/socket.h>
#include <unistd.h>

namespace shm_loans_test {

namespace {

using namespace std::chrono_literals;
using namespace ise::net::shm;
using namespace shm_test;
using ise_test::party, ise_test::real_parties;

struct picture {
    std::uint32_t number = 0;
    std::string label;
    std::vector<std::uint32_t> pixels;
};
inline constexpr ise::subscription<picture> camera{"camera"};

namespace newer {
struct picture {
    std::uint32_t number = 0;
    std::string label;
    std::vector<std::uint32_t> pixels;
    std::uint32_t exposure_us = 500;
};
} // namespace newer
inline constexpr ise::subscription<newer::picture> newer_camera{"camera"};

picture picture_of(std::uint32_t number, std::size_t pixels = 20'000) {
    picture made{number, fmt::format("no. {}", number), std::vector<std::uint32_t>(pixels)};
    std::iota(made.pixels.begin(), made.pixels.end(), number);
    return made;
}
bool is_whole(const picture& seen, std::size_t pixels = 20'000) {
    const auto right = picture_of(seen.number, pixels);
    return seen.label == right.label && seen.pixels == right.pixels;
}

// One for the publisher, and one for each connection that knows the block.
int mapped_blocks() { return mappings("memfd:ise-block"); }

ise::task<ise::subscriber<decltype(camera)>> subscribe(ise::remote to, ise::subscribe_options how) {
    auto made = co_await to.subscribe(camera, how);
    co_return made;
}

ise::task<ise::subscriber<decltype(newer_camera)>> subscribe_newer(ise::remote to) {
    auto made = co_await to.subscribe(newer_camera);
    co_return made;
}

struct harbour {
    harbour() : boat(all.add("boat")), out(boat.publish(camera)) { boat.listen(at); }

    party& add_shore(const std::string& name) { return all.add(name); }
    auto subscribe(party& shore, ise::subscribe_options how = ise::subscribe_options::lossless(100)) {
        return all.run(shore, shm_loans_test::subscribe(shore.at(at), how));
    }
    // Publishes one, and gives what comes.
    template <class Subscriber>
    ise::received<picture> pass(Subscriber& from, picture sent) {
        out(std::move(sent));
        return receive(from);
    }
    template <class Subscriber>
    ise::received<picture> receive(Subscriber& from) {
        ise::received<picture> got;
        all.run_until([&] { return (got = from.try_next()) || from.ended(); });
        REQUIRE(got);
        return got;
    }
    // The next ones are these, whole.
    template <class Subscriber>
    void receive_whole(Subscriber& from, std::uint32_t first, std::uint32_t end) {
        for (std::uint32_t number = first; number < end; ++number) {
            auto got = receive(from);
            REQUIRE(got->number == number);
            REQUIRE(is_whole(*got));
        }
    }
    // Until packets are loaned, and not sent.
    template <class Subscriber>
    void begin_to_loan(Subscriber& to) {
        for (std::uint32_t number = 0; number < 3; ++number) REQUIRE(is_whole(*pass(to, picture_of(number))));
        REQUIRE(mapped_blocks() > 0);
    }

    real_parties all;
    std::string at = fmt::format("shm://@ise-unit-shm-loans-{}", ::getpid());
    party& boat;
    ise::publication<decltype(camera)> out;
};

} // namespace

TEST_CASE("large packets are read where they were published, again and again in the same memory", "[shm]") {
    harbour here;
    auto& shore = here.add_shore("shore");
    auto pictures = here.subscribe(shore, ise::subscribe_options::keep_last(100));
    here.begin_to_loan(pictures);
    const auto before = mapped_blocks();
    const auto descriptors = open_descriptors();
    for (std::uint32_t number = 0; number < 500; ++number) REQUIRE(is_whole(*here.pass(pictures, picture_of(number))));
    CHECK(mapped_blocks() <= before + 4); // the newest is kept for who comes later
    CHECK(open_descriptors() <= descriptors + 2);
}

TEST_CASE("packets of all sizes arrive whole and in order", "[shm]") {
    harbour here;
    auto pictures = here.subscribe(here.add_shore("shore"));
    const auto pixels_of = [](std::uint32_t number) {
        const std::size_t sizes[] = {0, 1, 1'000, 3'000, 4'096, 5'000, 20'000, 40'000, 100'000, 3'000'000, 20'000'000};
        return sizes[number * 7 % std::size(sizes)];
    };
    std::uint32_t next = 0;
    for (std::uint32_t number = 0; number < 44; ++number) {
        here.out(picture_of(number, pixels_of(number)));
        if (number % 4 != 3) continue;
        for (; next <= number; ++next) {
            auto got = here.receive(pictures);
            REQUIRE(got->number == next);
            REQUIRE(is_whole(*got, pixels_of(next)));
        }
    }
}

TEST_CASE("many subscribers read the same memory, also two over one connection", "[shm]") {
    harbour here;
    std::vector<ise::subscriber<decltype(camera)>> subscribers;
    for (int i = 0; i < 4; ++i) subscribers.push_back(here.subscribe(here.add_shore(fmt::format("shore-{}", i))));
    subscribers.push_back(here.subscribe(here.add_shore("another")));
    auto& shared = here.add_shore("shared");
    for (int i = 0; i < 2; ++i) subscribers.push_back(here.subscribe(shared));
    for (std::uint32_t number = 0; number < 50; ++number) {
        here.out(picture_of(number));
        for (auto& one : subscribers) here.receive_whole(one, number, number + 1);
    }
}

TEST_CASE("a subscriber that does not take its packets keeps neither the publisher nor another one waiting", "[shm]") {
    harbour here;
    auto slow = here.subscribe(here.add_shore("slow"), ise::subscribe_options::keep_last(1000));
    auto fast = here.subscribe(here.add_shore("fast"));
    constexpr std::uint32_t count = 300;
    for (std::uint32_t number = 0; number < count; ++number) REQUIRE(is_whole(*here.pass(fast, picture_of(number))));
    // Those that were loaned are untouched, and those that were sent follow them.
    here.receive_whole(slow, 0, count);
}

TEST_CASE("what has arrived is whole after the end of its session, while the publisher goes on", "[shm]") {
    harbour here;
    auto& shore = here.add_shore("shore");
    auto pictures = here.subscribe(shore);
    here.begin_to_loan(pictures);
    for (std::uint32_t number = 100; number < 110; ++number) here.out(picture_of(number));
    here.all.run_until([&] { return pictures.counts().received >= 13; });
    auto other = here.subscribe(here.add_shore("other"));
    const bool boat_ends = GENERATE(true, false);
    auto& ends = boat_ends ? here.boat : shore;
    ends.services->sessions().begin()->first->wire().close(ise::failure(ise::errc::peer_lost, "cut"));
    for (std::uint32_t number = 200; number < 240; ++number) REQUIRE(is_whole(*here.pass(other, picture_of(number))));
    here.receive_whole(pictures, 100, 110);
}

TEST_CASE("subscribers with a newer version of the packet, or without its type, read loaned packets too", "[shm]") {
    harbour here;
    auto& newer_shore = here.add_shore("newer");
    auto adapting = here.all.run(newer_shore, subscribe_newer(newer_shore.at(here.at)));
    auto& tool = here.add_shore("tool");
    const auto contract =
        ise::dynamic_contract::make("camera", ise::service_kind::subscription, camera.types().schemas).value();
    auto untyped = here.all.run(tool, ise::subscribe_dynamic(tool.at(here.at), contract)).value();
    auto plain = here.subscribe(here.add_shore("shore"));
    for (std::uint32_t number = 0; number < 20; ++number) {
        REQUIRE(is_whole(*here.pass(plain, picture_of(number))));
        ise::received<newer::picture> adapted;
        ise::received<ise::dynamic_packet> raw;
        here.all.run_until([&] { return (adapted = adapting.try_next()) || adapting.ended(); });
        here.all.run_until([&] { return (raw = untyped.try_next()) || untyped.ended(); });
        REQUIRE(adapted);
        REQUIRE(raw);
        REQUIRE(is_whole(picture{adapted->number, adapted->label, adapted->pixels}));
        REQUIRE(adapted->exposure_us == 500);
        REQUIRE(is_whole(ise::decode<picture>(raw->encoded())));
    }
    REQUIRE(mapped_blocks() > 3); // all three know blocks
}

TEST_CASE("nothing is left of loans once nobody publishes and nobody reads", "[shm]") {
    {
        harbour here;
        auto pictures = here.subscribe(here.add_shore("shore"));
        here.begin_to_loan(pictures);
        for (std::uint32_t number = 0; number < 5; ++number) here.out(picture_of(number));
        here.all.run_until([&] { return pictures.counts().received >= 8; });
    }
    CHECK(mapped_blocks() == 0);
}

TEST_CASE("a publication may outlive its component", "[shm]") {
    {
        ise::publication<decltype(camera)> out;
        {
            harbour here;
            auto pictures = here.subscribe(here.add_shore("shore"));
            here.begin_to_loan(pictures);
            SECTION("that published a large packet last") {}
            SECTION("that published a small packet last") { here.out(picture_of(3, 10)); }
            out = here.out;
        }
    }
    CHECK(mapped_blocks() == 0);
}

TEST_CASE("blocks that a subscriber has returned are freed while nothing is published", "[shm]") {
    ise::sim::world world;
    auto host = world.host("boat").start_process("boat").make_loop("main");
    const auto pool = block_pool::of(host->loop());
    const auto rings =
        std::make_shared<const mapping>(mapping::of(make_descriptors(ring_bytes).value().memory, ring_bytes).value());
    int sockets[2];
    REQUIRE(::socketpair(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0, sockets) == 0);
    const shm_fd ours(sockets[0]), theirs(sockets[1]);
    lender lends(pool, rings, 0, ours.get());
    const auto give_back = [&] { rings->returned(0)[0].fetch_or(1); };
    {
        ise::buffer large(100'000, pool.get());
        large.grow(100'000);
        const ise::shared_bytes content(std::move(large));
        REQUIRE_FALSE(lends.loan(content)); // the subscriber has to map the block first
        give_back();
        REQUIRE(lends.loan(content));
    }
    world.run_for(20s);
    CHECK(mapped_blocks() == 1);
    give_back();
    world.run_for(20s);
    CHECK(mapped_blocks() == 0);
}

TEST_CASE("where files may not be large, large packets are sent as bytes", "[shm]") {
    const auto child = fork_child([&] {
        harbour here;
        auto pictures = here.subscribe(here.add_shore("shore"));
        const rlimit small{65'536, 65'536};
        if (::setrlimit(RLIMIT_FSIZE, &small) != 0) return 2;
        for (std::uint32_t number = 0; number < 20; ++number) {
            here.out(picture_of(number));
            auto got = here.receive(pictures);
            if (got->number != number || !is_whole(*got)) return 1;
        }
        return 0;
    });
    int status = -1;
    REQUIRE(::waitpid(child, &status, 0) == child);
    CHECK(status == 0);
}

TEST_CASE("where the system refuses shared blocks, large packets are sent as bytes", "[shm]") {
    struct refusal {
        const char* what;
        long call;
        int argument;
        std::uint32_t value;
    };
    const auto refused = GENERATE(values<refusal>({
        {"memfd_create", SYS_memfd_create, -1, 0},
        {"ftruncate", call_of_ftruncate, -1, 0},
        {"fallocate", SYS_fallocate, -1, 0},
        {"sealing", call_of_fcntl, 1, F_ADD_SEALS},
        {"shared mappings", call_of_mmap, 3, MAP_SHARED},
        {"the subscriber's mapping", call_of_mmap, 2, PROT_READ},
        {"passing descriptors", SYS_sendmsg, -1, 0},
    }));
    CAPTURE(refused.what);
    const auto child = fork_child([&] {
        harbour here;
        auto pictures = here.subscribe(here.add_shore("shore"));
        std::vector<int> heap(50'000'000); // with its pages: no more is asked for in what follows
        heap = {};
        deny(refused.call, refused.argument, refused.value);
        for (std::uint32_t number = 0; number < 20; ++number) {
            here.out(picture_of(number));
            auto got = here.receive(pictures);
            if (got->number != number || !is_whole(*got)) return 1;
        }
        return 0;
    });
    int status = -1;
    REQUIRE(::waitpid(child, &status, 0) == child);
    REQUIRE(WIFEXITED(status));
    if (WEXITSTATUS(status) == 77) return ise_test::skip("this system has no seccomp filters");
    CHECK(WEXITSTATUS(status) == 0);
}

// --- peers that break the rules --------------------------------------------------------------------------------------
namespace {

struct reader {
    std::shared_ptr<const mapping> rings =
        std::make_shared<const mapping>(mapping::of(make_descriptors(ring_bytes).value().memory, ring_bytes).value());
    borrower borrows{rings, 0};

    bool notice(std::uint32_t slot, std::size_t size, std::vector<shm_fd> passed) {
        ise::buffer raw;
        raw.append(slot);
        raw.append(static_cast<std::uint32_t>(size));
        return borrows.on_notice(raw.view(), passed);
    }
    bool notice(std::uint32_t slot, std::size_t size, shm_fd passed) {
        std::vector<shm_fd> one;
        one.push_back(std::move(passed));
        return notice(slot, size, std::move(one));
    }
    // The bits of what was given back since.
    std::uint64_t returned() {
        const auto words = rings->returned(0);
        return words[0].exchange(0) | std::uint64_t{words[1].exchange(0)} << 32;
    }
};

} // namespace

TEST_CASE("a block is returned when it has been mapped, and after each loan", "[shm]") {
    reader here;
    REQUIRE(here.notice(63, 65'536, memory_of(65'536)));
    CHECK(here.returned() == std::uint64_t{1} << 63);
    {
        auto first = here.borrows.borrow({63, 0, 65'536}).value();
        auto second = here.borrows.borrow({63, 65'000, 536}).value();
        auto moved = std::move(first);
        CHECK(here.returned() == 0);
        CHECK(moved.encoded().size() == 65'536);
        CHECK(second.weight() == 536);
    }
    CHECK(here.returned() == std::uint64_t{1} << 63);
    SECTION("an empty slot has nothing to borrow, and what is on loan stays") {
        auto held = here.borrows.borrow({63, 0, 10}).value();
        REQUIRE(here.notice(63, 0, std::vector<shm_fd>()));
        CHECK(here.borrows.borrow({63, 0, 10}).error().code() == ise::errc::protocol_error);
        CHECK(std::ranges::all_of(held.encoded(), [](std::byte one) { return one == std::byte{}; }));
    }
    SECTION("references beyond the block are refused") {
        const auto wrong = GENERATE(values<ise::loan_reference>({{63, 65'536, 1},
                                                                 {63, 0, 65'537},
                                                                 {63, 1, 65'536},
                                                                 {63, 0xffff'ffff, 2},
                                                                 {63, 2, 0xffff'ffff},
                                                                 {62, 0, 1},
                                                                 {64, 0, 1},
                                                                 {0xffff'ffff, 0, 1}}));
        CAPTURE(wrong.slot, wrong.offset, wrong.size);
        CHECK(here.borrows.borrow(wrong).error().code() == ise::errc::protocol_error);
    }
}

TEST_CASE("notices that break the rules are refused", "[shm]") {
    reader here;
    SECTION("memory that can be shrunk") { CHECK_FALSE(here.notice(0, 65'536, memory_of(65'536, F_SEAL_GROW))); }
    SECTION("memory of another size") { CHECK_FALSE(here.notice(0, 65'536, memory_of(65'535))); }
    SECTION("a file") { CHECK_FALSE(here.notice(0, 65'536, shm_fd(::open("/proc/self/exe", O_RDONLY | O_CLOEXEC)))); }
    SECTION("a slot that is none") { CHECK_FALSE(here.notice(64, 65'536, memory_of(65'536))); }
    SECTION("two descriptors") {
        std::vector<shm_fd> two;
        two.push_back(memory_of(65'536));
        two.push_back(memory_of(65'536));
        CHECK_FALSE(here.notice(0, 65'536, std::move(two)));
    }
    SECTION("half a notice") {
        const std::array<std::byte, 7> half{};
        std::vector<shm_fd> none;
        CHECK_FALSE(here.borrows.on_notice(half, none));
    }
    CHECK(here.returned() == 0);
}

TEST_CASE("blocks that are not mapped are not returned", "[shm]") {
    reader here;
    SECTION("as its memory did not arrive") { CHECK(here.notice(0, 65'536, std::vector<shm_fd>())); }
    SECTION("as they are more than a connection may loan") {
        CHECK(here.notice(1, max_loaned_bytes, memory_of(max_loaned_bytes)));
        CHECK(here.returned() == 2);
        CHECK(here.notice(0, 4096, memory_of(4096)));
        CHECK(here.returned() == 0);
        CHECK(here.notice(1, 0, std::vector<shm_fd>())); // now there is room
        CHECK(here.returned() == 1);
        CHECK(here.borrows.borrow({0, 0, 4096}));
        here.returned();
        CHECK(here.notice(2, 4096, memory_of(4096)));
        CHECK(here.returned() == 4);
        return;
    }
    SECTION("as they are more than a connection may loan, and gone before there is room") {
        CHECK(here.notice(1, max_loaned_bytes, memory_of(max_loaned_bytes)));
        CHECK(here.notice(0, 4096, memory_of(4096)));
        CHECK(here.notice(0, 0, std::vector<shm_fd>()));
        here.returned();
        CHECK(here.notice(1, 0, std::vector<shm_fd>()));
        CHECK(here.returned() == 0);
    }
    SECTION("as the one that is replaced is still on loan") {
        CHECK(here.notice(1, max_loaned_bytes, memory_of(max_loaned_bytes)));
        {
            const auto held = here.borrows.borrow({1, 0, 1}).value();
            here.returned();
            CHECK(here.notice(1, 4096, memory_of(4096)));
            CHECK(here.returned() == 0);
        }
        here.returned();
        CHECK(here.notice(1, 4096, memory_of(4096)));
        CHECK(here.returned() == 2);
    }
    CHECK(here.borrows.borrow({0, 0, 1}).error().code() == ise::errc::protocol_error);
}

namespace {

struct frames_user final : ise::net::connection::user {
    ise::result<void> on_frame(const ise::net::carried_frame& received) override {
        ++frames;
        body.assign(received.body.begin(), received.body.end());
        content.reset();
        if (received.object && received.object->is_encoded()) content = received.object->encoded().size();
        return {};
    }
    void on_closed(const ise::failure& cause) override { end = cause; }

    int frames = 0;
    ise::bytes body;
    std::optional<std::size_t> content; // of what was loaned
    std::optional<ise::failure> end;
};

ise::task<std::unique_ptr<ise::stream>> accept_one(ise::listener& on) {
    auto [problem, made] = co_await on.accept();
    co_return std::move(made);
}

} // namespace

TEST_CASE("a frame that refers to memory wrongly ends its session", "[shm]") {
    real_parties all;
    auto& here = all.add("here");
    const auto at = ise::endpoint::parse(fmt::format("shm://@ise-unit-shm-frames-{}", ::getpid())).value();
    auto listening = at.kind->listen(here.on, at, {}).value();
    auto connecting = ise_test::start(here.on, ise::net::connect_until(here.on, at, here.on.now() + 10s));
    auto accepted = all.run(here, accept_one(*listening));
    std::array<std::byte, 1> first{};
    auto reading = ise_test::start(here.on, accepted->read_some(asio::buffer(first))); // which agrees on the memory
    all.run_until([&] { return connecting->done; });
    const auto line = std::move(connecting->get().value());
    const asio::const_buffer greeting(first.data(), first.size());
    REQUIRE(line->try_write({&greeting, 1}).bytes == 1);
    all.run_until([&] { return reading->done; });
    ise::net::session_terms terms;
    terms.features = ise::wire::feature::first | ise::wire::feature::loans;
    terms.we_accept.max_message_bytes = 100'000;
    auto user = std::make_shared<frames_user>();
    auto connection =
        std::make_shared<ise::net::connection>(here.on, std::move(accepted), terms, ise::wire::parser(1 << 20));
    connection->start(here.scope, user);
    auto& loans = dynamic_cast<ise::loans&>(*line);

    ise::shared_bytes_maker maker;
    maker.use(*loans.memory());
    const auto content = maker.make(200'000);
    auto* at_content = ise::shared_bytes_maker::open(content);
    std::memset(at_content, 7, content.size());
    const auto part = [&](std::size_t size) {
        auto made = content;
        made.truncate(size);
        return made;
    };
    REQUIRE_FALSE(loans.loan(part(50'000))); // the peer does not know the block yet
    std::optional<ise::loan_reference> good;
    all.run_until([&] { return (good = loans.loan(part(50'000))).has_value(); });
    REQUIRE_FALSE(loans.loan(part(50'000))); // it is on loan
    const auto send = [&](ise::wire::frame_type type, const ise::loan_reference& what, std::size_t cut = 0) {
        ise::buffer frame;
        ise::wire::put_frame(frame, type, ise::wire::flag::attached, 1, [&](ise::buffer& body) {
            if (cut == 0) body.append(std::uint64_t{42});
            what.put(body);
            body.truncate(body.size() - cut);
        });
        const asio::const_buffer whole(frame.data(), frame.size());
        REQUIRE(line->try_write({&whole, 1}).bytes == frame.size());
    };
    const auto packet = ise::wire::frame_type::packet;
    send(packet, *good);
    all.run_until([&] { return user->frames == 1; });
    CHECK(user->body.size() == 8);
    CHECK(user->content == 50'000);
    all.run_until([&] { return (good = loans.loan(part(50'000))).has_value(); }); // it came back

    auto wrong = *good;
    auto code = ise::errc::protocol_error;
    SECTION("another slot") {
        ++wrong.slot;
        send(packet, wrong);
    }
    SECTION("beyond the block") {
        wrong.offset = 0xffff'ff00;
        send(packet, wrong);
    }
    SECTION("more than a message may have") {
        wrong.size = 100'001;
        code = ise::errc::too_large;
        send(packet, wrong);
    }
    SECTION("a request") { send(ise::wire::frame_type::request, wrong); }
    SECTION("no whole reference") { send(packet, wrong, 1); }
    all.run_until([&] { return user->end.has_value(); });
    CHECK(user->end->code() == code);
    CHECK(user->frames == 1);
    line->close();
    listening->close();
}

// --- memory that changes while it is read ----------------------------------------------------------------------------
namespace {

struct part {
    bool flag = false;
    std::string name;
    std::vector<std::string> words;
    std::optional<std::uint16_t> value;
    std::variant<std::uint8_t, std::string, std::vector<double>> either;
    std::map<std::string, std::vector<std::uint8_t>> table;
};
struct changing {
    std::vector<part> parts;
    std::vector<bool> bits;
    std::vector<std::uint64_t> numbers;
};

} // namespace

TEST_CASE("packets are decoded safely from memory that changes meanwhile", "[shm]") {
    if (TESTS_THREADS_ARE_SANITIZED) return ise_test::skip("the race is what is tested");
    changing right;
    for (int i = 0; i < 8; ++i) {
        part one;
        one.flag = i % 2 == 0;
        one.name = std::string(static_cast<std::size_t>(i), 'n');
        one.words = {"one", "two", "three"};
        if (i % 3 == 0) one.value = 7;
        if (i % 3 == 1) one.either = "either";
        if (i % 3 == 2) one.either = std::vector<double>{1, 2, 3};
        one.table = {{"a", {1, 2, 3}}, {"b", {}}};
        right.parts.push_back(std::move(one));
    }
    right.bits.assign(50, true);
    right.numbers.assign(50, 1);
    const auto raw = ise::encode(right);
    auto shared = raw;
    std::atomic<bool> enough{false};
    std::thread other([&] {
        std::uint32_t random = 1;
        while (!enough) {
            random = random * 1'664'525 + 1'013'904'223;
            const auto place = (random >> 8) % shared.size();
            auto* at = const_cast<volatile std::byte*>(shared.data() + place);
            *at = std::byte(random >> 4);
            *at = raw[place];
        }
    });
    changing seen;
    int decoded = 0;
    for (int round = 0; round < 20'000; ++round) {
        try {
            ise::decode_into(seen, shared);
            ++decoded;
        } catch (const ise::error&) {}
    }
    enough = true;
    other.join();
    CHECK(decoded > 0);
}

} // namespace shm_loans_test
