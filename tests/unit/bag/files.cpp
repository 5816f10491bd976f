// Files in MCAP: what was written is read, whole, cut at any byte and damaged.
#include <ise/bag/compression.hpp>
#include <ise/bag/reader.hpp>
#include <ise/bag/recover.hpp>
#include <ise/bag/writer.hpp>

#include <support/catch.hpp>

#include <array>
#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <optional>
#include <string>
#include <utility>
#include <vector>

#include <stdlib.h>
#include <unistd.h>

namespace {

using namespace ise;
using namespace ise::bag;

// Ten messages a chunk at most; log times go back and forth.
bytes sample(compression packing, int messages, bool closed = true) {
    bytes made;
    writer_options how;
    how.packing = packing;
    how.chunk_bytes = 400;
    auto out = writer::make(memory_sink(made), how).value();
    auto schema = out.add_schema("text", "", as_bytes("")).value();
    std::uint16_t channels[] = {out.add_channel(schema, "a", "text").value(), out.add_channel(0, "b", "text").value()};
    for (int i = 0; i < messages; ++i) {
        auto text = "message " + std::to_string(i);
        message_record one;
        one.channel_id = channels[i % 2];
        one.sequence = static_cast<std::uint32_t>(i);
        one.log_time = static_cast<timestamp>(1000 + (i ^ 3)); // 3 2 1 0 7 6 5 4 …
        one.publish_time = one.log_time;
        one.data = as_bytes(text);
        out.write(one).value();
        if (i == messages / 2) {
            attachment_record file;
            file.name = "deployment.toml";
            file.media_type = "application/toml";
            file.data = as_bytes("[deployment]");
            out.attach(file).value();
        }
    }
    metadata_record about;
    about.name = "ise";
    about.metadata["host"] = "boat";
    out.write(about).value();
    if (closed) out.close().value();
    return made;
}

std::vector<std::pair<timestamp, std::string>> messages_of(source& from, const summary& about,
                                                           message_filter which = message_filter()) {
    std::vector<std::pair<timestamp, std::string>> all;
    message_reader in(from, about, std::move(which));
    for (auto got = in.next().value(); got; got = in.next().value())
        all.emplace_back(got->log_time, std::string(as_text(got->data)));
    return all;
}

} // namespace

TEST_CASE("a recording is read by log time, with every compression", "[bag]") {
    for (auto packing : {compression::none, compression::lz4, compression::zstd}) {
        auto file = sample(packing, 100);
        auto from = memory_source(file);
        for (auto how : {depth::index, depth::whole}) {
            auto about = read_summary(*from, how).value();
            CHECK(about.complete);
            CHECK(!about.damage);
            CHECK(about.indexed == (how == depth::index));
            CHECK(about.statistics.message_count == 100);
            CHECK(about.statistics.channel_message_counts[0] == 50);
            CHECK(about.header.profile == "ise");
            CHECK(about.channels.at(1).topic == "b");
            CHECK(about.chunks.size() > 3);
            auto all = messages_of(*from, about);
            REQUIRE(all.size() == 100);
            for (std::size_t i = 0; i < all.size(); ++i) {
                CHECK(all[i].first == 1000 + i);
                CHECK(all[i].second == "message " + std::to_string(i ^ 3));
            }
            auto file_about = read_attachment(*from, about.attachments.at(0)).value();
            CHECK(file_about.name == "deployment.toml");
            CHECK(as_text(file_about.data) == "[deployment]");
            CHECK(read_metadata(*from, about.metadata.at(0)).value().metadata.at("host") == "boat");
        }
    }
}

TEST_CASE("a recording is read from one time to another, and by channel", "[bag]") {
    auto file = sample(compression::zstd, 100);
    auto from = memory_source(file);
    auto about = read_summary(*from).value();
    message_filter which;
    which.from = 1010;
    which.until = 1020;
    which.wanted = [](const channel_record& channel) { return channel.topic == "a"; };
    auto all = messages_of(*from, about, std::move(which));
    REQUIRE(all.size() == 5);
    CHECK(all.front().first == 1011);
    CHECK(all.back().first == 1019);
}

