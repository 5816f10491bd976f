#include <ise/packet/shared_bytes.hpp>

#include <support/catch.hpp>

#include <memory>
#include <span>
#include <vector>

namespace shared_bytes_test {

namespace {

ise::shared_bytes make(ise::shared_bytes_maker& maker, std::size_t size, unsigned char fill) {
    auto& room = maker.room();
    for (std::size_t i = 0; i < size; ++i) room.append(fill);
    return maker.share();
}

bool holds(const ise::shared_bytes& content, std::size_t size, unsigned char fill) {
    if (content.size() != size) return false;
    for (auto one : content.view())
        if (one != std::byte{fill}) return false;
    return true;
}

} // namespace

TEST_CASE("shared bytes keep their content, whatever is made after them") {
    ise::shared_bytes_maker maker;
    std::vector<ise::shared_bytes> kept;
    const std::size_t sizes[] = {0, 1, 64, 1023, 1024, 1025, 4096, 100'000, 64, 64, 5};
    for (int round = 0; round < 8; ++round)
        for (std::size_t i = 0; i < std::size(sizes); ++i)
            kept.push_back(make(maker, sizes[i], static_cast<unsigned char>(kept.size())));
    for (std::size_t i = 0; i < kept.size(); ++i) {
        CAPTURE(i);
        CHECK(holds(kept[i], sizes[i % std::size(sizes)], static_cast<unsigned char>(i)));
    }
}

TEST_CASE("shared bytes outlive the one that made them") {
    ise::shared_bytes small, big;
    {
        ise::shared_bytes_maker maker;
        small = make(maker, 10, 1);
        big = make(maker, 10'000, 2);
    }
    CHECK(holds(small, 10, 1));
    CHECK(holds(big, 10'000, 2));
}

namespace {

// Counts what is taken from it.
struct counted_memory final : ise::large_memory_source {
    std::span<std::byte> take(std::size_t least) override {
        taken.push_back(std::make_unique<ise::bytes>(least));
        return *taken.back();
    }
    bool give_back(const std::byte* at) noexcept override {
        return std::erase_if(taken, [at](const auto& one) { return one->data() == at; }) > 0;
    }
    void add_buffer() noexcept override { ++buffers; }
    void remove_buffer() noexcept override { --buffers; }

    std::vector<std::unique_ptr<ise::bytes>> taken;
    int buffers = 0;
};

} // namespace

TEST_CASE("a source of large memory is kept by its buffers, and what was large once keeps nothing of it") {
    counted_memory memory;
    {
        ise::shared_bytes_maker maker;
        maker.use(memory);
        CHECK(memory.buffers > 0);
        auto large = make(maker, 100'000, 1);
        CHECK(memory.taken.size() == 1);
        CHECK(holds(large, 100'000, 1));
        large = {};
        CHECK(memory.taken.empty());
        SECTION("a small one is made behind it") { CHECK(holds(make(maker, 10, 2), 10, 2)); }
        SECTION("a small one is encoded behind it, and copied elsewhere") {
            maker.room().append(std::uint64_t{1});
            CHECK(memory.taken.size() == 1); // as large as the last one
            maker.drop_small();
        }
        CHECK(memory.taken.empty());
        large = make(maker, 100'000, 3);
        CHECK(memory.taken.size() == 1);
    }
    CHECK(memory.taken.empty());
    CHECK(memory.buffers == 0);
}

TEST_CASE("a room that was begun and left is empty the next time") {
    ise::shared_bytes_maker maker;
    maker.room().append(std::uint64_t{1}); // an encoder threw
    auto& room = maker.room();
    CHECK(room.empty());
}

TEST_CASE("what lies side by side joins, and nothing else does") {
    ise::shared_bytes_maker maker;
    auto first = make(maker, 10, 1), second = make(maker, 20, 2), big = make(maker, 100'000, 3);
    auto all = first;
    CHECK_FALSE(all.join(big));
    CHECK_FALSE(second.join(first));
    REQUIRE(all.join(second));
    CHECK(all.size() == 30);
    CHECK(holds(all.behind(10), 20, 2));
    all.truncate(10);
    CHECK(holds(all, 10, 1));
}

TEST_CASE("a chunk that somebody holds a part of is not used again") {
    ise::shared_bytes_maker maker;
    auto kept = make(maker, 100, 1);
    for (int i = 0; i < 10'000; ++i) REQUIRE(holds(make(maker, 100, 2), 100, 2));
    CHECK(holds(kept, 100, 1));
}

} // namespace shared_bytes_test
