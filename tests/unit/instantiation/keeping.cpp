// What a keeper needs: limits, its record, and files of bounded size.
#include <ise/instantiation/bounded_log.hpp>
#include <ise/instantiation/cgroup.hpp>
#include <ise/instantiation/keeper.hpp>
#include <ise/instantiation/limits.hpp>

#include <support/catch.hpp>

#include <cerrno>
#include <cstdlib>
#include <filesystem>
#include <fstream>
#include <iterator>

#include <unistd.h>

namespace keeping_test {

using namespace ise::instantiation;
using ise_test::Contains;

namespace {

class kept_folder {
public:
    kept_folder() {
        std::string pattern = (std::filesystem::temp_directory_path() / "ise-keeping-XXXXXX").string();
        if (!::mkdtemp(pattern.data())) throw std::runtime_error("no temporary folder");
        path = pattern;
    }
    ~kept_folder() {
        std::error_code ignored;
        std::filesystem::remove_all(path, ignored);
    }
    std::string operator/(const std::string& name) const { return (path / name).string(); }
    std::filesystem::path path;
};

std::string kept_content(const std::string& file) {
    std::ifstream from(file, std::ios::binary);
    return {std::istreambuf_iterator<char>(from), {}};
}

} // namespace

TEST_CASE("limits are read from texts, and refused with what is allowed") {
    resource_limits limits;
    CHECK(set_limit(limits, "pids", "64"));
    CHECK(set_limit(limits, "memory", "256 MiB"));
    CHECK(set_limit(limits, "cpus", "0.5"));
    CHECK(limits == resource_limits{64, 256 << 20, 0.5});
    CHECK(as_text(limits) == "pids=64 memory=256MiB cpus=0.5");
    CHECK(set_limit(limits, "memory", "1.5GB"));
    CHECK(limits.memory == 1'500'000'000);
    CHECK_THAT(set_limit(limits, "memory", "5 parsecs").error().message(), Contains("a size from 1 MiB to 16 TiB"));
    CHECK_THAT(set_limit(limits, "memory", "1 kB").error().message(), Contains("not '1 kB'"));
    for (const char* wrong : {"", "0", "-1", "1.5", "99999", "many"}) CHECK_FALSE(set_limit(limits, "pids", wrong));
    for (const char* wrong : {"", "0", "-1", "nan", "1e9", "1 cpu"}) CHECK_FALSE(set_limit(limits, "cpus", wrong));
    CHECK_THAT(set_limit(limits, "disk", "1").error().message(), Contains("the limits are pids, memory and cpus"));
}

TEST_CASE("a record is read as it was written, or not at all") {
    kept_status status;
    status.base = 12;
    status.dropped = 7;
    status.trouble = "no\nroom";
    status.life = 3;
    status.mark = "abc";
    status.process = {4711, 99};
    status.ended = true;
    status.how = {true, true, 6, "why"};
    status.ended_at_ms = 5;
    auto text = kept_status_text(status, 1, false);
    CHECK(text.size() == kept_status_bytes);
    auto read = read_kept_status(text).value();
    CHECK(read.base == 12);
    CHECK(read.dropped == 7);
    CHECK(read.trouble == "no room");
    CHECK(read.life == 3);
    CHECK(read.mark == "abc");
    CHECK(read.process == status.process);
    CHECK((read.ended && read.how.known && read.how.by_signal && read.how.number == 6 && read.how.reason == "why" &&
           read.ended_at_ms == 5));
    CHECK_FALSE(read_kept_status(kept_status_text(status, 1, true)));
    auto later = kept_status_text(status, 2, false);
    CHECK_FALSE(read_kept_status(later.substr(0, 500) + text.substr(500))); // half of each
    CHECK_FALSE(read_kept_status(""));
}

TEST_CASE("a log never has more than its two files may have, and keeps the end") {
    kept_folder in;
    auto file = in / "log";
    std::string printed;
    {
        bounded_log log(file, 10'000);
        CHECK_FALSE(log.begin_life("m"));
        for (int line = 0; line < 5000; ++line) {
            auto text = "line " + std::to_string(line) + "\n";
            printed += text;
            log.append(text);
            REQUIRE(std::filesystem::file_size(file) <= 10'000);
        }
        log.append("no end");
    }
    auto kept = kept_content(older_output_of(file)) + kept_content(file);
    printed += "no end";
    CHECK(kept.size() > 10'000);
    CHECK(printed.ends_with(kept));
    auto status = read_kept_status(kept_content(status_file_of(file))).value();
    CHECK(status.base + kept_content(file).size() == printed.size());
    bounded_log next(file, 10'000);
    CHECK(next.begin_life("m") == "started again");
    next.mark_line("started again");
    CHECK_THAT(kept_content(file), ise_test::EndsWith("no end\n--- life 2: started again\n"));
}

TEST_CASE("limits are written to a control group as the kernel reads them") {
    kept_folder in; // a plain folder in its place
    for (const char* name : {"one-", "one-/pids.max", "one-/memory.max", "one-/memory.swap.max",
                             "one-/memory.oom.group", "one-/cpu.max"}) {
        if (std::string(name).find('/') == std::string::npos) std::filesystem::create_directory(in / name);
        else std::ofstream(in / name);
    }
    cgroup group(in / "one-");
    REQUIRE(group.open({64, 256 << 20, 0.5}));
    CHECK((group.keeps_pids() && group.keeps_memory() && group.keeps_cpus()));
    CHECK(kept_content(in / "one-/pids.max") == "64");
    CHECK(kept_content(in / "one-/memory.max") == "268435456");
    CHECK(kept_content(in / "one-/memory.oom.group") == "1");
    CHECK(kept_content(in / "one-/cpu.max") == "50000 100000");
    cgroup bare(in / "two");
    REQUIRE(bare.open({64, 256 << 20, 0.5}));
    CHECK_FALSE((bare.keeps_pids() || bare.keeps_memory() || bare.keeps_cpus()));
    bare.close();
    CHECK_FALSE(std::filesystem::exists(in / "two"));
}

TEST_CASE("a keeper that says nothing does not block the one that waits for it, whatever the last error was") {
    int ends[2];
    REQUIRE(::pipe(ends) == 0);
    errno = EINTR; // of an earlier call
    CHECK(line_of_keeper(ends[0], std::chrono::milliseconds(1)).empty());
    REQUIRE(::write(ends[1], "started 1 2\nmore", 16) == 16);
    CHECK(line_of_keeper(ends[0], std::chrono::milliseconds(1000)) == "started 1 2");
    ::close(ends[0]);
    ::close(ends[1]);
}

} // namespace keeping_test