TEST_CASE("messages outside of chunks are read by time, too", "[bag]") {
    bytes file;
    writer_options how;
    how.chunks = false;
    how.chunk_index = false;
    auto out = writer::make(memory_sink(file), how).value();
    auto channel = out.add_channel(0, "a", "text").value();
    for (auto time : {30u, 10u, 20u}) {
        message_record one;
        one.channel_id = channel;
        one.log_time = time;
        one.data = as_bytes("x");
        out.write(one).value();
    }
    out.close().value();
    auto from = memory_source(file);
    auto about = read_summary(*from).value();
    auto all = messages_of(*from, about);
    REQUIRE(all.size() == 3);
    CHECK(all[0].first == 10);
    CHECK(all[2].first == 30);
}

TEST_CASE("a recording that was cut at any byte is recovered up to there", "[bag]") {
    for (auto packing : {compression::none, compression::zstd}) {
        auto whole = sample(packing, 40);
        std::uint64_t before = 0;
        for (std::size_t size = magic.size(); size < whole.size(); ++size) {
            bytes_view cut(whole.data(), size);
            auto from = memory_source(cut, "cut.mcap");
            auto about = read_summary(*from).value();
            INFO("cut at " << size);
            CHECK(!about.complete);
            REQUIRE(about.damage);
            CHECK(about.damage->message().find("cut.mcap") != std::string::npos);
            bytes mended;
            auto out = writer::make(memory_sink(mended)).value();
            auto got = recover(*from, out).value();
            CHECK(got.messages >= about.statistics.message_count);
            CHECK(got.messages >= before); // more bytes, no fewer messages
            before = got.messages;
            auto again = memory_source(mended);
            auto healed = read_summary(*again, depth::whole).value();
            CHECK(healed.complete);
            CHECK(!healed.damage);
            CHECK(healed.statistics.message_count == got.messages);
        }
        CHECK(before == 40);
    }
}

TEST_CASE("a damaged chunk is skipped and named, and the others are recovered", "[bag]") {
    auto file = sample(compression::none, 100);
    auto from = memory_source(file, "sea.mcap");
    auto about = read_summary(*from).value();
    auto& second = about.chunks.at(1);
    file[second.chunk_start_offset + second.chunk_length - 5] ^= std::byte{1};
    auto checked = read_summary(*from, depth::whole).value();
    REQUIRE(checked.damage);
    CHECK(checked.damage->message() ==
          "sea.mcap: at byte " + std::to_string(second.chunk_start_offset) + ": a Chunk: its CRC does not match");
    message_reader in(*from, about);
    std::optional<failure> why;
    for (;;) {
        auto got = in.next();
        if (!got) why = got.error();
        if (!got || !*got) break;
    }
    REQUIRE(why);
    CHECK(why->code() == errc::malformed);
    bytes mended;
    auto out = writer::make(memory_sink(mended)).value();
    auto got = recover(*from, out).value();
    CHECK(got.damaged_chunks.size() == 1);
    CHECK(got.messages < 100);
    CHECK(got.messages > 80);
}

TEST_CASE("of a file whose first chunk is damaged, which describes the channels, the others are recovered", "[bag]") {
    auto file = sample(compression::none, 100);
    auto from = memory_source(file, "sea.mcap");
    auto about = read_summary(*from).value();
    REQUIRE(about.chunks.size() > 2);
    auto& first = about.chunks.at(0);
    file[first.chunk_start_offset + first.chunk_length - 5] ^= std::byte{1};
    for (bool closed : {true, false}) {
        INFO("closed " << closed);
        auto last = about.chunks.back();
        auto cut = file;
        if (!closed) cut.resize(last.chunk_start_offset + last.chunk_length); // no summary
        auto there = memory_source(cut, "sea.mcap");
        bytes mended;
        auto out = writer::make(memory_sink(mended)).value();
        auto got = recover(*there, out).value();
        CHECK(got.damaged_chunks.size() == 1);
        CHECK((closed ? got.messages : got.left_out) > 80);
        CHECK((closed ? got.left_out : got.messages) == 0);
        auto whole = read_summary(*memory_source(mended, "mended.mcap"), depth::whole).value();
        CHECK(!whole.damage);
        CHECK(whole.statistics.message_count == got.messages);
    }
}

TEST_CASE("a chunk that decompresses to more than it says, or may, is refused", "[bag]") {
    std::string zeros(std::size_t{8} << 20, '\0');
    for (auto kind : {compression::lz4, compression::zstd}) {
        buffer packed, to;
        compressor(kind).compress(as_bytes(zeros), packed);
        CHECK(packed.size() < 100'000);
        auto more = decompress(kind, packed.view(), 1000, to);
        REQUIRE(!more);
        CHECK(more.error().message() == "it decompresses to more than its 1000 bytes");
        CHECK(to.capacity() < 4096);
        auto less = decompress(kind, packed.view(), zeros.size() * 100, to);
        REQUIRE(!less);
        CHECK(to.capacity() < zeros.size() * 4); // not what it claims
        CHECK(decompress(kind, packed.view(), zeros.size(), to).has_value());
        CHECK(as_text(to.view()) == zeros);
    }
    auto file = sample(compression::zstd, 100);
    auto from = memory_source(file);
    reader_limits limits;
    limits.max_chunk_bytes = 100;
    auto about = read_summary(*from, depth::whole, limits).value();
    REQUIRE(about.damage);
    CHECK(about.damage->code() == errc::too_large);
    CHECK(about.damage->message().find("max_chunk_bytes") != std::string::npos);
}

TEST_CASE("a file with schemas beyond max_schema_bytes is recovered without these", "[bag]") {
    bytes file;
    writer_options how;
    how.level = 3;
    auto out = writer::make(memory_sink(file), how).value();
    auto add = [&](const std::string& topic, std::size_t schema_bytes) {
        bytes text(schema_bytes);
        auto schema = out.add_schema(topic, "", text).value();
        message_record one;
        one.channel_id = out.add_channel(schema, topic, "text").value();
        one.data = as_bytes("message");
        out.write(one).value();
    };
    add("small", 100);
    for (int i = 0; i < 40; ++i) add("large " + std::to_string(i), 100'000);
    add("small too", 100);
    out.close().value();
    reader_limits limits;
    limits.max_schema_bytes = 1'000'000;
    auto from = memory_source(file);
    bytes mended;
    auto to = writer::make(memory_sink(mended), how).value();
    auto got = recover(*from, to, limits).value();
    CHECK(got.messages == 11);
    CHECK(got.left_out == 31);
    REQUIRE(got.damaged_chunks.size() == 1);
    CHECK(got.damaged_chunks[0].message().find("max_schema_bytes") != std::string::npos);
    auto there = memory_source(mended);
    auto about = read_summary(*there, depth::whole, limits).value();
    CHECK(about.complete);
    CHECK(!about.damage);
    CHECK(about.channels.size() == 11);
}

TEST_CASE("a file that is no recording is refused with its name", "[bag]") {
    auto from = memory_source(as_bytes("version https://git-lfs.github.com/spec/v1"), "pointer.mcap");
    auto got = read_summary(*from);
    REQUIRE(!got);
    CHECK(got.error().message() ==
          "pointer.mcap: at byte 0: it is not an MCAP file: it does not begin with MCAP's magic bytes");
    auto none = open_file("/nowhere/at.mcap");
    REQUIRE(!none);
    CHECK(none.error().code() == errc::io_failed);
}

TEST_CASE("a file of more than 4 GiB is read at its end", "[bag]") {
    constexpr std::uint64_t size = (std::uint64_t{1} << 32) + 3;
    auto name = (std::filesystem::temp_directory_path() / "ise_bag_XXXXXX").string();
    const int made = ::mkstemp(name.data());
    REQUIRE(made >= 0);
    REQUIRE(::ftruncate(made, static_cast<off_t>(size - 3)) == 0); // a hole
    auto* end = ::fdopen(made, "a");
    REQUIRE(std::fputs("end", end) >= 0);
    REQUIRE(std::fclose(end) == 0);
    auto file = open_file(name);
    ::unlink(name.c_str());
    REQUIRE(file);
    CHECK((*file)->size().value() == size);
    std::array<std::byte, 8> last{};
    REQUIRE((*file)->read(size - 3, last).value() == 3);
    CHECK(as_text(bytes_view(last).first(3)) == "end");
}

TEST_CASE("no byte of a recording that is changed harms its reader", "[bag]") {
    auto whole = sample(compression::lz4, 12);
    for (std::size_t at = 0; at < whole.size(); ++at) {
        auto file = whole;
        file[at] ^= std::byte{0xff};
        auto from = memory_source(file);
        for (auto how : {depth::index, depth::whole}) {
            auto about = read_summary(*from, how);
            if (!about) continue;
            message_reader in(*from, *about);
            std::size_t count = 0;
            for (auto got = in.next(); got && *got && count < 1000; got = in.next()) ++count;
            CHECK(count <= 12);
        }
        bytes mended;
        auto out = writer::make(memory_sink(mended)).value();
        [[maybe_unused]] auto got = recover(*from, out);
    }
}
